# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Show the numbers that a filter needs, and what it would achieve with others."""

import argparse
from collections.abc import Mapping
import json
import sys
from typing import Any, TYPE_CHECKING

from imu_allan.cli import arguments
from imu_allan.errors import ImuAllanError, printable
from imu_allan.writers.atomic import TUNING
from imu_allan.writers.terminal import console_of, progress_bar, wrapped

if TYPE_CHECKING:
    from imu_allan.result import AxisResult, Result
    from imu_allan.tuning.backtest import FieldTest


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'tune', help='what a filter needs, and how far it can trust that',
        usage='%(prog)s RESULT [options]',
        short='aiding coast bias verify json',
        examples=('tune out',
                  'tune out --aiding 50ms --coast 2m',
                  'tune out --verify another_day.mcap'),
        description='Choose the numbers for a filter by how often something corrects it and how '
                    'long it is unaided. Beside them: what conservative numbers, the '
                    'measured coefficients and ten times K reach, and the unaided drift.')
    parser.add_argument('result', metavar='RESULT',
                        help='result file of analyze --json RESULT, or the folder of --output')
    parser.add_argument('--aiding', metavar='TIME', type=arguments.duration, default=0.1,
                        help='time between two corrections of the filter (default: 0.1s)')
    parser.add_argument('--coast', metavar='TIME', type=arguments.duration, default=60.0,
                        help='the longest unaided time (default: 60s)')
    parser.add_argument('--bias', choices=('random_walk', 'gauss_markov'), default='random_walk',
                        help='what the filter takes its bias for (default: random_walk)')
    parser.add_argument('--verify', metavar='OTHER',
                        help='run filters with the numbers over another recording, of another '
                             'day or with the motors on')
    parser.add_argument('--topic', metavar='NAME', help='the Imu topic of the other recording')
    arguments.add_recording_options(parser)
    parser.add_argument('--json', metavar='FILE', help='write the numbers as JSON; - prints it')
    parser.set_defaults(run=run, inputs=('result', 'verify'), outputs={'json': TUNING})


def run(args: argparse.Namespace) -> int:
    """Print the tables, and write the requested files."""
    from imu_allan.recordings.repeated_messages import files_digest
    from imu_allan.writers import tuning_table
    from imu_allan.writers.atomic import write_atomically
    from imu_allan.writers.key_figures import verdict_lines
    from imu_allan.writers.result_files import load_result

    if args.verify is None:
        arguments.refuse_reading_options(args, 'the recording that --verify names')
    result = load_result(args.result)
    axes = tuning_table.known_axes(result)
    # A recording that cannot be read is reported before anything is printed.
    other, tested = (None, {}) if args.verify is None else _tested(args, axes)
    console = console_of()
    console.print(tuning_table.tuning_table(result, args.aiding, args.coast, args.bias), '',
                  tuning_table.forecast_table(result),
                  *wrapped(tuning_table.sentences(result, args.coast), console.width), sep='\n')
    if other is not None:
        # Units, dead axes or too little rest of the other recording explain what follows.
        said = [f'{printable(args.verify)} by itself. {line}' for line in verdict_lines(other)]
        if files_digest(args.verify) == result.source.files is not None:
            said.append('The numbers are from this very recording, which cannot show whether they '
                        'hold in another.')
        console.print('', *wrapped(said, console.width), '', tuning_table.field_test_table(
            tested, printable(args.verify), args.bias), sep='\n')
    sys.stdout.flush()
    if args.json is not None:
        document = tuning_table.tuning_document(result, args.aiding, args.coast, args.bias)
        if other is not None:
            document['verification'] = {
                'other': printable(args.verify), 'warnings': other.to_dict()['warnings'],
                'axes': tuning_table.field_test_document(tested, args.bias)}
        write_atomically(args.json, (json.dumps(document, indent=2, allow_nan=False)
                                     + '\n').encode())
    return 0


def _tested(args: argparse.Namespace, axes: 'Mapping[str, AxisResult]'
            ) -> 'tuple[Result, dict[str, FieldTest]]':
    """Return the result of the other recording, and how filters with the numbers do in it."""
    from imu_allan.analysis import Choice, with_records
    from imu_allan.noise.terms import AXES
    from imu_allan.timeline import TimelineOptions
    from imu_allan.tuning.backtest import field_test
    from imu_allan.writers.result_files import is_result

    if is_result(args.verify):
        raise ImuAllanError(f'--verify {args.verify}: is a result, without samples to run filters '
                            'over; name the recording itself')
    choice = Choice(args.topic, TimelineOptions(rate_hz=args.rate),
                    arguments.recording_options(args))
    with choice.opened(args.verify) as recording, progress_bar(
            args.verify, recording.size_bytes, wanted=not args.no_progress) as progress:
        result, records = with_records(recording, choice, progress)
    tested: dict[str, FieldTest] = {}
    for record in records:
        for group in record.groups:
            tested |= field_test(axes, group.names, group.estimator.periodogram,
                                 1 / record.rate_hz, args.aiding, args.coast, args.bias)
    if not tested:
        raise ImuAllanError(f'{args.verify}: no axis of the result has noise there, at rest for '
                            '20 s in a row: nothing to run a filter over')
    return result, {name: tested[name] for name in AXES if name in tested}
