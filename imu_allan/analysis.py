# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Analysis of recordings: at once, as if they came live, or several of one IMU as one."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from heapq import merge
from itertools import combinations, repeat
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from imu_allan.block import ImuBlock
from imu_allan.errors import error_about, ImuAllanError, positive_time
from imu_allan.finding import Finding
from imu_allan.recordings import open_recording, read_blocks, Recording, RecordingOptions
from imu_allan.recordings.choose_streams import choose_streams, Stream
from imu_allan.recordings.repeated_messages import files_digest, sampled, Seen, share_messages
from imu_allan.recordings.thermometers import temperatures
from imu_allan.recordings.time_window import between
from imu_allan.result import Result
from imu_allan.sensor.acceleration_unit import AccelerationUnit
from imu_allan.timeline import TimelineOptions

if TYPE_CHECKING:
    from imu_allan.characterization import Characterization
    from imu_allan.characterization.axis_groups import FinishedRecord


AnyPath = str | PathLike[str]
Progress = Callable[[int], None] | None


@dataclass(frozen=True)
class Choice:
    """Which part of a recording is used, and how it is read: the arguments of `analyze`."""

    topic: str | None = None
    options: TimelineOptions = TimelineOptions()  # noqa: RUF009
    reading: RecordingOptions = RecordingOptions()  # noqa: RUF009
    start_s: float = 0.0
    duration_s: float | None = None

    def opened(self, path: AnyPath) -> Recording:
        """Open a recording, to be used as a context manager."""
        return open_recording(Path(path), rate_hz=self.options.rate_hz, options=self.reading)


@dataclass(frozen=True)
class Taken:
    """A stream of a recording as it is read, and its characterization so far."""

    recording: Recording
    stream: Stream
    noted: Callable[[], list[Finding]]
    blocks: Iterable[ImuBlock]
    characterization: Characterization
    shortfall: list[Finding]

    def remarks(self) -> list[Finding]:
        """Return the findings about the recording, complete once all blocks have been read."""
        return [*self.recording.remarks, *self.noted(), *self.shortfall]

    def take_temperature(self) -> None:
        """Read the thermometer beside the IMU, by the clock that was chosen for the samples."""
        for stamps, celsius in temperatures(self.recording, self.stream.topic,
                                            self.characterization.summary().clock):
            self.characterization.take_temperature(stamps, celsius)


def analyze(path: AnyPath | Sequence[AnyPath], topic: str | None = None, *,
            options: TimelineOptions = TimelineOptions(),  # noqa: B008
            reading: RecordingOptions = RecordingOptions(),  # noqa: B008
            start_s: float = 0.0, duration_s: float | None = None, progress: Progress = None
            ) -> Result:
    """
    Characterize the IMU of a recording, or one IMU from several recordings.

    Parameters
    ----------
    path : str or Path, or a sequence of them
        A rosbag2 directory, a bare ``.mcap`` or ``.db3`` file, a ROS 1 ``.bag``, a log of PX4 or
        ArduPilot, or CSV. Several recordings give a joint result: one set of coefficients for all,
        and the spread of their means.
    topic : str, optional
        May be omitted if the recording has one IMU, on one topic or in two halves.
    options : TimelineOptions, optional
        Clock, rate, gaps and motion.
    reading : RecordingOptions, optional
        Definitions, fields, units and topics that the messages themselves leave open.
    start_s : float, optional
        Seconds after the first message at which to begin.
    duration_s : float, optional
        Seconds to use from there; all by default.
    progress : callable, optional
        Called with the bytes read so far, of all recordings together.

    Returns
    -------
    Result

    Raises
    ------
    ImuAllanError
        If a recording cannot be read, its topic is ambiguous, it has no usable samples, or several
        are not of one IMU with the same settings.

    """
    given = [path] if isinstance(path, (str, PathLike)) else path
    if not isinstance(given, Sequence) or not all(
            isinstance(each, (str, PathLike)) for each in given):
        raise TypeError(f'analyze takes the path of a recording, not {type(path).__name__}; for '
                        'samples in an array: imu_allan.characterize(samples, sample_rate_hz)')
    if start_s != 0:
        start_s = positive_time('start_s', start_s)
    if duration_s is not None:
        duration_s = positive_time('duration_s', duration_s)
    return analyzed(path, Choice(topic, options, reading, start_s, duration_s), progress)


def analyzed(path: AnyPath | Sequence[AnyPath], choice: Choice, progress: Progress = None,
             recording: Recording | None = None) -> Result:
    """Do the work of `analyze`; `recording` is given if it is open already."""
    files = None
    if isinstance(path, (str, PathLike)):
        # Taken first: if the file is written to meanwhile, it is another recording.
        files = files_digest(Path(path))
        result = _alone(path, choice, progress, recording)
    else:
        result = _together(path, choice, progress)
    from imu_allan.finding_messages import with_words
    # What is advised for --start takes the place of what was given.
    warnings = tuple(one.with_values(start_s=choice.start_s + one.values['start_s'])
                     if one.code == 'warm_up' and one.values['start_s'] else one
                     for one in result.warnings)
    return with_words(replace(result, source=replace(result.source, files=files),
                              warnings=warnings))


def _alone(path: AnyPath, choice: Choice, progress: Progress, recording: Recording | None
           ) -> Result:
    """Return the result of one recording."""
    from imu_allan.characterization.join_results import united

    with choice.opened(path) if recording is None else nullcontext(recording) as opened:
        taken = _taken(opened, choice, progress)
    results = []
    for one in taken:
        result = one.characterization.result(one.remarks())
        if not result.axes:
            raise no_sample_error(one, choice)
        results.append(result)
    return united(results)


def no_sample_error(taken: Taken, choice: Choice) -> ImuAllanError:
    """Return the error about a stream of which nothing can be used."""
    advice = (' in the chosen part; --start and --duration choose another'
              if choice.start_s or choice.duration_s else
              '; see what it holds with imu_allan info')
    return ImuAllanError(f'{taken.characterization.place}: no usable sample{advice}')


def _together(paths: Sequence[AnyPath], choice: Choice, progress: Progress) -> Result:
    """Return the joint result of several recordings, for each half of the IMU if it has two."""
    from imu_allan.characterization.join_results import united
    from imu_allan.characterization.several_recordings import joint_result

    if len(paths) < 2:
        raise ImuAllanError('a joint result needs at least two recordings')
    for other, path in combinations(paths, 2):
        if Path(path).resolve() == Path(other).resolve():
            raise same_messages_error(other, path)
    recordings: list[list[Taken]] = []
    messages: list[dict[int, bytes]] = []
    before = 0
    for path in paths:
        messages.append({})
        with choice.opened(path) as recording:
            taken = _taken(recording, choice, offset_progress(progress, before), messages[-1])
        for other, known in zip(paths, messages[:-1], strict=False):
            if share_messages(messages[-1], known):
                raise same_messages_error(other, path)
        if recordings and len(taken) != len(recordings[0]):
            raise ImuAllanError(f'{path}: the number of topics of one IMU is {len(taken)}, but '
                                f'{len(recordings[0])} in {paths[0]}; choose one with --topic')
        recordings.append(taken)
        before += recording.size_bytes
    results = [joint_result([one.characterization for one in half],
                            [one.remarks() for one in half])
               for half in zip(*recordings, strict=True)]
    return united(results)


def same_messages_error(one: AnyPath, other: AnyPath) -> ImuAllanError:
    """Return the error about two recordings that hold the same messages."""
    return ImuAllanError(f'{one} and {other} hold the same messages, which would count twice; '
                         'give each recording of the IMU once')


def offset_progress(progress: Progress, before: int, parts: int = 1) -> Progress:
    """Return `progress` offset by `before` bytes, and scaled to `parts` passes in all."""
    return None if progress is None else lambda done: progress((before + done) // parts)


def growing(recording: Recording, choice: Choice, next_look: Callable[[int], int],
            progress: Progress) -> Generator[list[Taken], None, None]:
    """
    Read the chosen part of a recording as if it came live.

    `next_look` returns, for the number of messages at one look, that at the next. At each look,
    and at the end of the recording, yield what was taken so far, by halves if the IMU has two.
    If the gyroscope has a topic of its own, its messages are counted.
    """
    halves = list(_begun(recording, choice, progress))
    taken, look, has_temperature = 0, next_look(0), False
    side_by_side = merge(*(zip(repeat(number), filter(len, half.blocks))
                           for number, half in enumerate(halves)),
                         key=lambda found: int(found[1].receive_ns[0]))
    for number, block in side_by_side:
        characterization, start = halves[number].characterization, 0
        while start < len(block):
            stop = min(len(block), start + look - taken) if number == 0 else len(block)
            characterization.take([block.part(slice(start, stop))])
            taken, start = taken + (stop - start if number == 0 else 0), stop
            if taken == look:
                if not has_temperature:
                    # All readings, once the clock is known; later ones wait for their samples.
                    for half in halves:
                        half.take_temperature()
                    has_temperature = True
                yield halves
                look = next_look(taken)
    for half in halves:
        half.characterization.finish()
    yield halves


def with_records(recording: Recording, choice: Choice, progress: Progress
                 ) -> tuple[Result, list[FinishedRecord]]:
    """Return the result of a recording, and its data at rest for each half of an IMU of two."""
    from imu_allan.characterization.join_results import united
    from imu_allan.finding_messages import with_words

    found = [one.characterization.fitted(one.remarks())
             for one in _taken(recording, choice, progress)]
    return (with_words(united([result for result, _ in found])),
            [record for _, record in found if record is not None])


def _taken(recording: Recording, choice: Choice, progress: Progress,
           messages: dict[int, bytes] | None = None) -> list[Taken]:
    """Take in the streams of a recording, one after the other."""
    taken: list[Taken] = []
    for one in _begun(recording, choice, progress):
        one.characterization.take(one.blocks if messages is None or taken else
                                  sampled(one.blocks, messages))
        one.take_temperature()
        taken.append(one)
    return taken


def _begun(recording: Recording, choice: Choice, progress: Progress) -> Iterator[Taken]:
    """Yield each stream, ready to be read, with the options that apply to it."""
    streams = choose_streams(recording, choice.topic)
    two_topics = len({each.topic for each in streams}) > 1
    if choice.reading.accel_rate_hz is not None and not two_topics:
        raise error_about(recording.path, '--accel-rate is for an accelerometer on a topic of its '
                          'own; --rate is for both')
    for number, stream in enumerate(streams):
        options = choice.options
        if stream.polled:
            # The stated rate is that of the messages, which repeat the samples of this half.
            options = replace(options, rate_hz=None, polled=True)
        elif stream.half == 'accel' and two_topics:
            options = replace(options, rate_hz=choice.reading.accel_rate_hz)
        blocks, noted = in_si_units(recording, stream, offset_progress(
            progress, number * recording.size_bytes, len(streams)))
        # Imported here, while another process has already begun to read.
        import imu_allan.characterization as characterization
        shortfall: list[Finding] = []
        if choice.start_s or choice.duration_s is not None:
            blocks = between(blocks, choice.start_s, choice.duration_s, recording.path, shortfall)
        yield Taken(recording, stream, noted, blocks, characterization.Characterization(
            kind='recording', path=str(recording.path), topic=stream.topic, options=options),
            shortfall)


def in_si_units(recording: Recording, stream: Stream, progress: Progress
                ) -> tuple[Iterable[ImuBlock], Callable[[], list[Finding]]]:
    """Return the blocks of a stream, converted from g if needed, and its findings at the end."""
    unit, seen = AccelerationUnit(), Seen()
    blocks = seen.unseen(stream.select(read_blocks(recording, stream.topic, progress)))
    if recording.options.accel_unit is None and recording.options.accel is None:
        blocks = unit.each(blocks)
    return blocks, lambda: [*unit.remarks, *seen.remarks]
