# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The means of a run from one power-on of the sensor to the next, and their spread.

A run continues across power-ons, and its coefficients are those of all its samples. The mean is
different: a gyroscope starts with another bias each time. By how much is what a filter must expect
at its start.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from imu_allan.characterization.axis_groups import FinishedRecord
from imu_allan.noise.random_effects import random_effects
from imu_allan.noise.uncertainty import error_of_mean, mean_is_known
from imu_allan.result import AxisResult, TurnOnBias
from imu_allan.state import Record


@dataclass
class Mark(Record):
    """State of a run at the end of a power-on period."""

    samples: dict[str, int]    # samples used so far, by axis
    means: dict[str, float]    # mean of all of these
    # First sample on the first axis. It changes if a run restarts, as a run that began on a moving
    # robot does at the first stop.
    first: float


def mark_of(record: FinishedRecord) -> Mark:
    """Return the state of a run at the end of its latest power-on."""
    reference = record.group_of(record.names[0]).estimator.reference
    mark = Mark({}, {}, 0.0 if reference is None else float(reference[0]))
    for group in record.groups:
        mark.samples |= dict.fromkeys(group.names, group.estimator.samples)
        mark.means |= zip(group.names, group.estimator.mean.tolist(), strict=True)
    return mark


def spread_of_means(ended: Sequence[Mark], axes: Mapping[str, AxisResult],
                    record: FinishedRecord) -> dict[str, TurnOnBias]:
    """
    Return the spread of the means of a run from power-on to power-on, by axis.

    `ended`: states after the power-ons before the latest, in order. `axes`: fits to all samples.
    `record`: all samples.
    """
    marks = (*ended, mark_of(record))
    # The mean of less than ten seconds at rest is mostly noise.
    return turn_on_bias(axes, {name: [
        (mean, samples / record.rate_hz) for mean, samples in _of_each(name, marks)
        if samples >= 10.0 * record.rate_hz] for name in axes})


def turn_on_bias(axes: Mapping[str, AxisResult],
                 means: Mapping[str, Sequence[tuple[float, float]]]) -> dict[str, TurnOnBias]:
    """
    Return the spread of means from one power-on to the next, of axes with at least two.

    `axes`: their drift models give the error of a mean over a record. `means`: of each axis, each
    with the duration of its record in seconds. Returns: the scatter that measurement error does
    not explain; the lower end of the interval also allows for unobservable terms.
    """
    spread = {}
    for name, axis in axes.items():
        if len(means[name]) > 1 and mean_is_known(axis):
            values, lengths_s = zip(*means[name], strict=True)
            found, careful = (
                random_effects(values, [error_of_mean(axis, length_s, at_most=at_most)
                                        for length_s in lengths_s]) for at_most in (False, True))
            low, high = found.between_ci95
            spread[name] = TurnOnBias(found.between, (min(low, careful.between_ci95[0]), high))
    return spread


def _of_each(name: str, marks: Sequence[Mark]) -> Iterator[tuple[float, int]]:
    """Yield mean and number of samples of each power-on with the axis, from cumulative means."""
    used, mean = 0, 0.0
    for mark in marks:
        samples = mark.samples.get(name, 0)
        if mark.first == marks[-1].first and samples > used:
            yield (mark.means[name] * samples - mean * used) / (samples - used), samples - used
            used, mean = samples, mark.means[name]
