# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Write the configuration of a filter from a result file."""

import argparse
import os
from pathlib import Path
from typing import Any

from imu_allan.cli import arguments
from imu_allan.writers.atomic import CONFIGURATION
from imu_allan.writers.supported_filters import consumers_by_family


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'export', help='write the configuration of a filter from a result',
        usage='%(prog)s RESULT --for NAME [options]',
        examples=('export out --for kalibr --output imu.yaml',
                  'export out --for vins --aiding 50ms',
                  'export --spec datasheet.yaml --for plain'),
        description='Write the configuration of a filter with its keys, units and convention. '
                    'The numbers are tuned for what usually corrects it; the file says what '
                    'they are expected to reach.')
    parser.add_argument('result', metavar='RESULT', nargs='?',
                        help='result file of analyze --json RESULT, or the folder of --output')
    parser.add_argument('--for', dest='consumer', metavar='NAME', required=True,
                        type=arguments.consumer,
                        help='which filter, also as people call it (vins, ekf); --list names '
                             'them')
    parser.add_argument('--list', action=arguments.Shown, nargs=0,
                        const=lambda: f'{consumers_by_family()}\n',
                        help='name the filters, and end')
    parser.add_argument('--spec', metavar='FILE',
                        help='in place of RESULT: the numbers of a datasheet (YAML with units)')
    parser.add_argument('--rate', metavar='RATE', type=arguments.rate,
                        help='rate at which the filter takes samples or predicts (default: the '
                             "result's sample rate; 100 for px4, 83 for ardupilot)")
    parser.add_argument('--as-measured', action='store_true',
                        help='the coefficients as measured, not tuned')
    parser.add_argument('--aiding', metavar='TIME', type=arguments.duration,
                        help='time between two corrections of the filter (default: what is '
                             'usual for it)')
    parser.add_argument('--coast', metavar='TIME', type=arguments.duration,
                        help='the longest unaided time (default: 60s; 10min for simulators)')
    parser.add_argument('--conservative', action='store_true',
                        help='not overconfident more than 5 %% of the time, on a sensor like in '
                             'this recording')
    parser.add_argument('--inflate', metavar='N=2,K=5', type=arguments.factors, default={},
                        help='factors on top of the numbers; they are written into the file')
    parser.add_argument('-o', '--output', metavar='PATH',
                        help='file or existing folder to write to (default: standard output)')
    parser.set_defaults(run=run, inputs=('result', 'spec'), outputs={'output': CONFIGURATION})


def run(args: argparse.Namespace) -> int:
    """Print or write the configuration."""
    from imu_allan.sensor.noise_model import find_model, load_model
    from imu_allan.writers.atomic import write_atomically
    from imu_allan.writers.filters import CONSUMERS, export, ExportOptions
    from imu_allan.writers.filters.chosen_numbers import result_of_datasheet
    from imu_allan.writers.result_files import load_result

    if (args.result is None) == (args.spec is None):
        args.parser.error('takes a RESULT, or a datasheet by --spec FILE')
    result = load_result(args.result) if args.spec is None else result_of_datasheet(
        load_model(find_model(args.spec)), args.spec, args.rate)
    path = None if args.output is None else Path(args.output)
    if path is not None and (path.is_dir() or args.output.endswith(os.sep)):
        path = path / CONSUMERS[args.consumer].file
    text = export(result, args.consumer, ExportOptions(
        args.rate, args.as_measured, args.aiding, args.coast, args.conservative, args.inflate))
    if path is None:
        print(text, end='')
    else:
        write_atomically(path, text.encode())
        print(path)
    return 0
