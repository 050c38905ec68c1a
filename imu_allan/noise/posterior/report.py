# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What is reported of one axis, read off the posterior over its noise models.

A term is reported where it is probably there; otherwise there is an upper bound. What moves the
mean, which kind the slow noise is and whether a filter bends the spectrum are read off the same
models.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import log

from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.groups import Groups
from imu_allan.noise.posterior.answer import answer, Estimate, Reported
from imu_allan.noise.posterior.parts import walk_in_parts
from imu_allan.noise.posterior.posterior import Posterior
from imu_allan.noise.stationarity import Steadiness
from imu_allan.noise.temperature_course import JointTemperature, TemperatureCourse
from imu_allan.noise.terms import SLOW_TERMS
from imu_allan.noise.trends import JointSpectrum, RecordSpectrum

_DESCRIBED = 0.01
"""Chi-square probability of the residuals above which they are chance."""
_TOLERATED_MISFIT = 0.05
"""A million samples reject a misfit of 1 %, which no user cares about; at 5 % some do."""
_WIDEST = 3.0
"""Ratio of the ends of an interval of the noise density beyond which no flat part was seen."""
_UNKNOWN_FLOOR = 0.05
"""What is left of a warm-up that is over, where no floor says when: three time constants."""


@dataclass(frozen=True)
class Process:
    """A first-order Gauss-Markov process with its 95 % intervals."""

    sigma: float
    correlation_time_s: float
    sigma_ci95: tuple[float, float]
    correlation_time_ci95: tuple[float, float]


@dataclass(frozen=True)
class PowerLaw:
    """Noise of the density ``amplitude**2/(2 pi f)**exponent``, two-sided."""

    exponent: float
    ci95: tuple[float, float]
    amplitude: float


@dataclass(frozen=True)
class Warming:
    """
    An exponential approach to a steady value.

    Attributes
    ----------
    amplitude, low, high : float
        At the beginning of the record, with its 95 % interval, in the unit of a sample; signed.
    time_constant_s, shortest_s, longest_s : float
        With its 95 % interval.

    """

    amplitude: float
    low: float
    high: float
    time_constant_s: float
    shortest_s: float = 0.0
    longest_s: float = float('inf')

    def steady_after_s(self, floor: float) -> float:
        """
        Seconds from the beginning until what is left is no more than a third of the flicker floor.

        Where the floor is not known (zero), until a twentieth of the amplitude is left.

        Examples
        --------
        >>> round(Warming(3.0, 2.9, 3.1, 100.0).steady_after_s(0.1))
        450

        """
        most = floor / 3 if floor > 0 else _UNKNOWN_FLOOR * abs(self.amplitude)
        return self.time_constant_s * max(log(max(abs(self.amplitude), 1e-300) / most), 0.0)


@dataclass(frozen=True)
class BiasStep:
    """A single step of the mean: when, in seconds of the record, and how far."""

    at_s: float
    size: float


@dataclass(frozen=True)
class Dependence:
    """
    Change of the mean with temperature.

    Attributes
    ----------
    per_kelvin, low, high : float
        Slope at the mean temperature of the record with its 95 % interval, unit of a sample.
    per_kelvin_squared : float or None
        Coefficient of the square of the distance from the mean temperature, where it shows.
    lowest_c, highest_c : float
        The range it was seen over.
    lag_s : float or None
        Time constant by which the thermometer follows the sensor, where it shows; negative where
        the sensor follows the thermometer.
    lag_ci95 : (float, float) or None

    """

    per_kelvin: float
    low: float
    high: float
    per_kelvin_squared: float | None
    lowest_c: float
    highest_c: float
    lag_s: float | None = None
    lag_ci95: tuple[float, float] | None = None


@dataclass(frozen=True)
class AxisReport:
    """
    What is reported of one axis.

    Attributes
    ----------
    estimates : dict
        By key of `TERMS`.
    p_value : float
        Of the half-octave residuals.
    misfit : float
        Largest relative misfit of a half-octave beyond its sampling error.
    window_s : float or None
        Effective averaging window of a low-pass, where there is one.
    edge_hz : float or None
        Highest frequency that a model describes, where not all.
    high_pass_hz : float or None
        Corner of a filter that takes out the bias.
    gauss_markov : Process or None
    power_law : PowerLaw or None
        Slow noise with another exponent than flicker's, which then is an upper bound.
    walk_unclear : bool
        Whether there is slow noise or drift of which it is not known what it is.
    warmings : tuple of Warming
    cycle_s : float or None
        Period of a slow cycle.
    bias_step : BiasStep or None
    temperature : Dependence or None
    between : dict
        By key, the standard deviation between parts of the record beyond their errors.
    steady : Steadiness or None
        What parts of the record say of each other, without what moves the mean.
    posterior : Posterior or None
        What all of this was read off.
    record : RecordSpectrum or JointSpectrum or None
        That it was fitted to.

    """

    estimates: dict[str, Estimate]
    p_value: float
    misfit: float
    window_s: float | None = None
    edge_hz: float | None = None
    high_pass_hz: float | None = None
    gauss_markov: Process | None = None
    power_law: PowerLaw | None = None
    walk_unclear: bool = False
    warmings: tuple[Warming, ...] = ()
    cycle_s: float | None = None
    bias_step: BiasStep | None = None
    temperature: Dependence | None = None
    between: Mapping[str, float] = field(default_factory=dict)
    steady: Steadiness | None = None
    posterior: Posterior | None = None
    record: RecordSpectrum | JointSpectrum | None = None

    @property
    def acceptable(self) -> bool:
        """Whether the residuals are small enough for a user not to care."""
        return self.p_value > _DESCRIBED or self.misfit <= _TOLERATED_MISFIT

    @property
    def mean_moves(self) -> bool:
        """Whether the mean moves in a way that the noise terms leave out."""
        return (self.walk_unclear or self.mean_is_told
                or self.estimates['rate_ramp'].observable)

    @property
    def mean_is_told(self) -> bool:
        """Whether it is known what moves the mean, beside a ramp."""
        return (self.temperature is not None or bool(self.warmings) or self.cycle_s is not None
                or self.bias_step is not None)


def reported(posterior: Posterior, dt: float, parts: Callable[[], Sequence[Groups]] | None = None,
             temperature: TemperatureCourse | JointTemperature | None = None) -> AxisReport:
    """
    Report an axis.

    Parameters
    ----------
    posterior : Posterior
        Of one axis.
    dt : float
        Sample interval in seconds.
    parts : callable, optional
        Gives the spectra of parts of the record, in which a random walk has to show as well.
    temperature : TemperatureCourse or JointTemperature, optional
        That courses of the mean were made of.

    Returns
    -------
    AxisReport

    """
    said = answer(posterior, dt)
    terms = {**said.terms, 'rate_ramp': said.ramp}
    walk, density = terms['rate_random_walk'], terms['noise_density']
    if walk.observable and parts is not None:
        own = parts()
        if own and walk_in_parts(posterior, own, dt).min() < 0:
            terms['rate_random_walk'] = replace(walk, observable=False)
    if density.high > _WIDEST * density.low:
        terms['noise_density'] = replace(density, observable=False)
    if said.exponent.observable:
        terms['bias_instability'] = replace(terms['bias_instability'], observable=False)
    if said.high_pass_hz.observable:
        # What such a filter leaves of the slow noise is for nobody to use.
        terms |= {key: replace(terms[key], observable=False) for key in SLOW_TERMS}
    told = (said.sigma.observable or said.exponent.observable or bool(said.courses)
            or said.ramp.observable or terms['rate_random_walk'].observable)
    bends = said.low_pass > 0.5
    change = posterior.change.typical
    courses = {one.kind.key: one for one in said.courses}
    return AxisReport(
        terms, posterior.p_value, posterior.misfit,
        said.window_s if bends else None, said.edge_hz,
        said.high_pass_hz.value if said.high_pass_hz.observable else None,
        Process(said.sigma.value, said.correlation_time_s.value,
                (said.sigma.low, said.sigma.high),
                (said.correlation_time_s.low, said.correlation_time_s.high))
        if said.sigma.observable else None,
        PowerLaw(said.exponent.value, (said.exponent.low, said.exponent.high), said.law.value)
        if said.exponent.observable else None,
        walk_unclear=(not told and said.drift > 0.8) or (
            walk.observable and not terms['rate_random_walk'].observable),
        warmings=tuple(_warming(one) for one in said.courses if one.kind.key == 'warm_up'),
        cycle_s=1 / courses['slow_cycle'].value if 'slow_cycle' in courses else None,
        bias_step=BiasStep(courses['bias_step'].value, courses['bias_step'].columns[0][0])
        if 'bias_step' in courses else None,
        temperature=_dependence(courses['temperature'], temperature)
        if temperature is not None and 'temperature' in courses else None,
        between={'noise_density': density.value * change / 2} if change > 0 else {},
        posterior=posterior)


def _warming(course: Reported) -> Warming:
    [(size, error)] = course.columns
    half = NORMAL95 * error
    return Warming(size, size - half, size + half, course.value, course.low, course.high)


def _dependence(course: Reported, temperature: TemperatureCourse | JointTemperature) -> Dependence:
    size, error = course.columns[0]
    half = NORMAL95 * error
    lags = not course.low <= 0 <= course.high
    return Dependence(
        size, size - half, size + half,
        course.columns[1][0] if len(course.columns) > 1 else None,
        temperature.lowest, temperature.highest,
        course.value if lags else None, (course.low, course.high) if lags else None)
