# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Fleets: units of one model as a population, the spread of every coefficient, and outliers."""

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from math import exp, log, sqrt
from statistics import median, median_high

from imu_allan.arrays import Array
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.random_effects import Effects, outliers, random_effects
from imu_allan.noise.terms import AXES, LASTING_TERMS, TERMS
from imu_allan.noise.uncertainty import error_of_mean, log_with_error, mean_is_known
from imu_allan.result import Result
from imu_allan.wording import natural
import numpy as np

TOLERANCE_SHARE = 0.95         # of the units ...
TOLERANCE_CONFIDENCE = 0.95
"""The usual 95/95 tolerance limit, which 95 % of all units keep, with 95 % confidence."""
MEAN = 'mean'
"""Key of the zero bias of a gyroscope, which is listed with the coefficients of a population."""

FEWEST_UNITS = 3
"""The 95 % interval of a spread reaches up to 32 times it with two units, 6 times with three."""
_SIGNED = ('rate_ramp', MEAN)
"""Signed quantities, which are normal about their mean; the others are lognormal."""


@dataclass(frozen=True)
class Trait:
    """
    Statistics of one quantity over all units, in SI units.

    Attributes
    ----------
    axis, key, unit : str
        Axis, quantity and its unit.
    units, observable : int
        Number of units that have the axis, and of units that show the quantity.
    median : float
        That of the distribution fitted to all units except outliers.
    between : float
        Standard deviation between units, without measurement error.
    between_ci95 : (float, float)
    measurement : float
        Standard error of the value of a typical unit.
    percentiles : mapping of int to float
        Percentiles of the population, by percent.
    tolerance : float or None
        Limit that 95 % of all units keep, with 95 % confidence; for a signed quantity, on its
        magnitude. None if too few units are known.

    """

    axis: str
    key: str
    unit: str
    units: int
    observable: int
    median: float
    between: float
    between_ci95: tuple[float, float]
    measurement: float
    percentiles: Mapping[int, float]
    tolerance: float | None


@dataclass(frozen=True)
class Outlier:
    """
    Reason why a unit is an outlier.

    Attributes
    ----------
    unit, axis : str
    key : str or None
        The quantity; None if the axis does not measure.
    fault : str or None
        'missing', or why the axis does not measure (`AxisResult.fault`).
    value, median, spreads : float or None
        The unit's value, the median of the others, and the signed distance from it in standard
        deviations between units (and of its own measurement). If the axes of a sensor are judged
        together, the distance is that of their mean.

    """

    unit: str
    axis: str
    key: str | None
    fault: str | None = None
    value: float | None = None
    median: float | None = None
    spreads: float | None = None


@dataclass(frozen=True)
class Population:
    """
    Units in natural order of their names, statistics of their quantities, and outliers.

    `unseen` holds axis and key of the coefficients that a filter needs and too few units show.
    Units that may be of different models, such as the topics of a robot, have no statistics.
    """

    units: tuple[str, ...]
    traits: tuple[Trait, ...]
    outliers: tuple[Outlier, ...]
    unseen: tuple[tuple[str, str], ...] = ()
    one_model: bool = True

    @property
    def outlier_units(self) -> list[str]:
        """Names of the outliers, each once."""
        named = {outlier.unit for outlier in self.outliers}
        return [unit for unit in self.units if unit in named]


@dataclass(frozen=True)
class _Sample:
    """One quantity on every unit that has the axis, on the scale on which it is normal."""

    values: dict[str, float]
    errors: dict[str, float]
    bounds: list[float]
    units: int


def population(results: Mapping[str, Result]) -> Population:
    """
    Describe a fleet by the quantities that at least three units show.

    Examples
    --------
    >>> population({}).units
    ()

    """
    units = tuple(sorted(results, key=natural))
    topics = {(result.source.files, result.source.topic) for result in results.values()}
    one_model = all(count == 1 for files, count in Counter(
        files for files, _ in topics).items() if files)
    found = [outlier for outlier in faults(results) if one_model or outlier.fault != 'missing']
    quantities = [(axis, key) for axis in AXES for key in (*TERMS, MEAN)
                  if one_model and (key != MEAN or axis.startswith('gyro'))]
    samples = {quantity: _sample(results, *quantity) for quantity in quantities}
    unseen = tuple((axis, key) for (axis, key), sample in samples.items()
                   if key in LASTING_TERMS and len(sample.values) < FEWEST_UNITS <= sample.units)
    samples = {quantity: sample for quantity, sample in samples.items()
               if len(sample.values) >= FEWEST_UNITS}
    # In a fleet without bad units, the probability of naming any is 0.01.
    alone = {quantity: [name for name, out in zip(sample.values, outliers(
        list(sample.values.values()), list(sample.errors.values()), 0.01 / len(samples)),
        strict=True) if out] for quantity, sample in samples.items()}
    together = list(_together(samples, {(name, key) for (_, key), names in alone.items()
                                        for name in names}))
    apart = {(outlier.unit, outlier.axis, outlier.key) for outlier in together}
    traits = []
    for (axis, key), sample in samples.items():
        # Outliers say nothing about the others.
        kept = [name for name in sample.values
                if name not in alone[axis, key] and (name, axis, key) not in apart]
        effects = random_effects([sample.values[name] for name in kept],
                                 [sample.errors[name] for name in kept], sample.bounds)
        traits.append(_trait(axis, key, sample, effects))
        found += [_outlier(name, axis, key, sample, effects) for name in alone[axis, key]]
    found += together
    found.sort(key=lambda outlier: (units.index(outlier.unit), -abs(outlier.spreads or 1e9)))
    return Population(units, tuple(traits), tuple(found), unseen, one_model)


def faults(results: Mapping[str, Result]) -> Iterator[Outlier]:
    """Yield the axes that do not measure, or are missing."""
    for axis in AXES:
        having = sum(axis in result.axes for result in results.values())
        for name, result in results.items():
            if axis not in result.axes:
                # An axis that most units lack is not missing in any.
                if 2 * having > len(results):
                    yield Outlier(name, axis, None, 'missing')
            elif (fault := result.axes[axis].fault) is not None:
                yield Outlier(name, axis, None, fault)
            elif not shows_anything(result):
                yield Outlier(name, axis, None, 'without a coefficient')


def shows_anything(result: Result) -> bool:
    """Return whether any axis shows a coefficient, or a bound of one."""
    return any(found.observable or found.upper95 is not None
               for axis in result.axes.values() for found in axis.coefficients.values())


def _sample(results: Mapping[str, Result], axis: str, key: str) -> _Sample:
    sample = _Sample({}, {}, [], sum(axis in result.axes for result in results.values()))
    for name, result in results.items():
        measured = result.axes.get(axis)
        if measured is None or measured.constant:
            continue
        if key == MEAN:
            if measured.mean is not None and mean_is_known(measured):
                sample.values[name] = measured.mean
                sample.errors[name] = error_of_mean(measured, result.rest_of(axis))
            continue
        found = measured.coefficients[key]
        if key in _SIGNED:
            if found.value is not None and found.ci95 is not None:
                low, high = found.ci95
                sample.values[name] = found.value
                sample.errors[name] = (high - low) / (2 * NORMAL95)
        elif (known := log_with_error(found)) is not None:
            sample.values[name], sample.errors[name] = known
        elif found.upper95:
            sample.bounds.append(log(found.upper95))
    if key == MEAN and sample.errors:
        # A unit whose drift is not visible still drifts like the others.
        typical = median(sample.errors.values())
        sample.errors.update({name: max(error, typical) for name, error in sample.errors.items()})
    return sample


def _trait(axis: str, key: str, sample: _Sample, effects: Effects) -> Trait:
    unit = AXES[axis].unit if key == MEAN else TERMS[key].unit(AXES[axis])
    in_si = _in_si(key)
    # The median, the middle half of the units, and the middle nine tenths.
    percentiles = {percent: effects.percentile(percent / 100) for percent in (5, 25, 50, 75, 95)}
    # A limit this many times above nearly all units says nothing: too few are known.
    most = 10.0
    if key in _SIGNED:
        # Two-sided limits: half of the share outside lies on each side.
        above = effects.tolerance((1 + TOLERANCE_SHARE) / 2, TOLERANCE_CONFIDENCE)
        limit = max(abs(above), abs(2 * effects.mean - above))
        scale, vague = 1.0, limit > most * max(map(abs, percentiles.values()))
    else:
        limit = effects.tolerance(TOLERANCE_SHARE, TOLERANCE_CONFIDENCE)
        scale, vague = exp(effects.mean), limit > percentiles[95] + log(most)
    low, high = effects.between_ci95
    return Trait(axis, key, unit, sample.units, len(sample.values), in_si(effects.mean),
                 scale * effects.between, (scale * low, scale * high),
                 scale * median_high(sample.errors.values()),
                 {percent: in_si(value) for percent, value in percentiles.items()},
                 None if vague else in_si(limit))


def _in_si(key: str) -> Callable[[float], float]:
    """Return what turns a value on the scale on which it is normal into one in SI units."""
    return float if key in _SIGNED else exp


def _together(samples: Mapping[tuple[str, str], _Sample], named: Collection[tuple[str, str | None]]
              ) -> Iterator[Outlier]:
    """
    Find units that are outliers on the axes of a sensor together, but not on a single one.

    A unit is compared with the others by the mean of its axes. The scatter of such a mean follows
    from the variance between units, pooled over the axes. It also depends on the correlation of a
    unit's axes in all quantities (their intraclass correlation).
    """
    from scipy.stats import t

    groups: list[tuple[list[str], str, list[str], Array, Array]] = []
    for sensor in dict.fromkeys(axis.partition('_')[0] for axis, _ in samples):
        for key in TERMS:
            axes = [axis for axis in AXES if axis.startswith(sensor) and (axis, key) in samples]
            units = [unit for unit in (samples[axes[0], key].values if axes else ())
                     if all(unit in samples[axis, key].values for axis in axes)
                     and (unit, key) not in named]
            # As for single axes: with four units, the reference for a unit is hardly known.
            if key not in _SIGNED and len(axes) > 1 and len(units) >= 5:
                own = [samples[axis, key] for axis in axes]
                groups.append((axes, key, units,
                               np.array([[one.values[unit] for one in own] for unit in units]),
                               np.array([[one.errors[unit] for one in own] for unit in units])))
    tests = sum(len(units) for _, _, units, _, _ in groups)
    everyone = dict.fromkeys(unit for _, _, units, _, _ in groups for unit in units)
    for unit in everyone:
        held = [(*group, group[2].index(unit)) for group in groups if unit in group[2]]
        rests = [np.delete(values, place, 0) for *_, values, _, place in held]
        spread = [max(float(np.sum((rest - rest.mean(0))**2)) / (rest.shape[1] * (len(rest) - 1)),
                      1e-300) for rest in rests]
        scaled = [(rest - rest.mean(0)) / sqrt(variance)
                  for rest, variance in zip(rests, spread, strict=True)]
        pairs = sum(float(np.sum(np.sum(z, 1)**2 - np.sum(z**2, 1))) / (
            z.shape[1] * (z.shape[1] - 1)) for z in scaled)
        correlation = min(max(pairs / sum(len(z) - 1 for z in scaled), 0.0), 1.0)
        for (axes, key, _, values, errors, place), rest, variance in zip(
                held, rests, spread, strict=True):
            count = len(axes)
            of_error = float(np.mean(errors[place]**2) - np.mean(np.delete(errors, place, 0)**2))
            scatter = sqrt((variance * (1 + 1 / len(rest)) + max(of_error, 0.0))
                           * count * (1 + (count - 1) * correlation))
            apart = values[place] - rest.mean(0)
            if abs(np.sum(np.sign(apart) * (np.abs(apart) > sqrt(variance)))) < count:
                # Unless all axes lie apart in one direction, each is judged by itself.
                continue
            away = float(np.sum(apart)) / scatter
            freedom = count * (len(rest) - 1) / (1 + (count - 1) * correlation**2)
            # Nominal probability of naming a good unit by all axes of a sensor together. The
            # actual one, 0.00 to 0.02, rises with the correlation of the axes of a unit.
            if 2 * t.sf(abs(away), freedom) < 0.005 / tests:
                for axis, value, others in zip(axes, values[place], rest.T, strict=True):
                    yield Outlier(unit, axis, key, None, exp(value), exp(median(others)), away)


def _outlier(name: str, axis: str, key: str, sample: _Sample, effects: Effects) -> Outlier:
    value, in_si = sample.values[name], _in_si(key)
    scatter = (effects.between**2 + sample.errors[name]**2)**0.5
    return Outlier(name, axis, key, None, in_si(value), in_si(effects.mean),
                   (value - effects.mean) / scatter if scatter > 0 else None)
