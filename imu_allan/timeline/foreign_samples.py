# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Samples that are not the sensor's own: those of a second publisher, and isolated outliers."""

from imu_allan.arrays import Array, Bools
import numpy as np

LARGEST = 1e9
"""Larger values, in SI units, are corrupt data, as no IMU measures them."""
_BLOCK = 64
"""Samples per transform: drift stays out of its upper half, where neighbours are compared."""


def alternates(samples: Array) -> bool:
    """Return whether every second sample differs in mean or in noise."""
    # Two sensors differ in mean or in noise. Either alternates from message to message, which is a
    # line at exactly half the message rate.
    blocks = len(samples) // _BLOCK
    there = np.isfinite(samples).all(axis=0)
    # White noise passes on one axis in 0.2 % of cases, on three in 1e-8; with 4 blocks in 2 % and
    # 5e-6.
    if blocks < 8 or not there.any():
        return False
    known = np.clip(samples[:blocks * _BLOCK, there], -LARGEST, LARGEST)
    # Two sensors differ in most axes, hum is in one or two.
    enough = min(3, (known.shape[1] + 1) // 2)
    # Interpolated axes are left out: there, nearly every second sample is the mean of its
    # neighbours.
    bends = np.abs(np.diff(known, 2, axis=0))
    one, other = (np.quantile(bends[start::2], 0.9, axis=0) for start in (0, 1))
    own = np.minimum(one, other) >= 1e-3 * np.maximum(one, other)
    known = known.reshape(blocks, _BLOCK, -1)
    centred = known - np.median(known, axis=1, keepdims=True)
    # A second sensor sends half of the samples. If one in every hundred is an outlier, these
    # alternate, too, and are replaced by their neighbours.
    usual = np.diff(np.quantile(centred, (0.2, 0.8), axis=(0, 1)), axis=0)[0]
    far = (np.abs(centred) > 4 * usual) & (usual > 0)
    centred = np.where(far, np.roll(centred, 1, axis=1), centred)
    # Without noise only rounding errors would be compared.
    own &= centred.std(axis=(0, 1)) > 1e-10 * np.maximum(np.abs(known).max(axis=(0, 1)), 1)
    found, own = _line_at_half(centred, own)
    if np.count_nonzero(found) >= enough:
        return True
    magnitude = np.abs(centred)
    found, _ = _line_at_half(magnitude, own)
    swing = np.abs(np.mean(magnitude[:, ::2] - magnitude[:, 1::2], axis=(0, 1)))
    found &= swing > 0.05 * magnitude.mean(axis=(0, 1))
    return bool(np.count_nonzero(found) >= enough)


def _line_at_half(values: Array, own: Bools) -> tuple[Bools, Bools]:
    """Find the axes with a line at half the rate, and those without one at a quarter of it."""
    transform = np.fft.rfft(values, axis=1)
    power = np.mean(np.abs(transform) ** 2, axis=0)
    turns = transform[:, -1].real
    scatter = np.mean(turns ** 2, axis=0)
    level = np.median(power[_BLOCK // 4:-2], axis=0)
    threshold = 3.0   # by chance the ratio to the neighbours is 1.5 at most
    # The alternating parts of successive blocks correlate: by 1 for a line, less if occasional
    # gaps swap the two sensors, and not at all for a rising spectrum.
    line = ((np.mean(turns[1:] * turns[:-1], axis=0) > 0.5 * scatter)
            & (power[-1] > threshold * level))
    # Without such gaps, all blocks together show a weak line at five standard errors: in 4,096
    # messages, means 0.16 standard deviations apart.
    line |= len(turns) * turns.mean(axis=0) ** 2 > 25.0 * np.maximum(turns.var(axis=0), level)
    # A vibration at a quarter of the rate has an alternating magnitude.
    quarter = power[_BLOCK // 4 - 1:_BLOCK // 4 + 2].max(axis=0)
    return line & own, own & (quarter <= threshold * level)


def noise_of_steps(steps: Array) -> Array:
    """Estimate the noise of each axis from its steps; infinite if all of them are zero."""
    # Zero steps do not count, so that held or coarse outputs have noise.
    made = [np.abs(values[values != 0]) for values in steps.T]
    # For a quantized output, the median is known to half a step.
    usual = [float(np.median(values) + values.min() / 2) if len(values) else np.inf
             for values in made]
    sigma: Array = 1.4826 / np.sqrt(2) * np.array(usual)
    return sigma


def may_have_outlier(steps: Array, sigma: Array) -> bool:
    """Return quickly whether any step is large enough to lead to an outlier."""
    # Even on a ramp, an outlier is reached by a step of at least 0.7 of its distance.
    largest = 7.0 * sigma
    return bool((steps.max(axis=0) > largest).any() or (steps.min(axis=0) < -largest).any())


def spikes(samples: Array, before: Array | None, noise: Array) -> Bools:
    """Find single samples and pairs that lie far from their neighbours."""
    # They are not outliers where nearby samples are some, too, or louder than noise: that is a
    # knock.
    known = samples if before is None else np.concatenate([before[None], samples])
    steps = np.diff(known, axis=0)
    # A noise-free simulation still has rounding errors.
    sigma = np.maximum(noise, 1e-12 * np.abs(known).max(axis=0))
    farthest = 10.0 * sigma   # which the finding quotes; chosen by judgment
    # Only a larger step leads that far away from the median of five samples.
    large = np.flatnonzero((np.abs(steps) > farthest).any(axis=1))
    near = np.unique([large, large + 1])
    # Reflected at both ends, so that the first and last samples are compared with others.
    padded = np.pad(known, ((2, 2), (0, 0)), mode='reflect')
    median = np.median(padded[near[:, None] + np.arange(5)], axis=1)
    found = np.zeros(len(known), dtype=bool)
    found[near] = np.any(np.abs(known[near] - median) > farthest, axis=1)
    found = found[-len(samples):]
    at = np.flatnonzero(found)
    reach = 3   # within this distance two outliers may be errors, while three are a knock
    beside = at[:, None] + np.arange(-reach, reach + 1)
    inside = (beside >= 0) & (beside < len(samples))
    beside = np.where(inside, beside, 0)
    others = (inside & ~found[beside])[:, :, None]
    count = np.maximum(others.sum(axis=1), 1)
    values = samples[beside] / sigma
    mean = np.sum(np.where(others, values, 0.0), axis=1) / count
    # The samples around an outlier are this loud in one of 10,000 cases by chance, but nearly
    # always in a knock, which rings.
    loud = np.sum(np.where(others, values - mean[:, None], 0.0)**2, axis=1) > 2.3**2 * count
    found[at] = (np.sum(inside & found[beside], axis=1) <= 2) & ~loud.any(axis=1)
    return found
