# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Samples that are not the sensor's: those of a second publisher, and single wild values."""

from collections.abc import Iterator
from math import pi
from typing import Literal

from imu_allan.timeline.clock import Bools, Floats
import numpy as np
from numpy.typing import NDArray

LARGEST = 1e9
"""In SI units: no IMU measures more, so it is not a number but bytes gone wrong."""
_BLOCK = 64
"""Samples of a transform: drift stays out of its upper half, where neighbours are compared."""
_ALTERNATING = 3.0
"""Power of what alternates over that of its neighbours: by chance it is 1.5 at most."""
_ALTERNATING_AXES = 3
"""Two sensors differ in most axes; mains hum at half the sample rate shows in one or two."""
_LASTING_LAGS = range(16, 25)
"""Messages after which random losses have mixed two sensors, and a vibration goes on."""
_SPIKE_SIGMAS = 10.0
"""Of the noise of a sample: far beyond chance, and what the remark says. A judgment."""
_ISOLATED = 3
"""Two wild samples within so many of each other may be errors, three are the motion of a knock."""


def alternates(samples: Floats) -> Literal['', 'means', 'noise']:
    """
    Return whether every second sample differs, and in what.

    Two sensors have different means, or one is noisier: either alternates from message to
    message, which is a line at exactly half the message rate. A vibration of that frequency
    alternates in its values, too, but not in their magnitude.

    Parameters
    ----------
    samples : ndarray, shape (n, 6)
        As they came; NaN where an axis is absent.

    """
    blocks = len(samples) // _BLOCK
    there = np.isfinite(samples).all(axis=0)
    # White noise passes on one axis in 0.2 %, on three in 1e-8; of 4 blocks in 2 % and 5e-6.
    if blocks < 8 or not there.any():
        return ''
    known = np.clip(samples[:blocks * _BLOCK, there], -LARGEST, LARGEST)
    enough = min(_ALTERNATING_AXES, (known.shape[1] + 1) // 2)
    # Interpolated axes are left out: nearly every second sample is the mean of its neighbours.
    bends = np.abs(np.diff(known, 2, axis=0))
    one, other = (np.quantile(bends[start::2], 0.9, axis=0) for start in (0, 1))
    own = np.minimum(one, other) >= 1e-3 * np.maximum(one, other)
    known = known.reshape(blocks, _BLOCK, -1)
    centred = known - known.mean(axis=1, keepdims=True)
    # An axis without noise has rounding errors to compare.
    own &= centred.std(axis=(0, 1)) > 1e-10 * np.maximum(np.abs(known).max(axis=(0, 1)), 1)
    found, own = _line_at_half(centred, own)
    means = np.count_nonzero(found) >= enough
    magnitude = np.abs(centred)
    found, _ = _line_at_half(magnitude, own)
    swing = np.abs(np.mean(magnitude[:, ::2] - magnitude[:, 1::2], axis=(0, 1)))
    found &= swing > 0.05 * magnitude.mean(axis=(0, 1))
    if np.count_nonzero(found) >= enough:
        return 'noise'
    return 'means' if means else ''


def _line_at_half(values: Floats, own: Bools) -> tuple[Bools, Bools]:
    """Find axes with a line at half the rate; and those without one at a quarter of it."""
    transform = np.fft.rfft(values, axis=1)
    power = np.mean(np.abs(transform) ** 2, axis=0)
    turns = transform[:, -1].real
    scatter = np.mean(turns ** 2, axis=0)
    level = np.median(power[_BLOCK // 4:-2], axis=0)
    # What alternates in a block correlates with the next one's: by 1 for a line, less where a gap
    # in every few blocks changes whose turn it is, not at all for a spectrum that rises.
    line = ((np.mean(turns[1:] * turns[:-1], axis=0) > 0.5 * scatter)
            & (power[-1] > _ALTERNATING * level))
    # Where no gap changes whose turn it is, all blocks together show a weak one by five standard
    # errors: of 4,096 messages means .16 of a standard deviation apart.
    line |= len(turns) * turns.mean(axis=0) ** 2 > 25.0 * np.maximum(turns.var(axis=0), level)
    # The magnitude of a vibration at a quarter of the rate alternates.
    quarter = power[_BLOCK // 4 - 1:_BLOCK // 4 + 2].max(axis=0)
    return line & own, own & (quarter <= _ALTERNATING * level)


def takes_turns(stamps: NDArray[np.int64], samples: Floats, interval_ns: float
                ) -> Literal['', 'half', 'apart']:
    """
    Return whether two sensors publish in turn, whatever is lost: its values say when it was sent.

    Messages fall on two sides by their values. Those of one sensor are whole intervals apart,
    those of two are not, and that goes on; of one sensor the side says nothing about the time.
    A vibration at half the rate has its sides half a period apart, as two sensors may.

    Parameters
    ----------
    stamps : ndarray of int64, shape (n,)
        In nanoseconds.
    samples : ndarray, shape (n, 6)
        As they came; NaN where an axis is absent.
    interval_ns : float
        As it was measured.

    """
    # To see whose turn it is takes no more.
    time = (stamps[:2048] - stamps[0]).astype(np.float64)
    if len(time) < 512:
        return ''
    samples = samples[:len(time)]
    known = np.clip(samples[:, np.isfinite(samples).all(axis=0)], -LARGEST, LARGEST)
    known = known - np.median(known, axis=0)
    known = known[:, known.std(axis=0) > 0]
    if not known.shape[1]:
        return ''
    known /= known.std(axis=0)
    # Where two sensors lose much, each one's interval is two of a grid, or three with one empty.
    taken = np.bincount(np.rint(time / interval_ns).astype(np.int64) % 3, minlength=3)
    grid = [2 * interval_ns, *([3 * interval_ns] if taken.min() < 0.1 * len(time) else [])]
    kind: Literal['half', 'apart'] = 'half'
    # Hum near half of the rate takes turns as well, and shows in one axis or two.
    for axes in range(min(_ALTERNATING_AXES, (known.shape[1] + 1) // 2)):
        # Side and turn of two sensors correlate by .2 to 1; of 289 random scenarios with one none
        # had .03, and anti-correlated noise with losses has up to .12. Beside the axes that show
        # it most there is less of it.
        found = _side_in_time(time, known, grid, 0.06 if axes else 0.2)
        if found is None:
            return ''
        side, period = found
        # The sides of a vibration are half a period apart, but for jitter.
        if _offset(time, side, period) < 0.4:
            kind = 'apart'
        part = np.maximum(np.abs(side @ known), np.abs(side @ (known**2 - 1)))
        known = np.delete(known, int(np.argmax(part)), axis=1)
    return kind


def _side_in_time(time: Floats, known: Floats, grid: list[float], least: float
                  ) -> tuple[Floats, float] | None:
    """Give the sides on which messages fall by their values, and the period of the sides."""
    if not known.shape[1]:
        return None
    steps = np.diff(time)
    for along in _apart(known):
        side = np.where(along > np.quantile(along, (0.1, 0.9)).mean(), 1.0, -1.0)
        one = steps[side[1:] == side[:-1]]
        periods = [float(np.median(time[2:] - time[:-2])), *grid]
        # Of fewer steps of one side the shortest give no interval: a judgment.
        if len(one) >= 32:
            # One of them, or none may be about as long.
            short = float(np.quantile(one, 0.2, method='lower'))
            shortest = float(one[np.abs(one - short) <= 0.3 * abs(short)].mean())
            periods += [shortest, 2 * shortest]
        side -= side.mean()
        products = np.concatenate([side[lag:] * side[:-lag] for lag in _LASTING_LAGS])
        for period in periods:
            # Jitter of a fifth of the interval leaves it off by as much.
            if period > 0 and any(_in_turn(time, period * (1 + off), products, least)
                                  for off in np.linspace(-0.014, 0.014, 5).tolist()):
                return side, period
    return None


def _offset(time: Floats, side: Floats, period: float) -> float:
    """How far apart the sides are in time, in periods: from 0 to a half."""
    change = np.sign(side[1:]) - np.sign(side[:-1])
    turn = np.exp(2j * pi / period * np.diff(time) * np.sign(change))[change != 0]
    return abs(float(np.angle(turn.sum()))) / (2 * pi)


def _in_turn(time: Floats, period: float, products: Floats, least: float) -> bool:
    """Whether messages of one side are whole periods apart, and the others are not."""
    phase = np.exp(2j * pi / period * time)
    whole = np.concatenate([(phase[lag:] * phase[:-lag].conj()).real for lag in _LASTING_LAGS])
    whole -= whole.mean()
    spread = float(np.mean(whole**2) * np.mean(products**2))
    return spread > 1e-6 and float(np.mean(whole * products)) > least * spread**0.5


def _apart(known: Floats) -> Iterator[Floats]:
    """Give what may part two sensors: directions in which neighbours differ, and loudness."""
    level, axes = np.linalg.eigh(known.T @ known / len(known))
    noisy = level > 1e-9 * level[-1]
    white = known @ (axes[:, noisy] / np.sqrt(level[noisy]))
    for beside in (1, 2):
        product = white[beside:].T @ white[:-beside]
        yield white @ np.linalg.eigh(product + product.T)[1][:, 0]
    yield np.sum(white**2, axis=1)


def noise_of_steps(steps: Floats) -> Floats:
    """
    Noise of a sample by the steps that are made: what stands still, or steps coarsely, has some.

    Parameters
    ----------
    steps : ndarray, shape (n, 6)
        From each sample to the next.

    Returns
    -------
    ndarray, shape (6,)
        Standard deviations; infinite for an axis that makes no step.

    """
    made = [np.abs(values[values != 0]) for values in steps.T]
    # Of an output in steps the median is known to half a step.
    usual = [float(np.median(values) + values.min() / 2) if len(values) else np.inf
             for values in made]
    sigma: Floats = 1.4826 / np.sqrt(2) * np.array(usual)
    return sigma


def may_be_wild(steps: Floats, sigma: Floats) -> bool:
    """Return by a quick look whether there is a step as large as that of a wild value."""
    # On a ramp, too, what lies so far from its neighbours is reached by a step of .7 of that.
    largest = 0.7 * _SPIKE_SIGMAS * sigma
    return bool((steps.max(axis=0) > largest).any() or (steps.min(axis=0) < -largest).any())


def spikes(samples: Floats, before: Floats | None) -> Bools:
    """
    Find single samples, and pairs, far from their neighbours.

    Parameters
    ----------
    samples : ndarray, shape (n, 6), n >= 3
        Of usual size; 0 where an axis is absent.
    before : ndarray, shape (6,), or None
        The sample before them.

    Returns
    -------
    ndarray of bool, shape (n,)
        None among others that are wild or louder than noise: that is a knock.

    """
    known = samples if before is None else np.concatenate([before[None], samples])
    sigma = noise_of_steps(np.diff(known, axis=0))
    # Mirrored, so that the first sample and the last are held against others.
    padded = np.pad(known, ((2, 2), (0, 0)), mode='reflect')
    median = np.median(np.lib.stride_tricks.sliding_window_view(padded, 5, axis=0), axis=-1)
    # A simulation without noise has the rounding errors of its sums.
    sigma = np.maximum(sigma, 1e-12 * np.abs(known).max(axis=0))
    found: Bools = np.any(np.abs(known - median) > _SPIKE_SIGMAS * sigma, axis=1)[-len(samples):]
    at = np.flatnonzero(found)
    beside = at[:, None] + np.arange(-_ISOLATED, _ISOLATED + 1)
    inside = (beside >= 0) & (beside < len(samples))
    beside = np.where(inside, beside, 0)
    others = (inside & ~found[beside])[:, :, None]
    count = np.maximum(others.sum(axis=1), 1)
    values = samples[beside] / sigma
    mean = np.sum(np.where(others, values, 0.0), axis=1) / count
    # The samples beside them are louder in one of 10,000 cases by chance, and nearly always in a
    # knock, which rings.
    loud = np.sum(np.where(others, values - mean[:, None], 0.0)**2, axis=1) > 2.3**2 * count
    found[at] = (np.sum(inside & found[beside], axis=1) <= 2) & ~loud.any(axis=1)
    return found
