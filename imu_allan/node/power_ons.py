# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the means of a run were from one power-on of the robot to the next.

A run goes on over reboots, and its coefficients are those of all its samples. The mean is another
thing: a gyroscope wakes up with another bias each time, and by how much is what a filter must
expect at its start. A node that is started again on the same boot of its computer has not switched
the IMU off, and goes on with the power-on that it finds.
"""

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

from imu_allan.characterization import Characterization
from imu_allan.characterization.joint import turn_on_bias
from imu_allan.characterization.mean import mean_is_known
from imu_allan.characterization.stream import FinishedRecord
from imu_allan.result import Result, TurnOnBias

MOST = 1000
"""Power-ons that are remembered, the latest ones: three years of a robot switched on daily."""
_SHORTEST_S = 10.0
"""Where the robot rests for less after a power-on, its mean is the noise's."""
_ABSURD = 2.0**62
"""More samples do not come in a life time, and no sensor's mean is so large."""
_BOOT_ID = Path('/proc/sys/kernel/random/boot_id')


@dataclass(frozen=True)
class Mark:
    """
    Where a run stood when a power-on ended.

    Attributes
    ----------
    samples : int
        Used so far.
    means : mapping of str to float
        Of all of them, by axis.
    first : float
        The first of them, of the first axis: where a run that has begun on a moving robot has
        begun anew with its first stop, the first is another.

    """

    samples: int
    means: Mapping[str, float]
    first: float


@dataclass(frozen=True)
class PowerOns:
    """
    The power-ons of a run.

    Attributes
    ----------
    boot : str
        Of the computer, during the latest of them; empty where it is not known.
    ended : tuple of Mark
        The others, in their order.

    """

    boot: str = ''
    ended: tuple[Mark, ...] = ()

    def resumed(self, characterization: Characterization) -> 'PowerOns':
        """Return them as they are for a node that goes on with a run now."""
        boot = boot_id()
        if boot and boot == self.boot:
            return self
        record = characterization.record()
        ended = self.ended if record is None else (*self.ended, _mark(record))[-MOST:]
        return PowerOns(boot, ended)

    def entered(self, result: Result, characterization: Characterization) -> Result:
        """
        Return the result of a run with the spread of its means from power-on to power-on.

        Parameters
        ----------
        result : Result
            Of the run.
        characterization : Characterization
            What it was made of.

        """
        record = characterization.record() if self.ended else None
        if record is None:
            return result
        now = _mark(record)
        spread: dict[str, TurnOnBias] = {}
        for name, axis in result.axes.items():
            if not mean_is_known(axis):
                continue
            means = [(mean, samples / record.rate_hz) for mean, samples
                     in _of_each(name, (*self.ended, now))
                     if samples >= _SHORTEST_S * record.rate_hz]
            if len(means) > 1:
                spread[name] = turn_on_bias(
                    [mean for mean, _ in means], axis, [duration_s for _, duration_s in means])
        return replace(result, turn_on_bias=spread)

    def to_dict(self) -> dict[str, Any]:
        """Return what JSON can hold of them."""
        return asdict(self)

    @classmethod
    def from_dict(cls, document: Mapping[str, Any]) -> 'PowerOns':
        """
        Go on from `to_dict`.

        Raises
        ------
        KeyError, TypeError, ValueError, AttributeError
            If the document is none.

        """
        marks = [Mark(int(mark['samples']),
                      {str(name): float(mean) for name, mean in mark['means'].items()},
                      float(mark['first']))
                 for mark in document['ended'][-MOST:]]
        if not all(0 <= mark.samples < _ABSURD and abs(mean) < _ABSURD
                   for mark in marks for mean in mark.means.values()):
            raise ValueError('a mean of a power-on is none')
        return cls(str(document['boot']), tuple(marks))


def boot_id() -> str:
    """Return what tells one boot of this computer from another; empty where nothing does."""
    try:
        return _BOOT_ID.read_text().strip()
    except OSError:
        return ''


def _mark(record: FinishedRecord) -> Mark:
    first = record.estimator.reference
    return Mark(record.estimator.samples,
                dict(zip(record.names, record.estimator.mean.tolist(), strict=True)),
                0.0 if first is None else float(first[0]))


def _of_each(name: str, marks: tuple[Mark, ...]) -> Iterator[tuple[float, int]]:
    """Give mean and samples of each power-on that had the axis, from the means up to its end."""
    samples, mean = 0, 0.0
    for mark in marks:
        if name in mark.means and mark.first == marks[-1].first and mark.samples > samples:
            own = mark.samples - samples
            yield (mark.means[name] * mark.samples - mean * samples) / own, own
            samples, mean = mark.samples, mark.means[name]
