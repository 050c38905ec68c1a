# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Draw plots and a report from one or more result files."""

import argparse
from collections.abc import Mapping
from typing import Any, TYPE_CHECKING

from imu_allan.writers.atomic import PICTURES
from imu_allan.writers.terminal import console_of, wrapped

if TYPE_CHECKING:
    from imu_allan.result import Result


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'report', help='plots and an HTML report; several results are compared',
        usage='%(prog)s RESULT... [options]',
        examples=('report out --output report',
                  'report monday tuesday --output compared'),
        description='Write an HTML report that works offline, and the plots. Several results '
                    'are drawn into one figure, with a table of their differences in units of '
                    'their intervals.')
    parser.add_argument('results', metavar='RESULT', nargs='+',
                        help='result file of analyze --json RESULT, or the folder of --output')
    parser.add_argument('-o', '--output', metavar='DIR', default='.',
                        help='folder to write to (default: this folder)')
    parser.add_argument('--format', metavar='LIST', type=_formats, default=tuple(PICTURES),
                        help='formats of the pictures (default: png,svg,pdf)')
    parser.set_defaults(run=run, inputs=('results',), outputs={'output': ''})


def run(args: argparse.Namespace) -> int:
    """Write the files and print their paths."""
    from imu_allan.wording import unit_names
    from imu_allan.writers import result_files
    from imu_allan.writers.atomic import write_files
    from imu_allan.writers.result_files import load_result

    results = [load_result(path) for path in args.results]
    if len(results) == 1:
        paths = write_files(args.output, result_files.report_files(results[0], args.format))
    else:
        named = dict(zip(unit_names(args.results), results, strict=True))
        paths = write_files(args.output, result_files.comparison_files(named, args.format))
        _print_comparison(named, in_detail=len(named) <= result_files.MOST_COMPARED)
    print(*paths, sep='\n')
    return 0


def _print_comparison(results: 'Mapping[str, Result]', *, in_detail: bool) -> None:
    from imu_allan.writers.comparison import compare, difference_table, verdicts
    from imu_allan.writers.fleet import Fleet, population_table

    console = console_of()
    if in_detail:
        console.print(*wrapped(verdicts(results), console.width), '',
                      difference_table(compare(results)), sep='\n')
    else:
        console.print(population_table(Fleet(results), console.width))


def _formats(text: str) -> tuple[str, ...]:
    formats = tuple(dict.fromkeys(part.strip() for part in text.split(',')))
    unknown = [part for part in formats if part not in PICTURES]
    if unknown:
        raise argparse.ArgumentTypeError(f'{unknown[0]!r} is not one of {", ".join(PICTURES)}')
    return formats
