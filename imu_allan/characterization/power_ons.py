# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the means of a run were from one power-on of the sensor to the next.

A run goes on over power-ons, and its coefficients are those of all its samples. The mean is
another thing: a gyroscope wakes up with another bias each time, and by how much is what a filter
must expect at its start.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from imu_allan.characterization.mean import error_of_mean, mean_is_known
from imu_allan.characterization.taken import FinishedRecord
from imu_allan.noise.faults import is_cut_off
from imu_allan.noise.random_effects import random_effects
from imu_allan.result import AxisResult, TurnOnBias
from imu_allan.state import Record

MOST = 1000
"""Power-ons that are remembered, the latest ones: three years of a robot switched on daily."""
_ABSURD = 2.0**62
"""More samples do not come in a life time, and no sensor's mean is so large."""


@dataclass
class Mark(Record):
    """Where a run stood when a power-on ended."""

    samples: dict[str, int]    # used so far, by axis
    means: dict[str, float]    # of all of them
    # The first of them, of the first axis: where a run that has begun on a moving robot has begun
    # anew with its first stop, the first is another
    first: float
    # By axis the lowest and the highest value so far, each with how many samples stand there
    ends: dict[str, tuple[tuple[float, int], tuple[float, int]]]
    # The axes whose samples of this power-on were cut off at an end: their mean is none
    cut_off: list[str]

    def check(self) -> None:
        """Raise ValueError where a mean is none."""
        if self.samples.keys() != self.means.keys() or not all(
                0 <= samples < _ABSURD for samples in self.samples.values()) or not all(
                abs(mean) < _ABSURD for mean in self.means.values()):
            raise ValueError('a mean of a power-on is none')


def mark_of(record: FinishedRecord, ended: Sequence[Mark]) -> Mark:
    """Return where a run stands at the end of its latest power-on, behind those that ended."""
    reference = record.group_of(record.names[0]).estimator.reference
    mark = Mark({}, {}, 0.0 if reference is None else float(reference[0]), {}, [])
    # Where the run has begun anew all samples count.
    before = ended[-1] if ended and ended[-1].first == mark.first else None
    for group in record.groups:
        estimator, census = group.estimator, group.estimator.census
        mark.samples |= dict.fromkeys(group.names, estimator.samples)
        mark.means |= zip(group.names, estimator.mean.tolist(), strict=True)
        for axis, name in enumerate(group.names):
            mark.ends[name] = ends = (
                (float(census.lowest[axis]), int(census.at_ends[0, axis])),
                (float(census.highest[axis]), int(census.at_ends[1, axis])))
            own = estimator.samples - (before.samples.get(name, 0) if before else 0)
            # At an end that has moved on no earlier sample stands.
            earlier = dict(before.ends.get(name, ())) if before else {}
            if own and any(is_cut_off(estimator, axis, count - earlier.get(value, 0), own)
                           for value, count in ends):
                mark.cut_off.append(name)
    return mark


def spread_of_means(ended: Sequence[Mark], axes: Mapping[str, AxisResult],
                    record: FinishedRecord) -> dict[str, TurnOnBias]:
    """
    Return the spread of the means of a run from power-on to power-on, by axis.

    `ended`: of the power-ons before the latest, in their order. `axes`: what was fitted to all
    samples. `record`: all samples.
    """
    found: dict[str, TurnOnBias] = {}
    for name, axis in axes.items():
        # The mean of less than ten seconds at rest is that of the noise.
        means = [(mean, samples / record.rate_hz) for mean, samples
                 in _of_each(name, (*ended, mark_of(record, ended)))
                 if samples >= 10.0 * record.rate_hz]
        if len(means) > 1 and mean_is_known(axis):
            found[name] = turn_on_bias(
                [mean for mean, _ in means], axis, [duration_s for _, duration_s in means])
    return found


def turn_on_bias(means: Sequence[float], axis: AxisResult, lengths_s: Sequence[float]
                 ) -> TurnOnBias:
    """
    Return the spread of means from one power-on to the next.

    `means`: at least two. `axis`: whose means they are, and whose coefficients say how far a mean
    wanders in a record. `lengths_s`: how long a record each is the mean of. Returns: what
    measuring explains of the scatter is taken off; of the lower end of the interval what a term
    may explain that does not show, too.
    """
    found, careful = (
        random_effects(means, [error_of_mean(axis, length, at_most=at_most)
                               for length in lengths_s]) for at_most in (False, True))
    low, high = found.between_ci95
    return TurnOnBias(found.between, (min(low, careful.between_ci95[0]), high))


def _of_each(name: str, marks: Sequence[Mark]) -> Iterator[tuple[float, int]]:
    """Give mean and samples of each power-on that had the axis, from the means up to its end."""
    used, mean = 0, 0.0
    for mark in marks:
        samples = mark.samples.get(name, 0)
        if mark.first == marks[-1].first and samples > used:
            if name not in mark.cut_off:
                yield (mark.means[name] * samples - mean * used) / (samples - used), samples - used
            used, mean = samples, mark.means[name]
