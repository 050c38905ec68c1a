# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A recording in, a result out, in one module because every way of reading one begins alike.

Several recordings of one IMU give one result.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Generator, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, suppress
from dataclasses import fields, replace
from heapq import merge
from itertools import count as naturals
from operator import itemgetter
from os import PathLike
from pathlib import Path
from typing import Literal, TYPE_CHECKING

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding, finding
from imu_allan.recordings import open_recording, read_blocks, Recording, RecordingOptions
from imu_allan.recordings.halves import choose_streams, Stream
from imu_allan.recordings.same_recording import files_digest, Fingerprint
from imu_allan.recordings.thermometers import temperatures
from imu_allan.recordings.time_window import between
from imu_allan.result import Result
from imu_allan.sensor.acceleration_unit import AccelerationUnit
from imu_allan.timeline import NoAxes, TimelineOptions, TimelineStage
from imu_allan.tuning.means import Means
from imu_allan.wording import duration

if TYPE_CHECKING:
    from imu_allan.characterization import Characterization
    from imu_allan.noise.axis_fit import AxisFit

_WHOLE_PART = 0.99
"""Of the length asked for: who asks for 20 min of 19 min 59 s has the whole."""

Taken = tuple['Stream', 'Characterization', list[Finding]]
Opening = Callable[[], AbstractContextManager[Recording]]


def analyze(path: str | Path | Sequence[str | Path], topic: str | None = None, *,
            options: TimelineOptions = TimelineOptions(),  # noqa: B008
            reading: RecordingOptions = RecordingOptions(),  # noqa: B008
            start_s: float | Literal['auto'] = 0.0, duration_s: float | None = None,
            progress: Callable[[int], None] | None = None,
            opening: Opening | None = None) -> Result:
    """
    Characterize the IMU of a recording, or one IMU from several recordings.

    Parameters
    ----------
    path : str or Path, or a sequence of them
        A rosbag2 directory, a bare ``.mcap`` or ``.db3`` file, a ROS 1 ``.bag`` or a CSV file. Of
        several the result is the joint one: one set of coefficients for all, and the spread of the
        means from one to the next.
    topic : str, optional
        May be left out where the recording has one IMU, on one topic or in two halves.
    options : TimelineOptions, optional
        Clock, rate, gaps and motion.
    reading : RecordingOptions, optional
        Definitions, fields, units and topics of messages that do not speak for themselves.
    start_s : float or 'auto', optional
        Seconds after the first message at which to begin; 'auto' leaves out a warm-up, for which
        the recording is read twice where there is one.
    duration_s : float, optional
        Seconds to use from there; all when left out.
    progress : callable, optional
        Called with the bytes read so far, of all recordings together.
    opening : callable, optional
        Lends the recording, where it is open for several of its topics (`Recording.again`).

    Returns
    -------
    Result

    Raises
    ------
    ImuAllanError
        If a recording cannot be read, the topic is not clear, nothing usable is in it, or several
        are not of one IMU in one setting.

    """
    given = [path] if isinstance(path, (str, PathLike)) else path
    if not isinstance(given, Sequence) or not all(
            isinstance(each, (str, PathLike)) for each in given):
        raise TypeError(f'analyze takes the path of a recording, not {type(path).__name__}; for '
                        'samples in an array: imu_allan.characterize(samples, sample_rate_hz)')
    # What is written to it meanwhile is another recording.
    files = files_digest(path) if isinstance(path, (str, Path)) else None
    if start_s == 'auto':
        if not isinstance(path, (str, Path)):
            raise ImuAllanError('--start auto finds the warm-up of one recording; for several '
                                'give the time to leave out, such as --start 10min')
        result = _warmed_up(path, topic, options, reading, duration_s, progress, opening)
    elif not isinstance(path, (str, Path)):
        result = _together(path, topic, options, reading, start_s, duration_s, progress)
    else:
        result = _alone(path, topic, options, reading, start_s, duration_s, progress, opening)
    chosen = said(topic, options, reading, start_s, duration_s)
    from imu_allan.writers.words import with_words
    return with_words(replace(result, source=replace(
        result.source, options=chosen,
        files=files)))


def _alone(path: str | Path, topic: str | None, options: TimelineOptions,
           reading: RecordingOptions, start_s: float, duration_s: float | None,
           progress: Callable[[int], None] | None, opening: Opening | None
           ) -> Result:
    """One result for one recording."""
    taken, _ = _taken(path, topic, options, reading, start_s, duration_s, progress,
                      opening=opening)
    results = []
    for _, characterization, remarks in taken:
        result = characterization.result(remarks)
        if not result.axes:
            advice = (' in the chosen part; --start and --duration choose another'
                      if start_s or duration_s else '; see what it holds with imu_allan info')
            raise ImuAllanError(f'{characterization.place}: no usable sample{advice}')
        results.append(result)
    return _as_one([stream for stream, *_ in taken], results)


def fitted_of(taken: Sequence[Taken]) -> tuple[Result, dict[str, AxisFit | None]]:
    """
    Return the result of what was taken so far of a recording, of one stream or two halves.

    With it the fit of every axis that it was made of.
    """
    results: list[Result] = []
    fits: dict[str, AxisFit | None] = {}
    for stream, characterization, remarks in taken:
        result, own = characterization.fitted(remarks)
        results.append(result)
        fits |= {name: fit for name, fit in own.items() if name.startswith(stream.half or '')}
    from imu_allan.writers.words import with_words
    return with_words(_as_one([stream for stream, *_ in taken], results)), fits


def said(topic: str | None = None, options: TimelineOptions = TimelineOptions(),  # noqa: B008
         reading: RecordingOptions = RecordingOptions(),  # noqa: B008
         start_s: float | Literal['auto'] = 0.0, duration_s: float | None = None
         ) -> dict[str, str]:
    """
    Return what is chosen otherwise than by default, by the names that `analyze` gives it.

    Examples
    --------
    >>> said('/imu', TimelineOptions(motion='keep'), duration_s=60.0)
    {'topic': '/imu', 'motion': 'keep', 'duration_s': '60.0'}

    """
    chosen: dict[str, object] = {'topic': topic}
    for group, default in ((options, TimelineOptions()), (reading, RecordingOptions())):
        chosen |= {part.name: value for part in fields(group)
                   if (value := getattr(group, part.name)) != getattr(default, part.name)}
    chosen |= {'start_s': start_s or None, 'duration_s': duration_s}
    return {name: str(value) for name, value in chosen.items() if value is not None}


def _warmed_up(path: str | Path, topic: str | None, options: TimelineOptions,
               reading: RecordingOptions, duration_s: float | None,
               progress: Callable[[int], None] | None,
               opening: Opening | None) -> Result:
    """Analyze, and where the mean of an axis settles, again without the time that takes."""
    cold = analyze(path, topic, options=options, reading=reading, duration_s=duration_s,
                   progress=progress, opening=opening)
    from imu_allan.characterization.findings import (
        start_of,
        start_remark,
        steady_of,
    )
    length = cold.timeline.duration_s
    steady = [steady_of(axis) for axis in cold.axes.values()]
    # What takes longer than half of the recording cannot be left out, the rest can.
    longest_s = max(steady)
    start_s = start_of(steady, length)
    if start_s <= 0:
        return replace(cold, warnings=(start_remark(longest_s, length), *cold.warnings))
    left = None if duration_s is None else max(duration_s - start_s, 0.0)
    warm = analyze(path, topic, options=options, reading=reading, start_s=start_s,
                   duration_s=left, opening=opening)
    return replace(warm, warnings=(start_remark(start_s, length, longest_s), *warm.warnings))


def _together(paths: Sequence[str | Path], topic: str | None, options: TimelineOptions,
              reading: RecordingOptions, start_s: float, duration_s: float | None,
              progress: Callable[[int], None] | None) -> Result:
    """One result for several recordings, of each half of the IMU where it has two."""
    from imu_allan.characterization.joint import joint_result

    for number, path in enumerate(paths):
        for other in paths[:number]:
            if Path(path).resolve() == Path(other).resolve():
                raise given_twice(other, path)
    recordings: list[list[Taken]] = []
    fingerprints: list[Fingerprint] = []
    before = 0
    for path in paths:
        fingerprint = Fingerprint()
        taken, size = _taken(path, topic, options, reading, start_s, duration_s,
                             _counted_on(progress, before), fingerprint)
        for other, known in zip(paths, fingerprints, strict=False):
            if fingerprint.shares_messages_with(known):
                raise given_twice(other, path)
        fingerprints.append(fingerprint)
        if recordings and len(taken) != len(recordings[0]):
            raise ImuAllanError(f'{path}: {len(taken)} topics of one IMU, but '
                                f'{len(recordings[0])} in {paths[0]}; choose one with --topic')
        recordings.append(taken)
        before += size
    if not recordings:
        raise ImuAllanError('a joint result needs at least two recordings')
    results = [joint_result([characterization for _, characterization, _ in half],
                            [remarks for *_, remarks in half])
               for half in zip(*recordings, strict=True)]
    return _as_one([stream for stream, *_ in recordings[0]], results)


def given_twice(one: str | Path, other: str | Path) -> ImuAllanError:
    """Return the complaint about two recordings that hold the same messages."""
    return ImuAllanError(f'{one} and {other} hold the same messages, which would count twice; '
                         'give each recording of the IMU once')


def _counted_on(progress: Callable[[int], None] | None, before: int
                ) -> Callable[[int], None] | None:
    return None if progress is None else lambda done: progress(before + done)


def _taken(path: str | Path, topic: str | None, options: TimelineOptions,
           reading: RecordingOptions, start_s: float, duration_s: float | None,
           progress: Callable[[int], None] | None, fingerprint: Fingerprint | None = None,
           opening: Opening | None = None) -> tuple[list[Taken], int]:
    """Take in the streams of a recording; return them with what was found, and its size."""
    with (open_recording(path, rate_hz=options.rate_hz, options=reading) if opening is None
          else opening()) as recording:
        streams = choose_streams(recording, topic)
        taken = []
        for number, stream in enumerate(streams):
            part = _shared(progress, number, len(streams), recording.size_bytes)
            taken.append((stream, *_characterized(
                recording, stream, _at_own_rate(stream, streams, options, reading), start_s,
                duration_s, part, fingerprint if number == 0 else None)))
        return taken, recording.size_bytes


def _at_own_rate(stream: Stream, streams: Sequence[Stream], options: TimelineOptions,
                 reading: RecordingOptions) -> TimelineOptions:
    """State a rate of the half that it is said of alone; that of the other is measured."""
    if stream.only_new:
        # What is said is the rate of the messages, which repeat this half.
        return replace(options, rate_hz=None)
    if stream.half == 'accel' and len({each.topic for each in streams}) > 1:
        return replace(options, rate_hz=reading.accel_rate_hz)
    return options


def growing(path: str | Path, topic: str | None, next_look: Callable[[int], int], *,
            options: TimelineOptions = TimelineOptions(),  # noqa: B008
            reading: RecordingOptions = RecordingOptions(),  # noqa: B008
            start_s: float = 0.0, duration_s: float | None = None,
            progress: Callable[[int], None] | None = None
            ) -> Generator[list[Taken], None, None]:
    """
    Read a recording as if it came live.

    Parameters
    ----------
    path, topic, options, reading, start_s, duration_s, progress
        As in `analyze`.
    next_look : callable
        Number of messages at which to look next, given that at which one has looked; where the
        gyroscope has a topic of its own, of its messages.

    Yields
    ------
    list of (Stream, Characterization, list of Finding)
        With all that came so far, one for each half of the IMU where it comes in halves; once more
        when the recording has ended.

    Raises
    ------
    ImuAllanError
        If it cannot be read, or does not hold one IMU.

    """
    with open_recording(path, rate_hz=options.rate_hz, options=reading) as recording:
        streams = choose_streams(recording, topic)
        begun = [_begun(recording, stream, _at_own_rate(stream, streams, options, reading),
                        start_s, duration_s,
                        _shared(progress, number, len(streams), recording.size_bytes))
                 for number, stream in enumerate(streams)]

        def so_far() -> list[Taken]:
            return [(stream, characterization, remarks()) for stream, (
                characterization, _, remarks) in zip(streams, begun, strict=True)]

        taken, look, has_temperature = 0, next_look(0), False
        for number, block in _side_by_side([blocks for _, blocks, _ in begun]):
            characterization, start = begun[number][0], 0
            while start < len(block):
                stop = min(len(block), start + look - taken) if number == 0 else len(block)
                characterization.take([block.part(slice(start, stop))])
                taken, start = taken + (stop - start if number == 0 else 0), stop
                if taken == look:
                    if not has_temperature:
                        # All of it, once the clock is known; what is ahead waits for its samples.
                        for stream, (half, *_) in zip(streams, begun, strict=True):
                            _take_temperature(recording, stream, half)
                        has_temperature = True
                    yield so_far()
                    look = next_look(taken)
        for characterization, *_ in begun:
            characterization.finish()
        yield so_far()


def _side_by_side(streams: Sequence[Iterable[ImuBlock]]) -> Iterator[tuple[int, ImuBlock]]:
    """Give the blocks of all streams in the order they were received, with the stream's number."""
    def numbered(number: int, blocks: Iterable[ImuBlock]) -> Iterator[tuple[int, int, ImuBlock]]:
        for block in blocks:
            if len(block):
                yield int(block.receive_ns[0]), number, block

    for _, number, block in merge(*map(numbered, naturals(), streams), key=itemgetter(0)):
        yield number, block


def second_means(path: str | Path, topic: str | None = None, *,
                 options: TimelineOptions = TimelineOptions(),  # noqa: B008
                 reading: RecordingOptions = RecordingOptions(),  # noqa: B008
                 progress: Callable[[int], None] | None = None,
                 axes: Collection[str] | None = None) -> list[Means]:
    """
    Read a recording for its means over a second, at rest, in constant memory.

    Parameters
    ----------
    path, topic, options, reading, progress
        As in `analyze`.
    axes : collection of str, optional
        Keys of `AXES` to take; those of the first sample by default.

    Returns
    -------
    list of Means
        One, or one for each half of an IMU that comes in two.

    Raises
    ------
    ImuAllanError
        If it cannot be read, or the topic is not clear.

    """
    found = []
    with open_recording(path, rate_hz=options.rate_hz, options=reading) as recording:
        streams = choose_streams(recording, topic)
        for number, stream in enumerate(streams):
            part = _shared(progress, number, len(streams), recording.size_bytes)
            blocks, _ = _in_si_units(recording, stream, part)
            stage = TimelineStage(_at_own_rate(stream, streams, options, reading))
            found.append(Means(axes if axes is None or stream.half is None else
                               [name for name in axes if name.startswith(stream.half)]))
            for block in blocks:
                with suppress(NoAxes):
                    found[-1].take(stage.push(block), stage.interval_ns)
            found[-1].take(stage.flush(), stage.interval_ns)
    return found


def _characterized(recording: Recording, stream: Stream, options: TimelineOptions,
                   start_s: float, duration_s: float | None,
                   progress: Callable[[int], None] | None, fingerprint: Fingerprint | None
                   ) -> tuple[Characterization, list[Finding]]:
    characterization, blocks, remarks = _begun(recording, stream, options, start_s, duration_s,
                                               progress)
    characterization.take(blocks if fingerprint is None else fingerprint.watch(blocks))
    _take_temperature(recording, stream, characterization)
    return characterization, remarks()


def _take_temperature(recording: Recording, stream: Stream, characterization: Characterization
                      ) -> None:
    """Read the thermometer beside the samples, by the clock that these turned out to have."""
    for stamps, celsius in temperatures(recording, stream.topic,
                                        characterization.summary().clock):
        characterization.take_temperature(stamps, celsius)


def _begun(recording: Recording, stream: Stream, options: TimelineOptions, start_s: float,
           duration_s: float | None, progress: Callable[[int], None] | None
           ) -> tuple[Characterization, Iterable[ImuBlock], Callable[[], list[Finding]]]:
    """Begin to read; the remarks are complete when the blocks are through."""
    blocks, unit = _in_si_units(recording, stream, progress)
    # Reading has begun in a process of its own: numerics are imported meanwhile.
    from imu_allan.characterization import Characterization

    shortfall: list[Finding] = []

    def ended(recorded_s: float, part_s: float) -> None:
        if part_s < 0:
            raise ImuAllanError(f'{recording.path}: lasts {duration(recorded_s)}: --start '
                                f'{duration(start_s)} leaves nothing of it')
        if duration_s is not None and part_s < _WHOLE_PART * duration_s:
            shortfall.append(finding('short_part', recorded_s=part_s, asked_s=duration_s))

    if start_s > 0 or duration_s is not None:
        blocks = between(blocks, start_s, duration_s, ended)
    characterization = Characterization(
        kind='recording', path=str(recording.path), topic=stream.topic, options=options)
    return characterization, blocks, lambda: [*recording.remarks, *unit.remarks, *shortfall]


def _in_si_units(recording: Recording, stream: Stream, progress: Callable[[int], None] | None
                 ) -> tuple[Iterable[ImuBlock], AccelerationUnit]:
    """Begin to read; what turns g into m/s^2 tells when it did."""
    blocks: Iterable[ImuBlock] = stream.taken(read_blocks(recording, stream.topic, progress))
    unit = AccelerationUnit()
    if recording.options.accel_unit is None and recording.options.accel is None:
        blocks = unit.each(blocks)
    return blocks, unit


def _shared(progress: Callable[[int], None] | None, number: int, parts: int, size: int
            ) -> Callable[[int], None] | None:
    """Let one of several readings of a recording tell its share."""
    if progress is None or parts == 1:
        return progress
    return lambda done: progress((number * size + done) // parts)


def _as_one(streams: Sequence[Stream], results: Sequence[Result]) -> Result:
    """Return the result of the IMU, of one stream or of gyroscope and accelerometer."""
    if len(results) == 1:
        return results[0]
    from imu_allan.characterization.halves import HalfResult, united
    return united([HalfResult(stream.half, stream.topic, result)
                   for stream, result in zip(streams, results, strict=True)
                   if stream.half is not None])
