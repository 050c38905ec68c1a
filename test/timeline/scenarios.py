# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
# ruff: noqa: ARG001  # every fault takes the same arguments
"""Recordings with up to three faults, drawn from a seed, and what is silently wrong of them."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from math import sqrt
import sys

from imu_allan.block import ImuBlock
from imu_allan.characterization.stream import Characterization
from imu_allan.errors import ImuAllanError
from imu_allan.result import Result
from imu_allan.timeline import NoAxes, TimelineOptions
from imu_messages import cut
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Ints = NDArray[np.int64]
Generator = np.random.Generator

START_NS = 1_700_000_000_123_456_789
RATES = (5.0, 10.0, 23.8, 40.0, 50.0, 62.5, 83.3, 100.0, 104.0, 119.0, 200.0, 208.0, 250.0, 400.0,
         416.0, 500.0, 800.0, 952.0, 1000.0, 1040.0, 2000.0, 4000.0)
SIGMA = 0.01
"""Standard deviation of one sample on every axis."""


@dataclass
class Truth:
    """What is true of a scenario; a number may be wrong where one of the codes `said` stands."""

    rate_hz: float
    density: float
    said: set[str] = field(default_factory=set)
    missing: int = 0
    faults: list[str] = field(default_factory=list)


@dataclass
class Messages:
    """Messages in the order of reception; `place` is the number of the sample each one holds."""

    place: Ints
    header: Array
    receive: Array
    samples: Array
    absent: NDArray[np.bool_]

    def pick(self, rows: NDArray[np.generic]) -> 'Messages':
        return Messages(self.place[rows], self.header[rows], self.receive[rows],
                        self.samples[rows], self.absent[rows])

    def block(self) -> ImuBlock:
        """Give all of them; stamps are seconds until here."""
        return ImuBlock(START_NS + np.rint(self.header * 1e9).astype(np.int64),
                        START_NS + np.rint(self.receive * 1e9).astype(np.int64),
                        self.samples, self.absent, 'imu_link')


Fault = Callable[[Messages, Truth, Generator], Messages | None]
"""Changes messages in place, or gives others; adds to the truth what may be said of them."""


def at_rest(count: int, rate_hz: float, rng: Generator) -> tuple[Messages, Truth]:
    """White noise and gravity, stamped exactly and received a little later."""
    time = np.arange(count) / rate_hz
    samples = rng.normal(size=(count, 6)) * SIGMA
    samples[:, 5] += 9.81
    receive = time + 2e-4 + rng.exponential(min(2e-4, 0.05 / rate_hz), count)
    return (Messages(np.arange(count), time, np.maximum.accumulate(receive), samples,
                     np.zeros((count, 2), bool)),
            Truth(rate_hz, SIGMA / sqrt(rate_hz)))


def _lose(messages: Messages, truth: Truth, keep: NDArray[np.bool_]) -> Messages:
    """Lose messages; those before the first and after the last kept are not missed by anybody."""
    kept = messages.pick(keep)
    truth.missing = int(kept.place[-1] - kept.place[0]) + 1 - len(np.unique(kept.place))
    return kept


def random_loss(m: Messages, truth: Truth, rng: Generator) -> Messages:
    share = rng.choice([0.001, 0.005, 0.02, 0.05, 0.1])
    return _lose(m, truth, rng.random(len(m.place)) >= share)


def burst_loss(m: Messages, truth: Truth, rng: Generator) -> Messages:
    keep = np.ones(len(m.place), bool)
    for at in rng.integers(0, len(keep), max(len(keep) // 400, 1)):
        keep[at:at + rng.integers(2, 12)] = False
    return _lose(m, truth, keep)


def outages(m: Messages, truth: Truth, rng: Generator) -> Messages:
    on, off = rng.uniform(0.5, 10), rng.uniform(0.1, 15)
    irregular = rng.random() < 0.5
    keep = np.zeros(len(m.place), bool)
    time, at = m.place / truth.rate_hz, 0.0
    while at < time[-1]:
        lasts = on * (rng.uniform(0.3, 1.7) if irregular else 1)
        keep |= (time >= at) & (time < at + lasts)
        at += lasts + off * (rng.uniform(0.3, 1.7) if irregular else 1)
    return _lose(m, truth, keep)


def long_gaps(m: Messages, truth: Truth, rng: Generator) -> Messages:
    """Lose more than the gap tolerance out of every few dozen messages."""
    period = int(rng.integers(25, 200))
    lost = int(rng.integers(6, max(period // 3, 7)))
    return _lose(m, truth, np.arange(len(m.place)) % period >= lost)


def every_kth_dropped(m: Messages, truth: Truth, rng: Generator) -> Messages:
    k = int(rng.integers(4, 20))
    return _lose(m, truth, np.arange(len(m.place)) % k != 0)


def lone_samples(m: Messages, truth: Truth, rng: Generator) -> Messages:
    keep = np.ones(len(m.place), bool)
    alone, gap = int(rng.integers(1, 6)), int(rng.integers(8, 60))
    part = slice(alone, alone + gap) if rng.random() < 0.5 else slice(-alone - gap, -alone)
    keep[part] = False
    return _lose(m, truth, keep)


def repeated_messages(m: Messages, truth: Truth, rng: Generator) -> Messages:
    twice = rng.random(len(m.place)) < 0.003
    return m.pick(np.repeat(np.arange(len(m.place)), 1 + twice))


def swapped_messages(m: Messages, truth: Truth, rng: Generator) -> Messages:
    rows = np.arange(len(m.place))
    for at in rng.integers(1, len(rows), max(len(rows) // 3000, 1)):
        rows[[at - 1, at]] = rows[[at, at - 1]]
    swapped = m.pick(rows)
    swapped.receive = m.receive.copy()
    return swapped


def header_zero(m: Messages, truth: Truth, rng: Generator) -> None:
    m.header = np.full(len(m.header), -START_NS / 1e9)


def header_tick(m: Messages, truth: Truth, rng: Generator) -> None:
    tick = min((0.0001, 0.001, 0.004, 0.005, 0.01, 0.02),
               key=lambda tick: abs(np.log(tick * truth.rate_hz) + rng.uniform(0, 0.4)))
    # Ticks coarser than twice the interval lose too much to be a clock, and are seen as coarse.
    m.header = np.floor((m.header + START_NS / 1e9 % tick) / tick) * tick


def header_jitter(m: Messages, truth: Truth, rng: Generator) -> None:
    late = m.header + rng.exponential(rng.choice([0.02, 0.1, 0.2]) / truth.rate_hz, len(m.header))
    m.header = np.maximum.accumulate(late + 2e-9 * np.arange(len(late)))


def header_batches(m: Messages, truth: Truth, rng: Generator) -> None:
    """Stamp a FIFO's samples when it is read, a few microseconds apart."""
    size = int(rng.choice([4, 10, 20]))
    batch = m.place // size
    m.header = (batch + 1) * size / truth.rate_hz + (m.place % size) * 3e-5 / size


def header_nominal_batches(m: Messages, truth: Truth, rng: Generator) -> None:
    """Stamp a FIFO's samples back from its reading by an interval that is not the true one."""
    size = int(rng.choice([4, 8, 16]))
    off = float(rng.choice([-0.08, -0.04, 0.04, 0.08]))
    batch = m.place // size
    m.header = ((batch + 1) * size - (size - 1 - m.place % size) * (1 + off)) / truth.rate_hz


def header_drift(m: Messages, truth: Truth, rng: Generator) -> None:
    """Let the header clock be off by some ten parts in a million, and change."""
    m.header = m.header * (1 + rng.uniform(-5e-5, 5e-5))


def clock_step(m: Messages, truth: Truth, rng: Generator) -> None:
    at = int(rng.integers(len(m.header) // 10, len(m.header) * 9 // 10))
    step = rng.choice([-3600.0, -5.0, 5.0, 3600.0])
    m.header[at:] += step


def receive_jitter(m: Messages, truth: Truth, rng: Generator) -> None:
    late = rng.exponential(rng.choice([0.5, 3.0]) / truth.rate_hz, len(m.receive))
    m.receive = np.maximum.accumulate(m.receive + late)


def receive_bursts(m: Messages, truth: Truth, rng: Generator) -> None:
    size = int(rng.choice([2, 4, 10]))
    m.receive = ((m.place // size + 1) * size / truth.rate_hz + 1e-3 + (m.place % size) * 2e-5)


def header_speed(m: Messages, truth: Truth, rng: Generator) -> None:
    truth.said.add('clock_speed')
    m.header = m.header * float(rng.choice([0.1, 0.5, 2.0, 10.0]))


def frozen(m: Messages, truth: Truth, rng: Generator) -> None:
    truth.said.add('frozen')
    n = len(m.place)
    lasts = int(n * rng.choice([0.1, 0.3, 0.6]))
    first = int(rng.choice([0, (n - lasts) // 2, n - lasts]))
    m.samples[first:first + lasts] = m.samples[max(first - 1, 0)]


def not_a_number(m: Messages, truth: Truth, rng: Generator) -> None:
    hit = rng.integers(0, len(m.place), max(len(m.place) // 500, 1))
    m.samples[hit, rng.integers(0, 6, len(hit))] = np.nan


def knock(m: Messages, truth: Truth, rng: Generator) -> None:
    at = int(rng.integers(len(m.place) // 4, len(m.place) * 3 // 4))
    width = max(int(0.05 * truth.rate_hz), 1)
    m.samples[at:at + width] += rng.normal(size=m.samples[at:at + width].shape) * 60 * SIGMA


def coarse_output(m: Messages, truth: Truth, rng: Generator) -> None:
    step = SIGMA * float(rng.choice([0.1, 0.5]))
    m.samples = np.rint(m.samples / step) * step
    truth.density *= sqrt(1 + (step / SIGMA) ** 2 / 12)


def constant_axis(m: Messages, truth: Truth, rng: Generator) -> None:
    m.samples[:, int(rng.integers(0, 6))] = 0.123


def accel_declared_absent_later(m: Messages, truth: Truth, rng: Generator) -> None:
    truth.said.add('field_vanished')
    m.absent[int(len(m.place) * rng.uniform(0.2, 0.8)):, 1] = True


def two_publishers(m: Messages, truth: Truth, rng: Generator) -> Messages:
    truth.said.add('several_publishers')
    offset = rng.uniform(0.3, 0.5) / truth.rate_hz
    other = Messages(m.place, m.header + offset, m.receive + offset,
                     m.samples + rng.normal(size=6) * 3 * SIGMA
                     + rng.normal(size=m.samples.shape) * SIGMA * rng.choice([0.1, 2.0]),
                     m.absent)
    # In the order in which they were published, whatever their stamps say.
    order = np.arange(2 * len(m.place)).reshape(2, -1).T.ravel()
    both = Messages(*(np.concatenate([getattr(m, name), getattr(other, name)])
                      for name in ('place', 'header', 'receive', 'samples', 'absent')))
    both = both.pick(order)
    both.receive = np.maximum.accumulate(both.receive)
    return both


def rate_change(m: Messages, truth: Truth, rng: Generator) -> Messages:
    truth.said.add('rate_changed')
    at = int(len(m.place) * rng.uniform(0.05, 0.95))
    rows = np.concatenate([np.arange(at), np.arange(at, len(m.place), 2)])
    return m.pick(rows)


def polled_twice(m: Messages, truth: Truth, rng: Generator) -> Messages:
    truth.said |= {'held_values', 'band_limited'}
    rows = np.repeat(np.arange(len(m.place)), 2)
    twice = m.pick(rows)
    half = np.tile([0, 0.5 / truth.rate_hz], len(m.place))
    twice.header, twice.receive = twice.header + half, twice.receive + half
    return twice


def spikes(m: Messages, truth: Truth, rng: Generator) -> None:
    truth.said |= {'spikes'}
    hit = rng.random(len(m.place)) < 0.01
    m.samples[hit] += rng.choice([-1, 1], (np.count_nonzero(hit), 6)) * 30 * SIGMA


def header_whole_seconds(m: Messages, truth: Truth, rng: Generator) -> None:
    """Leave the nanoseconds of header stamps at zero."""
    m.header = np.floor(m.header) - START_NS % 10**9 / 1e9


def header_constant(m: Messages, truth: Truth, rng: Generator) -> None:
    """Stamp every message with the time at which the driver started."""
    m.header = np.zeros(len(m.header))


def header_stray(m: Messages, truth: Truth, rng: Generator) -> None:
    m.header[rng.integers(0, len(m.header), 3)] += 3600


def header_resets(m: Messages, truth: Truth, rng: Generator) -> None:
    """Let the header clock begin anew, as that of a sensor which was switched off and on."""
    at = int(len(m.header) * rng.uniform(0.1, 0.9))
    m.header[at:] -= m.header[at]


def receive_constant(m: Messages, truth: Truth, rng: Generator) -> None:
    """Note one time of reception for all messages, as some converters do."""
    m.receive = np.full(len(m.receive), m.receive[-1])


def heavy_loss(m: Messages, truth: Truth, rng: Generator) -> Messages:
    return _lose(m, truth, rng.random(len(m.place)) >= rng.uniform(0.2, 0.6))


def dropped_in_turn(m: Messages, truth: Truth, rng: Generator) -> Messages:
    patterns = ((1, 1, 0), (1, 1, 0, 0), (1, 1, 1, 0, 0), (1, 1, 1, 1, 0, 0))
    return _lose(m, truth, np.resize(
        np.array(patterns[int(rng.integers(len(patterns)))], bool), len(m.place)))


def driver_restart(m: Messages, truth: Truth, rng: Generator) -> Messages:
    at = int(len(m.place) * rng.uniform(0.1, 0.7))
    keep = np.ones(len(m.place), bool)
    keep[at:at + len(keep) // 5] = False
    return _lose(m, truth, keep)


def noise_changes(m: Messages, truth: Truth, rng: Generator) -> None:
    truth.said |= {'not_steady', 'noise_level_changed', 'motion', 'rest_within_motion'}
    at = int(len(m.place) * rng.uniform(0.15, 0.85))
    level = m.samples.mean(axis=0)
    m.samples[at:] = level + (m.samples[at:] - level) * rng.choice([0.5, 2.0])


def axis_wakes_late(m: Messages, truth: Truth, rng: Generator) -> None:
    """Let an axis, or all of a sensor, give one value first; or again later."""
    truth.said |= {'stood_still', 'bias_step', 'saturated', 'refused'}
    axes = [slice(0, 3), slice(3, 6), slice(2, 3)][int(rng.integers(3))]
    n = len(m.place)
    m.samples[:int(n * rng.uniform(0.02, 0.7)), axes] = 0.0
    if rng.random() < 0.3:
        at = int(n * rng.uniform(0.75, 0.8))
        m.samples[at:at + n // 10, axes] = m.samples[at, axes]


def infinite(m: Messages, truth: Truth, rng: Generator) -> None:
    hit = rng.integers(0, len(m.place), max(len(m.place) // 1000, 1))
    m.samples[hit, rng.integers(0, 6, len(hit))] = rng.choice([np.inf, -np.inf, 1e30], len(hit))


def axes_nan_for_a_while(m: Messages, truth: Truth, rng: Generator) -> None:
    first = int(len(m.place) * rng.choice([0.0, 0.3, 0.67]))
    m.samples[first:first + len(m.place) // 3, int(rng.integers(0, 6)):] = np.nan


def gyro_declared_absent_first(m: Messages, truth: Truth, rng: Generator) -> None:
    m.absent[:int(len(m.place) * rng.uniform(0.1, 0.6)), 0] = True


def tilt(m: Messages, truth: Truth, rng: Generator) -> None:
    truth.said |= {'motion', 'rest_within_motion'}
    at = m.place[0] + len(m.place) * rng.uniform(0.2, 0.8)
    turned = np.clip((m.place - at) / (2 * truth.rate_hz), 0, 1)
    m.samples[:, 3] += 2.0 * turned


def header_late(m: Messages, truth: Truth, rng: Generator) -> None:
    """Let header stamps be late with a heavy tail, as those of a loaded machine, in order."""
    tail = float(rng.choice([1.5, 2.0, 3.0]))
    scale = rng.choice([0.05, 0.15, 0.3]) / truth.rate_hz
    # One that comes twice has one stamp; what waits for a late one is stamped right behind it.
    late = scale * rng.pareto(tail, int(m.place.max()) + 1)[m.place]
    behind = min(2e-5, 0.02 / truth.rate_hz) * m.place
    m.header = np.maximum.accumulate(m.header + late - behind) + behind
    m.receive = np.maximum.accumulate(np.maximum(m.receive, m.header + 1e-4))


def one_of_few_dropped(m: Messages, truth: Truth, rng: Generator) -> Messages:
    k = int(rng.integers(3, 5))
    return _lose(m, truth, np.arange(len(m.place)) % k != 0)


def zero_rows(m: Messages, truth: Truth, rng: Generator) -> None:
    """Send zeros now and then, as a driver whose bus read failed."""
    m.samples[rng.random(len(m.place)) < rng.choice([3e-4, 1e-3, 3e-3])] = 0.0


def half_rate_vibration(m: Messages, truth: Truth, rng: Generator) -> None:
    """Shake at half the rate, as mains hum at a rate of twice its frequency does, or near it."""
    axes = rng.permutation(6)[:int(rng.choice([1, 3, 6]))]
    cycles = 0.5 - float(rng.choice([0.0, 0.0, 1e-5, 1e-3]))
    m.samples[:, axes] += (SIGMA * rng.choice([0.3, 1.0, 3.0]) * rng.uniform(0.5, 1.5, len(axes))
                           * np.cos(2 * np.pi * cycles * m.place[:, None]
                                    + rng.uniform(0, 2 * np.pi)))


STAMPS: tuple[Fault, ...] = (
    header_zero, header_tick, header_jitter, header_batches, header_nominal_batches,
    header_drift, clock_step, receive_jitter, receive_bursts, header_speed, header_whole_seconds,
    header_constant, header_stray, header_resets, receive_constant)
LOSSES: tuple[Fault, ...] = (
    random_loss, burst_loss, outages, long_gaps, every_kth_dropped, lone_samples,
    repeated_messages, swapped_messages, heavy_loss, dropped_in_turn, driver_restart)
SAMPLES: tuple[Fault, ...] = (
    frozen, not_a_number, knock, coarse_output, constant_axis, accel_declared_absent_later,
    two_publishers, rate_change, polled_twice, spikes, infinite, axes_nan_for_a_while,
    gyro_declared_absent_first, tilt, noise_changes, axis_wakes_late)
FAULTS = (LOSSES, STAMPS, SAMPLES)
MORE_FAULTS = ((*LOSSES, *3 * (one_of_few_dropped,)), (*STAMPS, *4 * (header_late,)),
               (*SAMPLES, *2 * (zero_rows, half_rate_vibration)))
"""With what was found later, more often than the others."""
EXACT = {'random_loss', 'burst_loss', 'long_gaps', 'lone_samples', 'repeated_messages',
         'header_drift', 'receive_jitter', 'receive_bursts', 'header_speed', 'frozen', 'knock',
         'coarse_output', 'constant_axis', 'receive_constant', 'driver_restart',
         'noise_changes', 'tilt', 'half_rate_vibration'}
"""Faults beside which missing samples can be counted to the last one."""
SLOW = ('bias_instability', 'rate_random_walk')
DENSITY_TOLERANCE = 0.03
RATE_TOLERANCE = 0.002
MOVES = ('scenario, topic /imu: the IMU moves during most of the recording. Record it at rest, '
         'choose a still part with --start and --duration, or keep everything with --motion keep')
OR_TWO = ('or two sensors publish on this topic: ros2 topic info --verbose names the publishers')


@dataclass(frozen=True)
class Verdict:
    """What the oracle says of one scenario: `violations` empty where all is well."""

    seed: int
    faults: tuple[str, ...]
    rate_hz: float
    violations: tuple[str, ...]
    false_terms: int
    axes: int


def compose(seed: int, samples: int = 20_000, kinds: Sequence[Sequence[Fault]] = FAULTS
            ) -> tuple[Messages, Truth, Generator]:
    rng = np.random.default_rng(seed)
    rate_hz = float(rng.choice(RATES))
    count = int(min(samples * rng.uniform(0.3, 1.0), 1200 * rate_hz))
    messages, truth = at_rest(count, rate_hz, rng)
    for kind in rng.permutation(3)[:rng.choice([1, 2, 3], p=[0.5, 0.35, 0.15])]:
        fault = kinds[kind][int(rng.integers(len(kinds[kind])))]
        if ('two_publishers' in truth.faults and kind == 0) or (
                fault is two_publishers and truth.missing):
            # Two publishers are seen by undisturbed turns.
            continue
        truth.faults.append(fault.__name__)
        messages = fault(messages, truth, rng) or messages
    if 'knock' in truth.faults and (
            len(messages.place) < 4 * rate_hz or 0 < np.ptp(messages.header) < 4):
        # By one of the clocks, a knock with its margins is the larger part of it.
        truth.said.add('refused')
    if 'tilt' in truth.faults and np.ptp(messages.header) < 6.5:
        # By its stamps the record is so short that the turn, and where its means are held against
        # those of two seconds before, and a second on each side, are all of it.
        truth.said.add('refused')
    if 'noise_changes' in truth.faults and len(messages.place) < 150 * rate_hz:
        # It takes a minute to tell a louder sensor from an engine, of what no outage takes away.
        truth.said.add('refused')
    return messages, truth, rng


def characterized(messages: Messages, rng: Generator | None = None, **options: object) -> Result:
    """Give the result of messages; with `rng` by blocks of random sizes, saved on the way."""
    run = Characterization(kind='recording', path='scenario', topic='/imu',
                           options=TimelineOptions(**options))  # type: ignore[arg-type]
    block = messages.block()
    edges = [] if rng is None else rng.integers(0, len(block), 12)
    for part in cut(block, [*edges, *(edge + 1 for edge in edges[::3])]):
        # As node and recordings do: a driver may take a while to start.
        with suppress(NoAxes):
            run.update(part)
        if rng is not None and rng.random() < 0.05:
            run = Characterization.from_state(run.to_state())
    run.finish()
    return run.result()


def _bound(result: Result, *names: str) -> float:
    """Largest share that the result says something may be off by; 0 if it says nothing."""
    return max((found.values.get(name) or 0.0 for found in result.warnings for name in names),
               default=0.0)


def false_terms(result: Result) -> int:
    """Count the axes that have a slow term, which no scenario has."""
    return sum(any(axis.coefficients[key].observable for key in SLOW)
               for axis in result.axes.values())


def judge(result: Result, truth: Truth) -> tuple[list[str], int, int]:
    """Give what is silently wrong, how many axes have a false slow term, and of how many."""
    wrong: list[str] = []
    codes = {remark.code for remark in result.warnings}
    said = bool(codes & (truth.said | {'counted_samples'}))
    rate = result.timeline.sample_rate_hz
    off = _bound(result, 'rate_error_share')
    too_high = _bound(result, 'density_high_share')
    missing = _bound(result, 'density_error_share')
    hidden = _bound(result, 'hidden_share')
    may = max(off, RATE_TOLERANCE)
    if not result.axes and not codes:
        wrong.append('no axes and no word')
    if rate is None and 'unknown_rate' in codes:
        said = True
    if (rate is None or not -may - hidden < rate / truth.rate_hz - 1 < may) and not said:
        wrong.append(f'rate {rate}')
    for name, axis in result.axes.items():
        density = axis.coefficients['noise_density']
        if 'constant_axis' in codes and not density.observable:
            continue
        if density.observable and density.value is not None and density.ci95 is not None:
            low, high = (density.value + 3 * (end - density.value) for end in density.ci95)
            least = DENSITY_TOLERANCE + off / 2 + missing
            near = -least < density.value / truth.density - 1 < least + too_high
            if not (near or low <= truth.density <= high) and not said:
                wrong.append(f'{name} N {density.value / truth.density - 1:+.1%}')
    # In its values, a vibration at half the rate looks like two.
    if 'several_publishers' in codes and not (
            {'two_publishers', 'half_rate_vibration'} & set(truth.faults)):
        wrong.append('one publisher passes for several')
    exact = EXACT.issuperset(truth.faults) and not said and 'uneven_stamps' not in codes
    if exact and result.timeline.missing != truth.missing:
        wrong.append(f'missing {result.timeline.missing} of {truth.missing}')
    return wrong, false_terms(result), len(result.axes)


def verdict(seed: int, samples: int = 20_000, axes_there: int = 6, *,
            kinds: Sequence[Sequence[Fault]] = FAULTS) -> Verdict:
    """Run one scenario; most of its time goes into the fit of the axes that are there."""
    messages, truth, rng = compose(seed, samples, kinds)
    messages.samples[:, rng.permutation(6)[axes_there:]] = np.nan
    there = np.isfinite(messages.samples) & ~np.repeat(messages.absent, 3, axis=1)
    if not (there[:4096].mean(axis=0) > 0.5).any():
        truth.said.add('refused')
    try:
        wrong, slow_axes, axes = judge(characterized(messages, rng), truth)
    except ImuAllanError as error:
        said = 'refused' in truth.said or ('several_publishers' in truth.said
                                           and str(error) == f'{MOVES}; {OR_TWO}')
        wrong = [] if said else [f'refused: {error}']
        slow_axes, axes = 0, 0
    except Exception as error:
        wrong, slow_axes, axes = [f'{type(error).__name__}: {error}'], 0, 0
    return Verdict(seed, tuple(truth.faults), truth.rate_hz, tuple(wrong), slow_axes, axes)


def main(first: int, last: int, kinds: Sequence[Sequence[Fault]]) -> None:
    """Print what is wrong of a range of seeds: ``scenarios.py 0 2000``, or with `more` faults."""
    wrong = slow_axes = axes = 0
    for seed in range(first, last):
        one = verdict(seed, 6000, 3, kinds=kinds)
        wrong += bool(one.violations)
        slow_axes += one.false_terms
        axes += one.axes
        if one.violations:
            print(one, flush=True)
    print(f'{wrong} of {last - first} wrong, {slow_axes} of {axes} axes with a false slow term')


if __name__ == '__main__':
    main(*map(int, sys.argv[1:3]), MORE_FAULTS if sys.argv[3:] == ['more'] else FAULTS)
