# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Show what a recording contains, before it is analyzed."""

import argparse
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any, TYPE_CHECKING

from imu_allan.cli.analyze import raise_last
from imu_allan.cli.arguments import add_recording_options, recording_options
from imu_allan.errors import brief, ImuAllanError, printable
from imu_allan.writers.terminal import console_of, print_wrapped, progress_bar, wrapped

if TYPE_CHECKING:
    from imu_allan.recordings import Recording
    from imu_allan.timeline import TimelineSummary

_INDENT = 14
"""Width of the column of names."""


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'info', help='say what a recording holds', usage='%(prog)s RECORDING [options]',
        short='rate columns',
        examples=('info imu_at_rest',
                  'info log.csv --rate 200Hz'),
        description='Imu topics of a recording with count, duration, rate, gaps and clock faults. '
                    'Every message is read, none is analyzed.')
    parser.add_argument('recording', metavar='RECORDING')
    add_recording_options(parser)
    parser.set_defaults(run=run, inputs=('recording',))


def run(args: argparse.Namespace) -> int:
    """Print the contents of the recording, or of each recording in a folder."""
    from imu_allan.recordings import recordings_in

    complaints: list[ImuAllanError] = []
    for number, path in enumerate(recordings_in(args.recording, recording_options(args))):
        if number:
            print()
        try:
            _print_recording(path, args)
        except ImuAllanError as error:
            complaints.append(error)
    raise_last(complaints)
    return 0


def _print_recording(path: Path, args: argparse.Namespace) -> None:
    from imu_allan.analysis import offset_progress
    from imu_allan.finding_messages import message_of
    from imu_allan.recordings import choose_topic, open_recording
    from rich.filesize import decimal

    with open_recording(path, options=recording_options(args)) as recording:
        if len(recording.topics) < 2:
            choose_topic(recording)
        size = path.stat().st_size if path.is_file() else recording.size_bytes
        print(f'{printable(recording.path)}  {decimal(size)}')
        total = recording.size_bytes * len(recording.topics)
        with progress_bar(recording.path, total, wanted=not args.no_progress) as progress:
            paragraphs = [
                _report(recording, topic.name, args.rate,
                        offset_progress(progress, i * recording.size_bytes))
                for i, topic in enumerate(recording.topics)]
        paragraphs += [
            _choice(recording) if len(recording.topics) > 1 else [],
            _list('topic of another type', 'topics of other types',
                  sorted(recording.other_topics.items())),
            _list('of them might hold an IMU and is not read',
                  'of them might hold an IMU and are not read', sorted(recording.reasons.items()))]
        console = console_of()
        for lines in filter(None, paragraphs):
            console.print('', *wrapped(lines, console.width, indent=_INDENT), sep='\n')
        for remark in recording.remarks:
            print_wrapped(f'warning: {message_of(remark)}')


def _choice(recording: 'Recording') -> list[str]:
    """Describe which of several topics are read if none is named."""
    from imu_allan.recordings.choose_streams import choose_streams

    try:
        topics = [printable(stream.topic) for stream in choose_streams(recording)]
    except ImuAllanError:
        return ['not one IMU: choose a topic with --topic, all with --all-topics, or halves with '
                '--gyro-topic and --accel-topic']
    if len(topics) == 1:
        return [f'read where no topic is named: {topics[0]}']
    return [f'one IMU in two halves: the gyroscope from {topics[0]}, the accelerometer from '
            f'{topics[1]}']


def _list(one: str, many: str, topics: list[tuple[str, str]]) -> list[str]:
    """Return topics with a word about each, if there are any."""
    from imu_allan.wording import counted

    if not topics:
        return []
    return [f'{counted(len(topics), one, many)}:',
            *(f'  {brief(name)}  {brief(word)}' for name, word in topics)]


def _report(recording: 'Recording', topic: str, rate_hz: float | None,
            progress: Callable[[int], None] | None) -> list[str]:
    from imu_allan.analysis import in_si_units
    from imu_allan.finding_messages import message_of
    from imu_allan.noise.terms import AXES
    from imu_allan.recordings.choose_streams import Stream
    from imu_allan.recordings.thermometers import thermometer_of
    from imu_allan.timeline import NoAxes, TimelineOptions, TimelineStage
    from imu_allan.wording import named, NO_TOPIC
    import numpy as np

    stage = TimelineStage(TimelineOptions(rate_hz=rate_hz))
    blocks, noted = in_si_units(recording, Stream(topic), progress)
    failure, count, first = '', 0, None
    changed = np.zeros(len(AXES), bool)
    try:
        for block in filter(len, blocks):
            count += len(block)
            if not changed.all():
                first = block.samples[0] if first is None else first
                changed |= (block.samples != first).any(axis=0)
            if not failure:
                try:
                    stage.push(block)
                except NoAxes:
                    # Later blocks may have values; if none has, that is known at the end.
                    continue
                except ImuAllanError as error:
                    failure = str(error)
        if not failure:
            stage.flush()
    except ImuAllanError as error:
        failure = str(error)
    messages = recording.imu(topic).messages
    rows = [('read as', messages.reported())] if messages.fields.what else []
    rows.append(('messages', f'{count:,}'))
    if failure:
        rows.append(('unusable', failure))
    else:
        summary = stage.summary()
        # A column that the table lacks is reported as such, not as one without numbers.
        known = {(remark.code, remark.axes) for remark in recording.remarks}
        rows += _timeline_rows(replace(summary, remarks=tuple(
            remark for remark in summary.remarks if (remark.code, remark.axes) not in known)),
            topic, untimed=recording.untimed)
        constant = [name for name, there, changes in zip(
            AXES, summary.present, changed, strict=True) if there and not changes]
        if count > 1 and constant:
            rows.append(('constant', f'{named(constant)}: every sample is the same'))
    if (heat := thermometer_of(recording, topic)) is not None:
        rows.append(('temperature', f'from {heat.name}'))
    rows.extend(('warning', message_of(remark)) for remark in noted())
    return ['table' if topic == NO_TOPIC else brief(topic),
            *(f'  {name:<{_INDENT - 2}}{printable(text)}' for name, text in rows)]


def _timeline_rows(summary: 'TimelineSummary', topic: str, *, untimed: bool
                   ) -> list[tuple[str, str]]:
    from imu_allan.finding_messages import message_of
    from imu_allan.noise.terms import AXES
    from imu_allan.wording import clock_of, counted, duration, is_table, named

    timeline, table = summary.timeline, is_table(topic)
    counts, stamp = summary.counts, 'time' if table else 'header stamp'
    rows = [] if table else [('frame_id', summary.frame_id or '(empty)')]
    if summary.start_time is not None:
        rows.append(('start', summary.start_time))
    rows.append(('duration', duration(timeline.duration_s)))
    if timeline.sample_rate_hz is not None:
        # Decimal seconds in a table are rounded to about this.
        jitter = ('' if summary.jitter_s is None or untimed else
                  f', jitter {duration(abs(summary.jitter_s))}'
                  if abs(summary.jitter_s) >= 1e-6 else ', jitter below 1 us')
        rows.append(('rate', f'{timeline.sample_rate_hz:.6g} Hz{jitter}'))
    rows.append(('clock', 'none: samples are counted at the stated rate' if untimed
                 else 'none usable, samples are counted' if summary.clock is None
                 else clock_of(summary.clock, topic)))
    absent = [name for name, present in zip(AXES, summary.present, strict=True) if not present]
    if absent:
        rows.append(('absent', named(absent)))
    found = [f'{number:,} {what}' for what, number in (
        ('missing', timeline.missing), ('out of order', timeline.out_of_order),
        ('rejected', timeline.rejected)) if number]
    found += [counted(number, what) for what, number in (
        ('duplicate', timeline.duplicates),
        (f'repeated {stamp}', counts.header.repeats),
        (f'backward {stamp}', counts.header.backward),
        ('repeated receive stamp', 0 if table else counts.receive.repeats),
        ('backward receive stamp', 0 if table else counts.receive.backward),
        ('clock jump', counts.clock_jumps)) if number]
    rows.append(('faults', ', '.join(found) or 'none'))
    listed = 5
    for name, spans, total in zip(('gaps', 'motion'), (timeline.gaps, timeline.motion),
                                  timeline.totals, strict=True):
        if spans:
            where = ', '.join(f'{duration(span.duration_s)} at {duration(span.start_s)}'
                              for span in spans[:listed])
            more = f' and {total.count - listed} more' if total.count > listed else ''
            rows.append((name, f'{total.count}, {duration(total.duration_s)} in all: '
                         f'{where}{more}'))
    # Nothing is excluded here, and motion has a row of its own.
    rows.extend(('warning', message_of(remark)) for remark in summary.remarks
                if remark.code != 'motion')
    return rows
