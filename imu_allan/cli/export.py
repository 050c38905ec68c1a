# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Write the configuration of a filter from a result file."""

import argparse
import os
from pathlib import Path
from typing import Any

from imu_allan.cli.arguments import positive_number
from imu_allan.writers.filters import CONSUMERS


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'export', help='write the configuration of a filter from a result',
        description='Write noise density and rate random walk as a filter wants them: its keys, '
                    'its units, continuous or per sample. The worst axis counts; where a '
                    'coefficient is not observable its 95 % upper bound stands in.')
    parser.add_argument('result', metavar='RESULT',
                        help='result file, written by: imu_allan analyze RECORDING --json RESULT')
    parser.add_argument('--for', dest='consumer', metavar='NAME', required=True,
                        choices=tuple(CONSUMERS), help='one of: ' + ', '.join(CONSUMERS))
    parser.add_argument('--rate', metavar='HZ', type=positive_number,
                        help='rate at which the filter takes samples or predicts (default: the '
                             "result's sample rate; 100 for px4, 83 for ardupilot)")
    parser.add_argument('--output', metavar='PATH',
                        help='file or existing folder to write to (default: standard output)')
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print or write the configuration."""
    from imu_allan.writers.atomic import write_atomically
    from imu_allan.writers.filters import export
    from imu_allan.writers.result_file import load_result

    config = export(load_result(args.result), args.consumer, args.rate)
    if args.output is None:
        print(config.text, end='')
        return 0
    path = Path(args.output)
    if path.is_dir() or args.output.endswith(os.sep):
        path = path / config.name
    write_atomically(path, config.text.encode())
    print(path)
    return 0
