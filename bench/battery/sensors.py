# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A simulated sensor: what its noise is, what it comes through, and how its mean moves."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

from battery import simulated
import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

Array = NDArray[np.float64]
Trend = Callable[[Array], Array]

Q, N, B, K = ('quantization_noise', 'noise_density', 'bias_instability', 'rate_random_walk')
TERMS = (Q, N, B, K)


@dataclass(frozen=True)
class Filter:
    """
    A digital filter that all noise has come through.

    Attributes
    ----------
    numerator, denominator : sequence of float
    times : int
        How many times as fast as the samples it runs; so many of its values are one sample's mean.
    settling_s : float
        What it takes to forget its start.

    """

    numerator: Sequence[float] | Array
    denominator: Sequence[float] | Array = (1.0,)
    times: int = 1
    settling_s: float = 20.0


@dataclass(frozen=True)
class Sensor:
    """
    What a record is drawn of.

    Attributes
    ----------
    rate_hz, duration_s : float
    terms : mapping
        SI coefficients by key, those before a filter.
    process : (float, float), optional
        Standard deviation and correlation time of a Gauss-Markov process.
    law : (float, float), optional
        Amplitude and exponent a of slow noise of density amplitude^2 (2 pi f)^-a.
    through : Filter, optional
    mean : callable, optional
        Of time in seconds.
    louder : float, optional
        How many times as strong the noise is in the second half; its mean power stays.

    """

    rate_hz: float
    duration_s: float
    terms: Mapping[str, float] = field(default_factory=dict)
    process: tuple[float, float] | None = None
    law: tuple[float, float] | None = None
    through: Filter | None = None
    mean: Trend | None = None
    louder: float = 1.0

    @property
    def samples(self) -> int:
        """Length of a record."""
        return round(self.rate_hz * self.duration_s)

    def record(self, rng: np.random.Generator) -> Array:
        """Draw a record."""
        if self.through is None:
            found = self._noise(self.samples, self.rate_hz, rng)
        else:
            times, rate_hz = self.through.times, self.through.times * self.rate_hz
            settling = round(self.through.settling_s * rate_hz)
            noise = self._noise(settling + times * self.samples, rate_hz, rng)
            noise = lfilter(self.through.numerator, self.through.denominator, noise)
            found = noise[settling:].reshape(self.samples, times).mean(axis=1)
        if self.louder != 1:
            found *= np.sqrt(2 / (1 + self.louder**2))
            found[len(found) // 2:] *= self.louder
        if self.mean is not None:
            middle = np.arange(self.samples, dtype=np.float64) + 0.5
            found += self.mean(middle / self.rate_hz)
        return found

    def _noise(self, samples: int, rate_hz: float, rng: np.random.Generator) -> Array:
        """Draw noise; every part has its own stream, so that leaving out one leaves the others."""
        streams = dict(zip((*TERMS, 'process', 'law'), rng.spawn(6), strict=True))
        drawn = {Q: (simulated.quantization, rate_hz), N: (simulated.white, rate_hz**0.5),
                 K: (simulated.walk, rate_hz**-0.5)}
        total = np.zeros(samples)
        for key, (draw, size) in drawn.items():
            if key in self.terms:
                total += self.terms[key] * size * draw(samples, streams[key])
        if B in self.terms:
            total += self.terms[B] * simulated.power_law(samples, 1.0, streams[B])
        if self.law is not None:
            amplitude, exponent = self.law
            total += (amplitude * rate_hz**((1 - exponent) / 2)
                      * simulated.power_law(samples, exponent, streams['law']))
        if self.process is not None:
            sigma, time_s = self.process
            total += sigma * simulated.process(samples, time_s * rate_hz, streams['process'])
        return total
