# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Draw plots and a report from one or more result files."""

import argparse
from pathlib import Path
from typing import Any

from imu_allan.errors import ImuAllanError


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'report', help='plots and an HTML report; several results are compared',
        examples=('report out --output report',
                  'report monday tuesday --output compared',
                  'report out --format pdf,latex --width 8.5cm'),
        description='Write an HTML report that works offline, and the plots. Several results '
                    'are drawn into one figure, with a table of their differences in units of '
                    'their intervals.')
    parser.add_argument('results', metavar='RESULT', nargs='+',
                        help='result file of analyze --json RESULT, or the folder of --output')
    parser.add_argument('-o', '--output', metavar='DIR', default='.',
                        help='folder to write to (default: this folder)')
    parser.add_argument('--format', metavar='LIST', type=_formats, default=('png', 'svg', 'pdf'),
                        help='what to write besides: png, svg, pdf, and of one result latex, a '
                             'table and a paragraph on the method (default: png,svg,pdf)')
    parser.add_argument('--width', metavar='CM', type=_width,
                        help='of one result: the Allan deviation for a column of a paper, too, '
                             'in centimetres (8.5 or 17 are usual)')
    parser.set_defaults(run=run, inputs=('results',), outputs={'output': ''})


def run(args: argparse.Namespace) -> int:
    """Write the files and print their paths."""
    from imu_allan.writers import folder
    from imu_allan.writers.atomic import write_files
    from imu_allan.writers.result_file import load_result

    results = [load_result(path) for path in args.results]
    pictures = tuple(name for name in args.format if name != 'latex')
    if len(results) > 1 and pictures != args.format:
        raise ImuAllanError('--format latex takes one result')
    if len(results) > 1 and args.width is not None:
        raise ImuAllanError('--width takes one result')
    if len(results) == 1:
        files = folder.report_files(results[0], pictures)
        if pictures != args.format:
            files |= folder.latex_files(results[0])
        if args.width is not None:
            files |= folder.paper_files(results[0], args.width, pictures)
    else:
        from imu_allan.writers.comparison import compare, difference_table, names_of, verdicts
        from imu_allan.writers.terminal import console_of, wrapped

        names = names_of([Path(path) for path in args.results])
        named = dict(zip(names, results, strict=True))
        files = folder.comparison_files(named, pictures)
    paths = write_files(args.output, files)
    if len(results) > 1:
        console = console_of()
        if len(named) > folder.MOST_COMPARED:
            from imu_allan.writers.fleet import Fleet, population_table

            console.print(population_table(Fleet(named), console.width))
        else:
            differences = compare(named)
            for line in wrapped(verdicts(differences), console.width):
                console.print(line)
            console.print()
            console.print(difference_table(differences))
    for path in paths:
        print(path)
    return 0


def _width(text: str) -> float:
    try:
        width = float(text.strip().removesuffix('cm'))
    except ValueError:
        width = 0.0
    if not 5 <= width <= 50:
        raise argparse.ArgumentTypeError(f'{text!r} is not a width of 5 to 50 cm')
    return width


def _formats(text: str) -> tuple[str, ...]:
    formats = tuple(dict.fromkeys(part.strip() for part in text.split(',')))
    unknown = [part for part in formats if part not in ('png', 'svg', 'pdf', 'latex')]
    if unknown:
        raise argparse.ArgumentTypeError(f'{unknown[0]!r} is not one of png, svg, pdf, latex')
    return formats
