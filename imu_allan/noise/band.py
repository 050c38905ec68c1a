# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Which part of the band is fitted.

The low-pass of a sensor or driver, or noise that no term describes, bends the fast end of the
spectrum. The finest octaves are then left out one after the other, with a roll-off of the white
noise towards the edge allowed for, until what is left is described. What was left out is judged,
too: noise that is level again there has come through no low-pass.
"""

from collections.abc import Iterator, Sequence

from imu_allan.noise.groups import Groups, QUANTIZATION, WHITE
from imu_allan.noise.intervals import FEWEST_GROUPS, spread
from imu_allan.noise.trial import fit_band, start_in_band, Trial
import numpy as np

_OCTAVES = 10
"""Most that are left out: a judgment; too few bands to fit, or the lowest edge, come first."""
_LOWEST_EDGE_HZ = 0.5
"""Below, hardly any white noise is left to be fitted beside the slow terms."""
WORTH = 3.0
"""Most that the interval of the density may widen for an octave less of doubt about its bend."""
_LEVELS = range(3)
"""Half-octaves below the highest frequency. A low-pass that bends the band falls by half there."""
_LEVEL_ERROR = 0.05
"""Relative error of a half-octave, and half of what they may differ by and still be level."""
_OF_OUTPUT = 0.05
"""Share of the power below that rounding the output leaves of it: what is less is no finding."""


def narrowed(groups: Groups, dt: float, first: Trial) -> Trial:
    """
    Leave out the finest octaves until the rest is described.

    Leaving out more than needed costs precision, keeping too much a bias: of the bands tried, that
    one is returned whose noise density is best, both errors taken together.

    Parameters
    ----------
    groups : Groups
        Of the whole band.
    dt : float
        Sample interval in seconds.
    first : Trial
        The fit of the whole band, which does not describe it.

    Returns
    -------
    Trial

    """
    return _best([first, *_narrower(groups, dt, first)])


def _narrower(groups: Groups, dt: float, last: Trial) -> Iterator[Trial]:
    """Fit ever narrower bands, until one is described, and an octave further."""
    for octave, edge in enumerate(_edges(groups, dt)):
        band = edge if octave else None
        if last.described:
            # A roll-off of another shape passes unseen while it still bends the density by a
            # multiple of its error; an octave further down the bend is a quarter.
            yield fit_band(groups, band, rolling=True, start=start_in_band(last, True))
            return
        for rolling in (False, True) if octave else (True,):
            last = fit_band(groups, band, rolling, start=start_in_band(last, rolling))
            yield last
            if last.described:
                break


def _edges(groups: Groups, dt: float) -> Iterator[float]:
    """Highest frequencies of the bands, an octave apart; each leaves enough to be fitted."""
    for octave in range(_OCTAVES + 1):
        edge = 1 / (2 * 2**octave * dt)
        too_few = int((groups.frequency <= edge).sum()) < FEWEST_GROUPS
        if too_few or (octave and edge < _LOWEST_EDGE_HZ):
            return
        yield edge


def _best(tried: Sequence[Trial]) -> Trial:
    """Choose among the bands tried."""
    *_, before, last = (tried[0], *tried)
    if before.described:
        worth = error_of_density(last) < WORTH * error_of_density(before)
        return last if last.described and worth else before
    return min(tried, key=error_of_density)


def error_of_density(trial: Trial) -> float:
    """Relative error of the noise density: sampling, and what the worst misfit may bend it."""
    value = float(np.sqrt(trial.solution.theta[WHITE]))
    if value <= 0:
        return float('inf')
    sampling = spread(trial, trial.solution, WHITE) / value
    return float(np.hypot(sampling, 0 if trial.described else trial.misfit / 2))


def plateau(groups: Groups, trial: Trial) -> tuple[float, float] | None:
    """
    Tell where noise that was left out levels out again, which no low-pass does.

    Parameters
    ----------
    groups : Groups
        Of the whole band.
    trial : Trial
        Of the part of it that was fitted.

    Returns
    -------
    (float, float) or None
        Density of the plateau, in the unit of a noise density, and how low the white noise in it
        may lie: what bends the band may not have ended there. None where the noise goes on
        falling, or is what a rounded output adds behind a low-pass.

    """
    top, white = float(groups.frequency[-1]), float(trial.solution.theta[WHITE])
    lowest = top / 2 ** (len(_LEVELS) / 2)
    if trial.edge_hz is None or trial.edge_hz > lowest / np.sqrt(2) or white <= 0:
        return None
    density, levels, fewest = groups.power / groups.design[:, WHITE], [], np.inf
    for half_octave in _LEVELS:
        here = (groups.frequency <= top / 2 ** (half_octave / 2)) \
            & (groups.frequency > top / 2 ** ((half_octave + 1) / 2))
        fewest = min(fewest, float(groups.dof[here].sum()))
        if fewest < 2 / _LEVEL_ERROR**2:
            return None
        levels.append(float(np.average(density[here], weights=groups.dof[here])))
    level, still_falls = float(np.mean(levels)), max(levels) - min(levels)
    if still_falls >= 2 * _LEVEL_ERROR * min(levels) or level <= _OF_OUTPUT * white \
            or abs(level / white - 1) <= 3 * _LEVEL_ERROR:
        return None
    # Of a tail that goes with 1/f^2 a third of the fall between the levels is left at the last.
    lowest_white = min(levels) - still_falls - 2 * np.sqrt(2 / fewest) * min(levels)
    return float(np.sqrt(level)), float(np.sqrt(max(lowest_white, 0.0)))


def effective_window(trial: Trial) -> float:
    """Width of the boxcar that bends the white noise as much as the roll-off does."""
    edge = float(trial.edge_hz or trial.groups.frequency[-1])
    if not trial.rolling:
        # The filter lies above the edge: no more is known than that it is shorter.
        return 1 / (2 * edge)
    white, at_edge = trial.solution.theta[WHITE], trial.solution.theta[QUANTIZATION]
    if white <= 0 or at_edge >= white:
        return 1 / (2 * edge)
    return float(np.sqrt(3 * (1 - at_edge / white)) / (np.pi * edge))
