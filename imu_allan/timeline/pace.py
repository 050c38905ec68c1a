# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The pace of a sensor: how far apart samples are, and how surely stamps show a lost one.

There are two ways of reading the stamps.

On a *grid*, every stamp lies near a multiple of the interval, and a step of two intervals is a
lost sample. On a *line*, every message is one sample, however uneven its stamp. Such stamps come
in ticks, in batches, or back-dated by a wrong interval, and only a lasting jump is a loss. Both
can explain the same stamps: one in ten messages dropped looks like a tick of nine tenths of the
interval. Chance decides first: stamps stray ever further from a line if samples are lost at
random, but not if they are rounded or late. If messages are dropped in turn, the other clock
decides, since time passes on it, too, during a true loss.

References
----------
P. Whittle, Ark. Mat. 2 (1953): the likelihood of a spectrum.

"""

from dataclasses import dataclass, replace
from math import log, pi, sqrt

from imu_allan.arrays import Array, Bools, Ints
from imu_allan.timeline.stamps import Stamps
import numpy as np

PHASE_GROUP = 64
"""Messages that give one phase, or one rate: many for a burst, few for a drift."""
COUNTING_SPREAD = 0.27
"""Spread of the phase, in intervals, beyond which a lost sample (one interval) looks like
jitter."""

_FEW_LOSSES = 8
"""Fewer losses change the rate by no more than its error."""
_TICKED = 1e-3
"""Spread about a grid, in intervals, beyond which stamps are no whole ticks."""
_GROUP = 16
"""Messages per median: with 8, ticks as long as the interval pass for losses (there is a test)."""
_GROUPS = 8
"""A jump lasts if 8 medians of 16 messages all exceed the 8 before. A stall is over by then."""
_LEAP = 16
"""Jumps by this many samples are outages. With 8, sums of random losses pass for outages; 32 works
as well."""
_MOST_HIDDEN = 0.9
"""Largest share reported as hidden: if more than nine in ten are lost, a bound says nothing."""


@dataclass(frozen=True)
class Pace:
    """How the stamps of a sensor advance."""

    interval_ns: float  # mean interval between samples
    spread: float = 0.0  # standard deviation of the stamps about the grid, in intervals
    # Whether stamps are too uneven to show a single missing sample. Then messages are counted, and
    # only a lasting jump of the phase is taken for missing samples.
    counting: bool = False
    # Share of all samples, lost ones included, that may be lost without showing in the stamps.
    hidden: float = 0.0
    messages: int = 0  # stamps from which the first pace of a recording was measured

    @property
    def batch(self) -> float:
        """Intervals over which stamps scatter, as those of a batch do evenly."""
        return sqrt(12) * self.spread


def measure_pace(stamps: Stamps, other: Stamps | None = None) -> Pace | None:
    """Measure the sample interval of increasing stamps; None for fewer than two."""
    # On a grid, it is the interval whose phases fit best, whatever share of its places is empty
    # and however late single stamps are. `other` are the stamps of the other clock.
    n = len(stamps)
    if n < 2:
        return None
    time = (stamps - stamps[0]).astype(np.float64)
    steps = np.diff(time)
    if n < 8:
        return Pace(float(np.median(steps)))
    overall = _even_with_outages(steps)
    if overall is None:
        overall = _median_interval(time, max(min(n // 4, PHASE_GROUP), 1))
        # Bursts fit every grid whose interval divides their distance.
        short = steps < 0.5 * overall
        # Half of the steps in pairs are short, more in longer bursts.
        if np.mean(short) > 0.55:
            return _in_batches(time, ~short) or _on_a_line(time)[0]
        grid = _best_grid(time, steps, overall)
    else:
        grid = _on_grid(time, steps, overall)
    return _on_a_line(time)[0] if grid is None else _grid_or_line(time, grid, other)


def _best_grid(time: Array, steps: Array, overall: float) -> Pace | None:
    """Find the interval whose phases fit best, from a spectrum of the stamps."""
    size = min(len(time), PHASE_GROUP)
    groups = time[:len(time) // size * size].reshape(-1, size)
    # In the shortest groups all messages wait for a late one; the longest contain an outage.
    order = np.argsort(np.ptp(groups, axis=1))
    groups = groups[order[len(order) // 5:][:16]]
    # The sensor's rate is at least that of the messages: search from slightly below that.
    rates = np.arange(0.9, 2.9, 0.25 / size) / overall
    # One group after the other, which takes a sixteenth of the memory.
    circles = (np.exp(2j * pi * rates[:, None] * (group - group[0])) for group in groups)
    power = np.stack([np.abs(circle.mean(axis=1)) for circle in circles], axis=1).mean(axis=1)
    peaks = np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:])) + 1
    if not len(peaks):
        return None
    # Take the lowest rate, as a grid of half the interval fits exact stamps equally well.
    rate = float(rates[peaks[power[peaks] > 0.9 * power[peaks].max()][0]])
    # If some messages are half an interval late, half the interval fits best, but most messages
    # lie at every other place. Random losses leave odd and even places equally often.
    circle = np.exp(1j * pi * rate * (groups - groups[:, :1]))
    if rate > 1.8 / overall and np.mean(np.abs(circle.mean(axis=1))) > 0.4:
        rate /= 2
    return _on_grid(time, steps, 1 / rate)


def _on_grid(time: Array, steps: Array, interval: float) -> Pace | None:
    """Return the pace on a grid of about this interval, or None if stamps fit no such grid."""
    whole = np.rint(steps / interval)
    # Some receive stamps are slightly late. Chosen by judgment.
    near = (np.abs(steps / interval - whole) < 0.15) & (whole > 0) & (whole < PHASE_GROUP)
    of_near = float(steps[near].sum() / whole[near].sum()) if near.any() else interval
    pace = _refine(time, of_near)
    if pace.spread > COUNTING_SPREAD:
        # Of stamps in slots of a radio, those near a whole number of intervals are all too short.
        pace = _refine(time, interval)
    return None if pace.spread > COUNTING_SPREAD or _overfull(time, pace.interval_ns) else pace


def pace_of_each(stamps: Stamps) -> Pace:
    """Measure the interval of samples none of which is lost."""
    line, _ = _on_a_line((stamps - stamps[0]).astype(np.float64))
    # A poll that comes late by a part of the interval is no lost sample.
    return Pace(line.interval_ns, line.spread, counting=line.spread > 0.05)


def _lost_by_chance(steps: Array) -> bool:
    """Return whether random losses explain steps on a grid better than late stamps in ticks."""
    if np.all(steps > 0):
        # Random losses make longer steps in one of twenty records: these are outages. Those of
        # late stamps are made up for by the next, which share a place.
        steps = steps[steps < 1 + log(0.05 / len(steps)) / log(1 - 1 / float(steps.mean()))]
    # Whittle's likelihood of slow changes. Steps are independent if samples are lost at random:
    # their power is the same at all frequencies, and known from their mean. That of lateness, and
    # of ticks below their beat with the interval, grows with the square of the frequency.
    n, mean = len(steps), float(steps.mean())
    white = mean * (mean - 1)
    count = max(min(n // 20, int(n * (mean - 1) / 2)), 4)
    power = np.abs(np.fft.rfft(steps - mean)[1:count + 1]) ** 2 / n
    late = np.geomspace(1e-4, 1e3, 40)[:, None] * (2 * pi * np.arange(1, len(power) + 1) / n) ** 2
    # Of samples late in ticks, some may be lost, too: at most an eighth of the empty places.
    chance, ticks = (float(np.sum(np.log(own + late) + power / (own + late), axis=1).min())
                     for own in (white, white / 8))
    # Before the stamps are seen, losses are twenty times as likely as ticks of that length.
    return chance < ticks + log(20)


def _slower_in_ticks(time: Array, ticks: Pace) -> Pace:
    """Return the pace of a sensor whose samples explain which ticks are empty, else the ticks."""
    # Rounded stamps occupy the ticks within which a sample falls: all others are empty. In
    # intervals of the sensor, they are a part of a turn, as long as a tick.
    occupied = _occupied(np.rint(np.diff(time) / ticks.interval_ns))
    count = len(occupied)
    # In cycles per tick, by a sixteenth of what the ticks resolve, from two cycles on.
    power = np.abs(np.fft.rfft(occupied - occupied.mean(), 16 * count))[32:]
    peaks = np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:])) + 1
    slow = (peaks[np.argsort(power[peaks])[-8:]] + 32) / (16 * count)
    # By rate: what its empty part gains, and the most that a part of any length does.
    gains: dict[float, tuple[float, float]] = {}
    # A rate shows at its alias, too. The sensor's is at least that of the samples that are there.
    for rate in (*slow.tolist(), *(1 - slow).tolist()):
        if rate > 0.98 * np.count_nonzero(occupied) / count:
            turn = rate * np.arange(count)
            middle = float(np.angle(np.exp(2j * pi * turn[occupied]).sum())) / (2 * pi)
            off = np.abs((turn - middle + 0.5) % 1 - 0.5)
            inner = occupied[np.argsort(off)]
            gain = _likelihoods(inner) + np.append(_likelihoods(inner[::-1])[-2::-1], 0.0)
            gain -= gain[-1]
            gains[rate] = (float(gain[np.count_nonzero(off < 0.5 * rate) - 1]), float(gain.max()))
    best = max(gains, key=gains.__getitem__, default=1.0)
    gained, most = gains.get(best, (0.0, 0.0))
    # Among so many rates, chance gains less. Losses of several in a row at even distances leave a
    # larger part of the turn empty than rounding does.
    if gained < max(log(1e3 * count), 0.7 * most):
        return ticks
    interval = ticks.interval_ns / best
    # One of k may be lost, besides others. And late stamps lie beside the place of a slow sensor,
    # but within that of its mirror image.
    unsure = abs(best + 1 / round(1 / (1 - best)) - 1) < 1 / count or any(
        rate < 0.98 * best and gain > 0.5 * gained for rate, (gain, _) in gains.items())
    # Ticks that are no grid: the share that may be hidden then includes them.
    return replace(ticks, spread=1.0) if unsure else Pace(
        interval, group_phases(time / interval - np.arange(len(time)))[1])


def _occupied(steps: Array) -> Bools:
    """Return which ticks have a sample, at most 4096 in the longest part without an outage."""
    edges = np.flatnonzero(np.concatenate([[True], steps >= _LEAP, [True]]))
    first = int(np.argmax(np.diff(edges)))
    places = np.cumsum(steps[edges[first]:edges[first + 1] - 1].astype(np.int64))
    occupied = np.zeros(min(int(places[-1]) + 1, 4096), dtype=bool)
    occupied[np.append(0, places[places < len(occupied)])] = True
    return occupied


def _likelihoods(occupied: Bools) -> Array:
    """Return the log likelihood of the first places, ever more, if samples are lost at random."""
    n, kept = np.arange(1, len(occupied) + 1), np.cumsum(occupied)
    lost = n - kept
    return np.asarray(kept * np.log(np.maximum(kept, 1) / n)
                      + lost * np.log(np.maximum(lost, 1) / n))


def _steps_repeat(steps: Array, share: float) -> bool:
    """Return whether steps repeat after some turn, in this share of their variance."""
    long = steps > np.floor(steps.mean())
    apart = np.diff(np.flatnonzero(long), append=len(long))
    for turn in (*range(2, 20), int(np.median(apart))):
        # Within segments; over shorter ones, the beat of a timer looks as regular.
        rows = max(min(512, len(long)) // turn, 1) * turn
        parts = long[:len(long) // rows * rows].reshape(-1, rows // turn, turn).astype(np.float64)
        if np.median(parts.mean(axis=1).var(axis=1) - share * parts.var(axis=(1, 2))) >= 0:
            return True
    return False


def _in_batches(time: Array, begins: Bools) -> Pace | None:
    """Measure the pace of batches, each message being one sample; ignore outages between them."""
    first = np.flatnonzero(np.append(True, begins))
    if len(first) < _FEW_LOSSES:
        return None
    size, lasts = np.diff(first), np.diff(time[first])
    usual = float(np.median(lasts / size))
    # A timer that reads a FIFO finds one sample more or less.
    on = np.abs(lasts - usual * size) < usual * np.maximum(0.5 * size, 1.5)
    if usual <= 0 or np.mean(on) < 0.5:
        return None
    interval = float(lasts[on].sum() / size[on].sum())
    sizes = np.diff(np.append(first, len(time)))
    residual = ((time - np.repeat(time[first], sizes)) / interval
                - np.arange(len(time)) + np.repeat(first, sizes))
    leaps = lasts / interval - size
    wander = (time[first] / interval - first)[1:] - np.cumsum(np.where(leaps < _LEAP, 0.0, leaps))
    # Starts of batches have no sawtooth, so shorter lags are enough, with a smaller error.
    hidden = _hidden(np.repeat(wander, sizes[1:]), 16, 2.0)
    # Less than one in 200 affects no result.
    if hidden > 0.005:
        # After losses, the sizes of equal batches are binomial, which shows the share better.
        single = size[size < 1.5 * np.median(size)]
        share = float(single.var() / single.mean()) * (1 + 2 * sqrt(2 / len(single)))
        hidden = min(max(hidden, share), _MOST_HIDDEN)
    return Pace(interval, float(residual.std()), counting=True, hidden=hidden)


def _grid_or_line(time: Array, grid: Pace, other: Stamps | None) -> Pace:
    """Decide whether samples that are missing on the grid are truly lost, and return the pace."""
    own = np.diff(time)
    steps = np.rint(own / grid.interval_ns)
    # Outages are losses, whatever the other stamps are.
    short = steps < _LEAP
    own, steps, n = own[short], steps[short], len(time)
    lost = float(np.sum(steps[steps > 1] - 1))
    # Messages that waited for a late one share its place; they fill the empty ones before.
    waited = np.count_nonzero(steps == 0)
    if np.count_nonzero(steps > 1) < _FEW_LOSSES or lost - waited < _FEW_LOSSES:
        return grid
    line, worst = _on_a_line(time)
    apart = abs(line.interval_ns / grid.interval_ns - 1)
    # A line explains the empty places of the grid by ticks. If they are few, they may be losses
    # that are evenly spaced by chance, among others that the line shows as well. Intervals that
    # differ by up to a fifth of the losses may still be equal.
    if apart < max(0.2 * lost / n, 1e-4) or apart * n < _FEW_LOSSES:
        return grid
    # Messages dropped in turn repeat; how clearly depends on the jitter.
    repeat = _steps_repeat(steps, 0.8 - 3 * grid.spread)
    # A timer that finds a sample only at every second or third reading shows time passing on both
    # clocks. Of messages dropped in turn, two would sometimes be neighbours.
    truly = (None if other is None or np.percentile(steps, 1) > 1 else
             _lost_by(np.diff(other)[short].astype(np.float64), own, steps, grid.interval_ns))
    # Of a slower sensor in ticks, some samples may be lost at random, too.
    sensor = (grid if repeat or grid.spread > _TICKED or (truly is not None and truly > 0.85)
              else _slower_in_ticks(time, grid))
    # The bound on interpolation holds with 0.4 of the places occupied, but not with 0.3.
    share = 1 - sensor.interval_ns / float(own.mean())
    lossy = sensor if share < 0.63 and sensor.spread < COUNTING_SPREAD else replace(
        line, hidden=max(line.hidden, share))
    if _lost_by_chance(steps):
        return lossy
    # Of ticks so late that they leave a line, some share a place with the next.
    late = grid.spread < 0.05 and waited > 0.01 * n
    # Ticks, exact or late, and a timer that reads a slower sensor beat with the interval.
    if (late or worst < 0.75 + 3 * grid.spread) and not repeat:
        return line
    if truly is not None:
        return lossy if truly > 0.5 else line
    if worst > 0.75 or grid.spread > 0.05:
        # Ticks and regular drops keep their stamps near a line. Ticks are exact, and no delays are
        # added to them.
        return lossy
    size = min(_GROUP, n)
    off = (time - line.interval_ns * np.arange(n))[:n // size * size]
    wide = float(np.median(np.ptp(off.reshape(-1, size), axis=1)))
    # Stamps rounded to ticks lie within less than one tick, 16 in a row within about 0.94. With
    # two kept and two dropped in turn they lie within 1, with three kept and two dropped within
    # 1.33.
    if wide > 0.99 * grid.interval_ns:
        return lossy
    return replace(line, hidden=max(line.hidden, apart / (1 + apart)))


def _lost_by(passed: Array, own: Array, steps: Array, interval: float) -> float | None:
    """Return the intervals that pass on the other clock per place missing; None if unknown."""
    if (not 0.5 < float(passed.sum()) / float(own.sum()) < 2
            or np.max(np.abs(passed - own)) < 0.02 * interval
            or np.mean(passed == 0) > 0.1):
        # A clock that stops, jumps, or copies the first one shows nothing. Nor does a clock whose
        # ticks are longer than the interval, as they may coincide with regular losses.
        return None
    # Losses may always come in twos, so the two most common numbers of steps decide.
    counts = np.bincount(steps[(steps > 0) & (steps < PHASE_GROUP)].astype(np.int64), minlength=3)
    few, many = np.sort(np.argsort(counts)[-2:]).tolist()
    one, more = (np.sort(passed[steps == count]) for count in (few, many))
    if len(more) < _FEW_LOSSES or len(one) < _FEW_LOSSES:
        return None
    one, more = (part[len(part) // 20:len(part) - len(part) // 20] for part in (one, more))
    if float(one.std()) > 0.75 * interval or abs(float(one.mean()) / interval - few) > 0.5 * few:
        # Nor does one that is read in batches or whole seconds: the time of a batch shows little
        # of the time of its samples.
        return None
    error = sqrt(float(one.var()) / len(one) + float(more.var()) / len(more)) / interval
    return (None if error > 0.2 * (many - few) else
            float(more.mean() - one.mean()) / interval / (many - few))


def _even_with_outages(steps: Array) -> float | None:
    """Return the median step if messages are even except for pauses of any length, else None."""
    usual = float(np.median(steps))
    # No IMU samples faster than 10 kHz: messages that are evenly closer were read from a FIFO.
    if usual < 1e5:
        return None
    near = np.abs(steps - usual) < 0.1 * usual
    on = float(steps[near].sum()) / float(steps.sum())
    pauses = steps[~near]
    if not len(pauses):
        return None
    # Late stamps make many short uneven steps, so take the median by time: half of the time beside
    # even steps passes in longer steps than this.
    pauses = np.sort(pauses)
    passed = np.cumsum(pauses)
    lasting = float(pauses[np.searchsorted(passed, passed[-1] / 2)])
    # With few messages between two outages, the share of even steps is smaller. Losses of single
    # messages cause shorter pauses, and a FIFO overflows after some tenths of a second.
    longest_batch_ns = 5e8
    few = lasting > max(longest_batch_ns, 4.0 * usual)
    if not few and np.mean(steps < 0.9 * usual) > 0.15:
        # Of a sensor in ticks, some steps have one tick less than most.
        return None
    # Even segments take at least a tenth of the time, bursts a few percent.
    if np.mean(near) > (0.5 if few else 0.75) and (
            on > 0.1 or len(steps) > PHASE_GROUP * len(pauses) or lasting > longest_batch_ns):
        return usual
    return None


def _overfull(time: Array, interval: float) -> bool:
    """Return whether there are more messages than grid places, as on the grid of batches."""
    # Messages that wait for a late one also arrive together, but none of them early.
    groups = len(time) // _GROUP
    phase = (time / interval - np.arange(len(time)))[:groups * _GROUP].reshape(groups, _GROUP)
    falls = np.diff(phase.min(axis=1)) < -0.9
    # A group in which all messages wait shows no grid place.
    goes_on = phase[:, -1] - phase[:, 0] > -_GROUP / 2
    # With pairs of which 60 % are lost, the share is 0.08; on a grid, it is zero.
    return groups > 1 and bool(np.mean(falls & goes_on[1:] & goes_on[:-1]) > 0.06)


def _refine(time: Array, interval: float) -> Pace:
    """Adjust the interval until the phase is constant, and measure the spread about it."""
    for _ in range(4):
        phase = time / interval - np.arange(len(time))
        turn, spread = group_phases(phase)
        if len(turn) > 1:
            lasts = _median_interval(time, PHASE_GROUP) * PHASE_GROUP
            interval *= 1 + float(np.median(np.diff(turn))) * interval / lasts
    return Pace(interval, spread)


def spread_about(stamps: Stamps, interval_ns: float) -> float:
    """Return the standard deviation of increasing stamps about a grid, in intervals."""
    time = (stamps - stamps[0]).astype(np.float64)
    return group_phases(time / interval_ns - np.arange(len(time)))[1]


def _on_a_line(time: Array) -> tuple[Pace, float]:
    """Fit a line with one sample per message; also return how far stamps lie off it."""
    n = len(time)
    place = np.arange(n, dtype=np.float64)
    interval = (_median_interval(time, max(min(n // 4, PHASE_GROUP), 1))
                or float(time[-1]) / (n - 1))
    for _ in range(3):
        counted = place + lasting_jumps(time / interval - place)
        middle = counted - counted.mean()
        interval = float(middle @ (time - time.mean()) / (middle @ middle))
    residual = time / interval - counted
    residual -= float(np.median(residual))
    # A loss is located some messages early or late, and those in between lie off. The percentile
    # ignores them. Chosen by judgment.
    worst = float(np.percentile(np.abs(residual), 95))
    # Small jumps may be sums of random losses.
    leaps = np.diff(counted - place, prepend=0.0)
    # The fit absorbs some of the random walk. In 60 windows each of 2048 and 4096 messages with 2,
    # 10 and 40 % lost, the bound held for all but 0 to 5 %.
    hidden = _hidden(residual + np.cumsum(np.where(leaps < _LEAP, leaps, 0.0)), 32, 5.0)
    return Pace(interval, float(residual.std()), counting=True, hidden=hidden), worst


def _hidden(residual: Array, apart: int, errors: float) -> float:
    """Bound the share of the samples that may be lost unseen; lags are multiples of `apart`."""
    # Lags are longer than a batch, and short enough to fit often into a window.
    lags = apart * np.arange(1, 5)
    # Random losses turn the phase into a random walk, whose variance grows by their share with
    # every message; jitter, ticks and batches do not. `errors` is the number of standard
    # deviations to add, those of a variance from the few segments that fit into a window.
    if len(residual) < 3 * lags[-1]:
        return 0.0
    # Averaged over 20 lags, at least one batch, since a FIFO is read at least every 20 messages. A
    # batch adds most variance at half its length, and none at its full length.
    variances = [float(np.mean([np.var(residual[at:] - residual[:-at])
                                for at in range(lag, lag + 20)]))
                 for lag in lags.tolist()]
    slope = float(np.polyfit(lags, variances, 1, w=1 / lags)[0])
    error = sqrt(2 * float(lags[-1]) / len(residual))
    return min(max(slope * (1 + errors * error), 0.0), _MOST_HIDDEN)


def lasting_jumps(phase: Array, new_run: bool = True) -> Ints:
    """Count all samples missing before each message, by jumps of the phase that last."""
    # The phase is the stamp in intervals, minus the number of the message: 0 before, unless these
    # are the first messages of a run.
    missing = np.zeros(len(phase), dtype=np.int64)
    groups = len(phase) // _GROUP
    if groups < 4:
        return missing
    level = np.median(phase[:groups * _GROUP].reshape(groups, _GROUP), axis=1)
    lead = 0 if new_run else _GROUPS
    level = np.concatenate([np.zeros(lead), level])
    # Each jump costs a pass over the levels, and the largest come first.
    for _ in range(64):
        rise = _lasting_rise(level)
        at = int(np.argmax(rise))
        # Half an interval is the smallest jump that rounds to a lost sample.
        if rise[at] < 0.5:
            break
        left, right = level[max(at - _GROUPS, 0):at], level[at:at + _GROUPS]
        size = max(int(np.rint(np.median(right) - np.median(left))), 1)
        first = max((at - lead - 1) * _GROUP, 1)
        steps = np.diff(phase[first - 1:max((at - lead + 1) * _GROUP, first + 1)])
        row = first + int(np.argmax(steps))
        missing[row:] += size
        level[at:] -= size
    return missing


def _lasting_rise(level: Array) -> Array:
    """Return, for each place, by how much all of the next levels exceed those before."""
    windows, beyond = np.lib.stride_tricks.sliding_window_view, np.full(_GROUPS, np.inf)
    lowest = windows(np.concatenate([level, beyond]), _GROUPS).min(axis=1)
    highest = windows(np.concatenate([-beyond, level]), _GROUPS).max(axis=1)
    rise = np.full(len(level), -np.inf)
    rise[2:-2] = (lowest - highest)[2:-3]
    return rise


def longest_at_one_rate(stamps: Stamps) -> slice:
    """Find the longest part of increasing stamps in which the rate stays the same."""
    # Parts of 128 messages are compared by the median distance of messages 16 apart, which neither
    # a lost message nor a tick changes by 12 %.
    # Long compared with a batch, short compared with a recording.
    part = 128
    parts, whole = len(stamps) // part, slice(0, len(stamps))
    if parts < 4:
        return whole
    time = (stamps - stamps[0]).astype(np.float64)
    table = time[:parts * part].reshape(parts, part)
    pace = np.maximum(np.median(table[:, 16:] - table[:, :-16], axis=1) / 16, 1.0)
    # The median of three, so that a part with an outage is not a change of rate.
    smooth = np.median([np.append(pace[:1], pace[:-1]), pace, np.append(pace[1:], pace[-1:])],
                       axis=0)
    edges = [0]
    for at in range(1, parts):
        so_far = float(np.median(smooth[edges[-1]:at]))
        if np.all(np.abs(np.log(smooth[at:at + 2] / so_far)) > 0.12):
            edges.append(at)
    edges.append(parts)
    lengths = np.diff(edges)
    if len(lengths) == 1 or len(lengths) > 4:
        # Many changes mean that the stamps themselves are uneven.
        return whole
    at = int(np.argmax(lengths))
    last = len(stamps) if at + 2 == len(edges) else edges[at + 1] * part
    return slice(edges[at] * part, last)


def _median_interval(time: Array, apart: int) -> float:
    """Return the interval from the median distance of messages that are `apart` messages apart."""
    return float(np.median(time[apart:] - time[:-apart])) / apart


def group_phases(phase: Array) -> tuple[Array, float]:
    """Return the mean phase of every 64 messages, and the spread about it, in places."""
    # Neighbouring phases differ by less than half a place.
    circle = np.exp(2j * pi * phase)
    starts = np.arange(0, max(len(phase) - PHASE_GROUP // 2, 1), PHASE_GROUP)
    sums = np.add.reduceat(circle, starts)
    counts = np.diff(np.append(starts, len(phase)))
    mean = sums / counts
    turn = np.unwrap(np.angle(mean)) / (2 * pi)
    # The resultant length is 1 without jitter, 0 for an arbitrary phase.
    length = min(max(float(np.mean(np.abs(mean))), 1e-9), 1.0)
    return turn, sqrt(max(-2 * log(length), 0.0)) / (2 * pi)
