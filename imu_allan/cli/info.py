# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Say what a recording holds, before it is analyzed."""

import argparse
from collections.abc import Callable
from typing import Any, TYPE_CHECKING

from imu_allan.cli.arguments import positive_number
from imu_allan.cli.progress import progress_bar
from imu_allan.errors import ImuAllanError, printable

if TYPE_CHECKING:
    from imu_allan.recordings import Recording
    from imu_allan.timeline import TimelineSummary

_LISTED = 5


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'info', help='say what a recording holds',
        description='Imu topics of a recording with count, duration, rate, gaps and clock faults. '
                    'Every message is read, none is analyzed.')
    parser.add_argument('recording', metavar='RECORDING')
    parser.add_argument('--rate', metavar='HZ', type=positive_number,
                        help='sample rate of a CSV without a time column')
    parser.add_argument('--no-progress', action='store_true', help='show no progress bar')
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print what the recording holds."""
    from imu_allan.recordings import choose_topic, open_recording

    with open_recording(args.recording, rate_hz=args.rate) as recording:
        if len(recording.topics) < 2:
            choose_topic(recording)
        print(f'{printable(recording.path)}  {_amount(recording.size_bytes)}')
        total = recording.size_bytes * len(recording.topics)
        with progress_bar(printable(recording.path), total,
                          wanted=not args.no_progress) as progress:
            reports = [
                _report(recording, topic.name, args.rate, _after(progress, i, recording))
                for i, topic in enumerate(recording.topics)]
        for report in reports:
            print()
            for line in report:
                print(line)
        if recording.other_topics:
            print()
            print(f'{len(recording.other_topics)} topics of other types:')
            for name, kind in sorted(recording.other_topics.items()):
                print(f'  {printable(name)}  {printable(kind)}')
        for remark in recording.remarks:
            print(f'warning: {printable(remark.message)}')
    return 0


def _after(progress: Callable[[int], None], topics: int,
           recording: 'Recording') -> Callable[[int], None]:
    return lambda done: progress(topics * recording.size_bytes + done)


def _report(recording: 'Recording', topic: str, rate_hz: float | None,
            progress: Callable[[int], None]) -> list[str]:
    from imu_allan.timeline import TimelineOptions, TimelineStage

    stage = TimelineStage(TimelineOptions(rate_hz=rate_hz))
    failure = ''
    count = 0
    try:
        for block in recording.blocks(topic, progress):
            count += len(block)
            if not failure:
                try:
                    stage.push(block)
                except ImuAllanError as error:
                    failure = str(error)
        if not failure:
            stage.flush()
    except ImuAllanError as error:
        failure = str(error)
    lines = [printable(topic)]
    rows = [('messages', f'{count:,}')]
    if failure:
        rows.append(('unusable', failure))
    else:
        rows += _timeline_rows(stage.summary())
    return lines + [f'  {name:<12}{printable(text)}' for name, text in rows]


def _timeline_rows(summary: 'TimelineSummary') -> list[tuple[str, str]]:
    from imu_allan.writers.table import duration

    timeline = summary.timeline
    rows = [('frame_id', summary.frame_id or '(empty)')]
    if summary.start_time is not None:
        rows.append(('start', summary.start_time))
    rows.append(('duration', duration(timeline.duration_s)))
    if timeline.sample_rate_hz is not None:
        jitter = ('' if summary.jitter_s is None
                  else f', jitter {duration(abs(summary.jitter_s))}')
        rows.append(('rate', f'{timeline.sample_rate_hz:.6g} Hz{jitter}'))
    rows.append(('clock', 'none usable, samples are counted' if summary.clock is None
                 else f'{summary.clock} stamps'))
    absent = [name for name, present in zip(_axis_names(), summary.present, strict=True)
              if not present]
    if absent:
        rows.append(('absent', ', '.join(absent)))
    faults = {
        'missing': timeline.missing, 'duplicates': timeline.duplicates,
        'out of order': timeline.out_of_order, 'rejected': timeline.rejected,
        'repeated header stamps': summary.header_repeats,
        'backward header stamps': summary.header_backward,
        'repeated receive stamps': summary.receive_repeats,
        'backward receive stamps': summary.receive_backward,
        'clock jumps': summary.clock_jumps,
    }
    found = [f'{number:,} {what}' for what, number in faults.items() if number]
    rows.append(('faults', ', '.join(found) or 'none'))
    for name, spans in (('gaps', timeline.gaps), ('motion', timeline.motion)):
        if spans:
            total = sum(span.duration_s for span in spans)
            where = ', '.join(f'{duration(span.duration_s)} at {span.start_s:.6g} s'
                              for span in spans[:_LISTED])
            more = f' and {len(spans) - _LISTED} more' if len(spans) > _LISTED else ''
            rows.append((name, f'{len(spans)}, {duration(total)} in all: {where}{more}'))
    rows.extend(('warning', remark.message) for remark in summary.remarks)
    return rows


def _axis_names() -> list[str]:
    from imu_allan.noise.terms import AXES

    return list(AXES)


def _amount(size_bytes: int) -> str:
    size = float(size_bytes)
    for unit in ('bytes', 'kB', 'MB'):
        if size < 1000:
            return f'{size:.3g} {unit}'
        size /= 1000
    return f'{size:.3g} GB'
