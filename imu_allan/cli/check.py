# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Compare a result or a recording with a datasheet."""

import argparse
from pathlib import Path
import sys
from typing import Any, TYPE_CHECKING

from imu_allan.cli.arguments import positive_number
from imu_allan.errors import printable

if TYPE_CHECKING:
    from imu_allan.result import Result

EXIT_FAILED = 3


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'check', help='compare with a datasheet: pass, fail or cannot tell',
        description='Compare each coefficient with the limit of a datasheet: pass where the '
                    'measured 95 % interval lies below it, fail where it lies above, cannot '
                    'tell where it reaches across or the coefficient is not observable. '
                    'Exit status 3 if any fails.')
    parser.add_argument('source', metavar='RESULT_OR_RECORDING',
                        help='result file (.json), or anything that analyze takes')
    parser.add_argument('--spec', metavar='FILE', required=True,
                        help='datasheet (YAML with units; see config/ for examples)')
    parser.add_argument('--json', metavar='FILE', help='write the verdicts as JSON')
    parser.add_argument('--junit', metavar='FILE', help='write the verdicts as JUnit XML')
    parser.add_argument('--topic', metavar='NAME', help='the Imu topic of a recording')
    parser.add_argument('--rate', metavar='HZ', type=positive_number,
                        help='sample rate of a recording, instead of the one measured')
    parser.add_argument('--no-progress', action='store_true', help='show no progress bar')
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the verdicts, write what was asked for, and return 3 if any coefficient fails."""
    from imu_allan.noise.model import load_model
    from imu_allan.writers.atomic import write_atomically
    from imu_allan.writers.datasheet import check, overall, to_json, to_junit, verdict_table
    from rich.console import Console

    specification = load_model(args.spec)
    result = _result(args)
    verdicts = check(result, specification)
    if args.json is not None:
        write_atomically(args.json, to_json(verdicts, result, specification).encode())
    if args.junit is not None:
        write_atomically(args.junit, to_junit(verdicts, result, specification).encode())
    console = Console()
    if not console.is_terminal:
        console.width = 130
    console.print(verdict_table(verdicts, specification.name or args.spec))
    outcome = overall(verdicts)
    print(f'{outcome}: {printable(args.source)} against '
          f'{printable(specification.name or args.spec)}')
    for verdict in verdicts:
        if verdict.verdict == 'cannot tell':
            print(f'  {verdict.reason}')
    sys.stdout.flush()
    return EXIT_FAILED if outcome == 'fail' else 0


def _result(args: argparse.Namespace) -> 'Result':
    from imu_allan.writers.result_file import load_result

    path = Path(args.source)
    if path.suffix == '.json':
        return load_result(path)
    import imu_allan
    from imu_allan.cli.progress import progress_bar
    from imu_allan.recordings import open_recording
    from imu_allan.timeline import TimelineOptions

    with open_recording(args.source, rate_hz=args.rate) as recording:
        size = recording.size_bytes
    with progress_bar(printable(args.source), size, wanted=not args.no_progress) as progress:
        return imu_allan.analyze(args.source, args.topic, progress=progress,
                                 options=TimelineOptions(rate_hz=args.rate))
