# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Compare a result or a recording with a datasheet."""

import argparse
from contextlib import closing
from dataclasses import replace
from typing import Any, TYPE_CHECKING

from imu_allan.cli import arguments
from imu_allan.errors import ImuAllanError, printable
from imu_allan.writers.atomic import CERTIFICATE, JUNIT, VERDICTS
from imu_allan.writers.terminal import console_of, progress_bar, wrapped

if TYPE_CHECKING:
    from imu_allan.analysis import Choice
    from imu_allan.datasheet import Verdict
    from imu_allan.result import Result
    from imu_allan.sensor.noise_model import NoiseModel


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'check', help='compare with a datasheet: pass, fail or cannot tell',
        usage='%(prog)s RESULT_OR_RECORDING --spec FILE [options]',
        short='spec min-duration allow-undecided live json junit certificate meta topic',
        examples=('check out --spec datasheet.yaml',
                  'check out --spec tactical_mems --min-duration 1h --junit a.xml',
                  'check imu_at_rest --spec datasheet.yaml --live --meta serial=A-0017'),
        description='Compare each quantity with the limit of a datasheet. It passes where its '
                    '95 % interval (or upper bound) lies below, fails where it lies above, and '
                    'is undecided where it reaches across. A constant, missing or dead axis '
                    'fails. Exit status 3 if any fails, else 4 if any is undecided.')
    parser.add_argument('source', metavar='RESULT_OR_RECORDING',
                        help='result file (.json), or anything that analyze takes')
    parser.add_argument('--spec', metavar='FILE', required=True,
                        help='datasheet: a YAML file with units, or one that is shipped '
                             '(consumer_mems, tactical_mems)')
    undecided = parser.add_mutually_exclusive_group()
    undecided.add_argument('--allow-undecided', action='store_true',
                           help='exit status 0, not 4, where something is undecided')
    # This is the default now, and was an option before.
    undecided.add_argument('--strict', action='store_true', help=argparse.SUPPRESS)
    parser.add_argument('--min-duration', metavar='TIME', type=arguments.duration, default=0.0,
                        help='from a shorter record nothing passes (30min, 3h)')
    parser.add_argument('--live', action='store_true',
                        help='stop as soon as the verdict is certain: wrong in at most one unit '
                             'of twenty. Within 10 %% of a limit nothing is decided')
    parser.add_argument('--json', metavar='FILE', help='write the verdicts as JSON; - prints it')
    parser.add_argument('--junit', metavar='FILE', help='write the verdicts as JUnit XML')
    parser.add_argument('--certificate', metavar='FILE',
                        help='write the verdicts as an A4 sheet (HTML)')
    arguments.add_inspection(parser)
    parser.add_argument('--topic', metavar='NAME', help='the Imu topic of a recording')
    arguments.add_recording_options(parser)
    arguments.add_timeline_options(parser)
    parser.set_defaults(run=run, inputs=('source', 'spec'), outputs={
        'json': VERDICTS, 'junit': JUNIT, 'certificate': CERTIFICATE})


def run(args: argparse.Namespace) -> int:
    """Print the verdicts, write the requested files, and return the exit status."""
    from imu_allan.datasheet import check, overall
    from imu_allan.finding_messages import for_display, in_full
    from imu_allan.recordings import recordings_in
    from imu_allan.result import Inspection
    from imu_allan.sensor.noise_model import find_model, load_model
    from imu_allan.writers import datasheet
    from imu_allan.writers.atomic import write_atomically
    from imu_allan.writers.result_files import is_result

    if is_result(args.source):
        arguments.refuse_reading_options(args, 'a recording, not a result')
    specification, choice = load_model(find_model(args.spec)), arguments.choice_of(args)
    source, *others = map(str, recordings_in(args.source, choice.reading))
    if others:
        raise ImuAllanError(f'{args.source}: holds {1 + len(others)} recordings; check each by '
                            'itself')
    if args.live:
        result, verdicts = _live(source, args, choice, specification)
    else:
        result = _result_of(source, args, choice)
        verdicts = check(result, specification, shortest_s=args.min_duration)
    if said := dict(args.meta):
        # Entries that are not given stay as they were.
        result = replace(result, inspection=replace(result.inspection or Inspection(), **said))
    for path, writer in ((args.json, datasheet.to_json), (args.junit, datasheet.to_junit),
                         (args.certificate, datasheet.certificate_html)):
        if path is not None:
            write_atomically(path, writer(verdicts, result, specification).encode())
    console = console_of()
    console.print(datasheet.verdict_table(verdicts, specification.name or args.spec))
    # A wrong unit or lost samples may be what fails or passes.
    act = [found for found in for_display(result.warnings) if found.severity == 'act']
    outcome = overall(verdicts)
    console.print(*wrapped([text for _, text in in_full(act, together=True)], console.width),
                  f'{outcome}: {printable(source)} against '
                  f'{printable(specification.name or args.spec)}',
                  *wrapped([f'  ({number}) {sentence}' for number, sentence in enumerate(
                      datasheet.reasons(verdicts)[0], 1)], console.width, indent=6), sep='\n')
    # In addition to 0, 1 and 2 of every verb, so that scripts can distinguish a bad sensor from a
    # bad command; a longer recording may turn 4 into 0 or 3.
    if outcome == 'fail':
        return 3
    return 4 if outcome == 'cannot tell' and not args.allow_undecided else 0


def _result_of(source: str, args: argparse.Namespace, choice: 'Choice') -> 'Result':
    """Return the result in a file, or that of a recording."""
    from imu_allan.analysis import analyzed
    from imu_allan.writers.result_files import is_result, load_result

    if is_result(source):
        return load_result(source)
    with choice.opened(source) as recording, progress_bar(
            source, recording.size_bytes, wanted=not args.no_progress) as bar:
        return analyzed(source, choice, bar, recording)


def _live(source: str, args: argparse.Namespace, choice: 'Choice', specification: 'NoiseModel'
          ) -> 'tuple[Result, list[Verdict]]':
    """Read a recording until the verdict is certain, and print after how long it was."""
    from imu_allan.analysis import growing, no_sample_error
    from imu_allan.characterization.join_results import fitted
    from imu_allan.datasheet import check_state, next_look
    from imu_allan.wording import duration as said

    with choice.opened(source) as recording, progress_bar(
            source, recording.size_bytes, wanted=not args.no_progress) as bar, closing(
            growing(recording, choice, next_look, bar)) as looks:
        for taken in looks:
            result, records = fitted((one.characterization, one.remarks()) for one in taken)
            found = check_state(result, records, specification, shortest_s=args.min_duration)
            if found.decided:
                break
    for one, record in zip(taken, records, strict=True):
        # Axes that a recording without samples lacks are not missing from the sensor.
        if record is None:
            raise no_sample_error(one, choice)
    # A verdict that may be given at any time needs more evidence than one of the whole recording.
    print(f'certain after {said(found.recorded_s)}' if found.decided else
          f'not certain after {said(found.recorded_s)}; check without --live compares all of it')
    return result, list(found.verdicts)
