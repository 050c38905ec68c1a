# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the means of a run were from one power-on of the sensor to the next.

A run goes on over power-ons, and its coefficients are those of all its samples. The mean is
another thing: a gyroscope wakes up with another bias each time, and by how much is what a filter
must expect at its start.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

from imu_allan.characterization.finished import FinishedGroup, FinishedRecord
from imu_allan.characterization.mean import error_of_mean, mean_is_known
from imu_allan.noise.faults.saturation import is_cut_off
from imu_allan.noise.random_effects import random_effects
from imu_allan.result import AxisResult, TurnOnBias

MOST = 1000
"""Power-ons that are remembered, the latest ones: three years of a robot switched on daily."""
_SHORTEST_S = 10.0
"""Where the robot rests for less after a power-on, its mean is the noise's."""
_ABSURD = 2.0**62
"""More samples do not come in a life time, and no sensor's mean is so large."""


class End(NamedTuple):
    """
    An end of the values that an axis gave.

    Attributes
    ----------
    value : float
    samples : int
        How many stood there.

    """

    value: float
    samples: int


@dataclass(frozen=True)
class Mark:
    """
    Where a run stood when a power-on ended.

    Attributes
    ----------
    samples : int
        Used so far, of the axis that has most.
    means : mapping of str to float
        Of all of them, by axis.
    first : float
        The first of them, of the first axis: where a run that has begun on a moving robot has
        begun anew with its first stop, the first is another.
    ends : mapping of str to (End, End)
        By axis, how many of all samples stood at the lowest and at the highest value.
    cut_off : tuple of str
        The axes whose samples of this power-on were cut off at an end: their mean is none.
    samples_of : mapping of str to int
        By axis where it has fewer.

    """

    samples: int
    means: Mapping[str, float]
    first: float
    ends: Mapping[str, tuple[End, End]] = field(default_factory=dict)
    cut_off: tuple[str, ...] = ()
    samples_of: Mapping[str, int] = field(default_factory=dict)

    def used(self, name: str) -> int:
        """Return the samples of an axis."""
        return self.samples_of.get(name, self.samples)


@dataclass(frozen=True)
class PowerOns:
    """
    The power-ons of a run that have ended, in their order.

    Attributes
    ----------
    ended : tuple of Mark

    """

    ended: tuple[Mark, ...] = ()

    def one_more(self, record: FinishedRecord | None) -> 'PowerOns':
        """Return them when another begins behind what the run has so far."""
        if record is None:
            return self
        return PowerOns((*self.ended, self._mark(record))[-MOST:])

    def spread(self, axes: Mapping[str, AxisResult], record: FinishedRecord
               ) -> dict[str, TurnOnBias]:
        """Return the spread of the means of a run from power-on to power-on, by axis."""
        now = self._mark(record)
        found: dict[str, TurnOnBias] = {}
        for name, axis in axes.items():
            if not mean_is_known(axis):
                continue
            means = [(mean, samples / record.rate_hz) for mean, samples
                     in _of_each(name, (*self.ended, now))
                     if samples >= _SHORTEST_S * record.rate_hz]
            if len(means) > 1:
                found[name] = turn_on_bias(
                    [mean for mean, _ in means], axis, [duration_s for _, duration_s in means])
        return found

    def _mark(self, record: FinishedRecord) -> Mark:
        """Return where the run stands at the end of its latest power-on."""
        reference = record.group_of(record.names[0]).estimator.reference
        first = 0.0 if reference is None else float(reference[0])
        # Where the run has begun anew, or nothing is known of the ends, all samples count.
        before = self.ended[-1] if self.ended and self.ended[-1].first == first else None
        means: dict[str, float] = {}
        ends: dict[str, tuple[End, End]] = {}
        cut_off: list[str] = []
        for group in record.groups:
            estimator = group.estimator
            own_ends = _ends(group)
            ends |= own_ends
            means |= zip(group.names, estimator.mean.tolist(), strict=True)
            cut_off += [name for axis, name in enumerate(group.names)
                        if any(is_cut_off(estimator, axis, count, samples) for count, samples
                               in _own(name, own_ends[name], estimator.samples, before))]
        return Mark(record.samples, means, first, ends, tuple(cut_off), {
            name: group.estimator.samples for group in record.groups for name in group.names
            if group.estimator.samples < record.samples})

    def to_plain(self) -> list[dict[str, Any]]:
        """Return what JSON can hold of them."""
        return [asdict(mark) for mark in self.ended]

    @classmethod
    def from_plain(cls, plain: Sequence[Mapping[str, Any]]) -> 'PowerOns':
        """
        Go on from `to_plain`.

        Raises
        ------
        KeyError, TypeError, ValueError, AttributeError
            If it is none of it.

        """
        marks = [Mark(int(mark['samples']),
                      {str(name): float(mean) for name, mean in mark['means'].items()},
                      float(mark['first']),
                      {str(name): (End(float(low[0]), int(low[1])),
                                   End(float(high[0]), int(high[1])))
                       for name, (low, high) in mark['ends'].items()},
                      tuple(map(str, mark['cut_off'])),
                      {str(name): int(samples) for name, samples in mark['samples_of'].items()})
                 for mark in plain[-MOST:]]
        if not all(0 <= mark.used(name) <= mark.samples < _ABSURD and abs(mean) < _ABSURD
                   for mark in marks for name, mean in mark.means.items()):
            raise ValueError('a mean of a power-on is none')
        return cls(tuple(marks))


def turn_on_bias(means: Sequence[float], axis: AxisResult, lengths_s: Sequence[float]
                 ) -> TurnOnBias:
    """
    Return the spread of means from one power-on to the next.

    Parameters
    ----------
    means : sequence of float
        At least two.
    axis : AxisResult
        Whose means they are, and whose coefficients say how far a mean wanders in a record.
    lengths_s : sequence of float
        How long a record each is the mean of.

    Returns
    -------
    TurnOnBias
        What measuring explains of the scatter is taken off; of the lower end of the interval what
        a term may explain that does not show, too.

    Examples
    --------
    >>> from imu_allan import characterize, simulate
    >>> axis = characterize(simulate({'noise_density': 1.0}, 20_000, 100.0), 100.0)
    >>> turn_on_bias([0.1, -0.1, 0.05], axis, [25.0, 25.0, 25.0]).sigma
    0.0

    """
    found, careful = (
        random_effects(means, [error_of_mean(axis, length, at_most=at_most)
                               for length in lengths_s]) for at_most in (False, True))
    low, high = found.between_ci95
    return TurnOnBias(found.between, (min(low, careful.between_ci95[0]), high))


def _ends(group: FinishedGroup) -> dict[str, tuple[End, End]]:
    """Return the lowest and the highest value of every axis, about the first sample."""
    estimator = group.estimator
    return {name: (End(float(estimator.lowest[axis]), int(estimator.at_ends[0, axis])),
                   End(float(estimator.highest[axis]), int(estimator.at_ends[1, axis])))
            for axis, name in enumerate(group.names)}


def _own(name: str, ends: tuple[End, End], samples: int, before: Mark | None
         ) -> Iterator[tuple[int, int]]:
    """Give how many of how many samples since a mark stand at either end."""
    own = samples - (before.used(name) if before is not None else 0)
    for number, end in enumerate(ends):
        earlier = before.ends[name][number] if before and name in before.ends else End(0.0, 0)
        # At an end that has moved on no earlier sample stands.
        count = end.samples - (earlier.samples if earlier.value == end.value else 0)
        if own > 0:
            yield count, own


def _of_each(name: str, marks: tuple[Mark, ...]) -> Iterator[tuple[float, int]]:
    """Give mean and samples of each power-on that had the axis, from the means up to its end."""
    used, mean = 0, 0.0
    for mark in marks:
        if name in mark.means and mark.first == marks[-1].first and mark.used(name) > used:
            samples = mark.used(name)
            own = samples - used
            if name not in mark.cut_off:
                yield (mark.means[name] * samples - mean * used) / own, own
            used, mean = samples, mark.means[name]
