# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Noise coefficients of one axis, in one module as each question waits for that before it.

The fit is a maximum of likelihood over the whole band. Where no sum of the five terms describes
the spectrum there, the sensor's or driver's low-pass is the usual reason: the finest octaves are
then left out one after the other, with a roll-off of the white noise towards the edge allowed for,
until what is left is described. A term is reported only where leaving it out would make the data
markedly less likely; otherwise there is an upper bound.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial

from imu_allan.noise.agreement import Agreement, agreements
from imu_allan.noise.band import effective_window, narrowed, plateau
from imu_allan.noise.correlated import (
    levels_off,
    Process,
    promising_time,
    with_gauss_markov,
    with_process_column,
)
from imu_allan.noise.courses import Calmed, has_walk, with_courses
from imu_allan.noise.doubt_of_flicker import with_doubt_of_flicker
from imu_allan.noise.doubt_of_process import with_doubt_of_process
from imu_allan.noise.doubt_of_walk import doubt_of_walk
from imu_allan.noise.groups import FLICKER, Groups, QUANTIZATION, Spectra, WALK, WHITE
from imu_allan.noise.intervals import (
    bent_density,
    Estimate,
    estimate,
    estimate_ramp,
    FEWEST_GROUPS,
)
from imu_allan.noise.likelihood import maximise, Solution
from imu_allan.noise.moving_mean import moving_mean, MovingMean
from imu_allan.noise.power_law import free_exponent, PowerLaw
from imu_allan.noise.stationarity import Steadiness
from imu_allan.noise.temperature import (
    beside_any_lag,
    Dependence,
    dependence,
    Following,
    follows,
)
from imu_allan.noise.temperature_course import JointTemperature, TemperatureCourse
from imu_allan.noise.terms import SLOW_TERMS
from imu_allan.noise.trends import JointSpectrum, RecordSpectrum
from imu_allan.noise.trial import banded, BENT_P, fit_band, Trial
from imu_allan.noise.unevenness import uneven_by
from imu_allan.noise.walk_in_parts import either, in_parts, is_walk, without_walk
from imu_allan.noise.warm_up import Warming
import numpy as np

COLUMNS = {'quantization_noise': QUANTIZATION, 'noise_density': WHITE,
           'bias_instability': FLICKER, 'rate_random_walk': WALK}

_DEEP = 1 / 12
"""Band edge in cycles per sample below which something else than a low-pass may be the reason."""


@dataclass(frozen=True)
class Fit:
    """
    What the spectrum of one axis says.

    Attributes
    ----------
    estimates : dict
        By key of `TERMS`.
    window_s : float or None
        Effective averaging window of a low-pass, where one was found.
    edge_hz : float or None
        Highest frequency that was used, where not all.
    p_value : float
        Of the half-octave residuals.
    misfit : float
        Largest relative misfit of a half-octave beyond its sampling error.
    acceptable : bool
    gauss_markov : Process or None
        An additional Gauss-Markov term.
    walk_unclear : bool
        Whether what looks like a random walk may as well be a course of the mean, or levels off.
    warmings : tuple of Warming
        The parts of a warm-up, the largest first, which the coefficients are given without.
    cycle_s : float or None
        Period of a slow cycle, which the coefficients are given without.
    temperature : Dependence or None
        How the mean depends on temperature, which the coefficients are given without.
    between : dict
        By key, the standard deviation between parts of the record beyond their errors, where the
        noise is not steady.
    trial : Trial or None
        The model and the band that the estimates are of.
    plain : Trial or None
        The same before it was asked what moves the mean.
    steady : Steadiness or None
        What parts of the record say of each other, without a warm-up.
    power_law : PowerLaw or None
        Slow noise with another exponent than flicker's, which then is an upper bound.
    plateau : float or None
        Noise density above the band that was fitted, where the noise levels out again.
    record : RecordSpectrum or JointSpectrum or None
        Beside what moves the mean: of which the trial is.

    """

    estimates: dict[str, Estimate]
    window_s: float | None
    edge_hz: float | None
    p_value: float
    misfit: float
    acceptable: bool
    gauss_markov: Process | None = None
    walk_unclear: bool = False
    warmings: tuple[Warming, ...] = ()
    cycle_s: float | None = None
    temperature: Dependence | None = None
    between: dict[str, float] = field(default_factory=dict)
    trial: Trial | None = None
    plain: Trial | None = None
    steady: Steadiness | None = None
    power_law: PowerLaw | None = None
    plateau: float | None = None
    record: RecordSpectrum | JointSpectrum | None = None

    @property
    def mean_moves(self) -> bool:
        """Whether the mean moves in a way that the noise terms leave out."""
        return (self.walk_unclear or self.mean_is_told
                or self.estimates['rate_ramp'].observable)

    @property
    def mean_is_told(self) -> bool:
        """Whether it is known what moves the mean, beside a ramp."""
        return self.temperature is not None or bool(self.warmings) or self.cycle_s is not None


def fit(groups: Groups, dt: float, start: Solution | None = None,
        record: RecordSpectrum | JointSpectrum | None = None, steady: Steadiness | None = None,
        parts: Spectra | None = None,
        temperature: TemperatureCourse | JointTemperature | None = None,
        calmed: Calmed | None = None,
        known_hz: Sequence[float] = ()) -> Fit:
    """
    Fit one axis: the terms of (1) in docs/statistics.md by the likelihood (7) of powers (6).

    Parameters
    ----------
    groups : Groups
        Spectrum of the axis, lines left out.
    dt : float
        Sample interval in seconds.
    start : Solution, optional
        Where to begin.
    record : RecordSpectrum or JointSpectrum, optional
        What the groups were made of. With it a random walk is reported only where it is no course
        of the mean.
    steady : Steadiness, optional
        Whether the noise is the same all over the record; where not, intervals are wider.
    parts : callable, optional
        Gives the spectra of parts of the record, for that case.
    temperature : TemperatureCourse or JointTemperature, optional
        Over the record. Where the mean depends on it, the coefficients are given without that.
    calmed : callable, optional
        Gives `steady` and `parts` anew, without a course of the mean that is no noise.
    known_hz : sequence of float, optional
        Frequencies of slow cycles that other axes have.

    Returns
    -------
    Fit

    Examples
    --------
    >>> from imu_allan.noise.bins import bins_of
    >>> from imu_allan.noise.estimator import Estimator
    >>> from imu_allan.noise.groups import grouped
    >>> estimator = Estimator()
    >>> estimator.update(np.random.default_rng(1).normal(scale=0.01, size=20_000))
    >>> pieces = estimator.finished().periodogram.pieces()
    >>> found = fit(grouped(bins_of(pieces, 0.01), 0), 0.01).estimates['noise_density']
    >>> bool(found.low < 1e-3 < found.high)
    True

    """
    found = _fit(groups, dt, start, record, steady, parts, calmed, known_hz)
    following: Following | None = None
    before: dict[str, float] = {}
    if record is not None and temperature is not None:
        following = _following(found, record, temperature, partial(
            _fit, dt=dt, start=start, steady=steady, parts=parts, calmed=calmed,
            known_hz=known_hz))
    if record is not None and following is not None:
        before = {key: one.value for key, one in found.estimates.items() if one.observable}
        record = record.beside(following.courses)
        groups = record.groups()
        found = _fit(groups, dt, start, record, steady, parts, calmed, known_hz)
    law = _power_law(found, groups, dt)
    if law is not None:
        beside = _fit(law.of(groups), dt, None, record and law.of_record(record), steady,
                      parts and law.of_parts(parts), calmed and law.of_calmed(calmed), known_hz,
                      doubt=False)
        found = replace(beside, estimates=law.bound(beside.estimates, groups), power_law=law)
    if following is not None and temperature is not None:
        assert found.trial is not None
        found = replace(found, temperature=dependence(found.trial, temperature, following,
                                                      before))
    walk = found.estimates['rate_random_walk']
    if temperature is not None and (walk.observable or (following is not None and law is None)):
        assert found.trial is not None
        assert found.record is not None
        left, flicker = beside_any_lag(found.trial, found.record, temperature, walk,
                                       found.estimates['bias_instability'])
        found = replace(
            found, walk_unclear=found.walk_unclear or walk.observable > left.observable,
            estimates={**found.estimates, 'rate_random_walk': left,
                       **({} if law is not None else {'bias_instability': flicker})})
    return _judged_above(found, groups)


def _following(found: Fit, record: RecordSpectrum | JointSpectrum,
               temperature: TemperatureCourse | JointTemperature, again: partial[Fit]
               ) -> Following | None:
    """Ask whether the mean follows the temperature, which other things that move it may hide."""
    assert found.plain is not None
    following = follows(found.plain, record, temperature)
    if following is None and found.record is not None and found.trial is not None:
        following = follows(found.trial, found.record, temperature)
    if following is None and (found.mean_moves or not found.acceptable
                              or found.estimates['rate_random_walk'].observable):
        # As well may it have hidden them.
        beside = record.beside(temperature.courses[:1])
        tried = again(beside.groups(), record=beside)
        assert tried.trial is not None
        assert tried.record is not None
        rest = tried.record.without(1)
        following = follows(with_courses(tried.trial, rest, []), rest, temperature)
    return following


def _judged_above(found: Fit, groups: Groups) -> Fit:
    """Do not take for a low-pass what levels out again above the band."""
    assert found.trial is not None
    levels, density = plateau(groups, found.trial), found.estimates['noise_density']
    if levels is None or not density.observable:
        return found
    level, lowest = levels
    density = replace(density, low=min(density.low, lowest), high=max(density.high, level),
                      upper=max(density.upper, level))
    return replace(found, window_s=None, acceptable=False, plateau=level,
                   estimates={**found.estimates, 'noise_density': density})


def _power_law(found: Fit, groups: Groups, dt: float) -> PowerLaw | None:
    """Ask for another exponent than flicker's before a band is cut, or a process believed."""
    trial = found.trial
    assert trial is not None
    helped = trial.bent or trial.p_value < BENT_P
    moves = bool(found.warmings) or found.cycle_s is not None
    if not helped and (moves or found.gauss_markov is None):
        return None
    return free_exponent(groups, dt, trial)


def _fit(groups: Groups, dt: float, start: Solution | None,
         record: RecordSpectrum | JointSpectrum | None, steady: Steadiness | None,
         parts: Spectra | None, calmed: Calmed | None, known_hz: Sequence[float],
         doubt: bool = True) -> Fit:
    """Fit one axis with the regressors that its record has, `doubt` about flicker's exponent."""
    plain, process = _chosen(groups, start, dt)
    trial = plain
    walks = seen = has_walk(plain)
    mean: MovingMean | None = None
    if record is not None:
        mean = moving_mean(plain, process, record, walks, partial(_chosen, dt=dt),
                           known_hz)
        trial, process, walks = mean.trial, mean.process, mean.walk
        if trial is not plain:
            seen = has_walk(trial)
        if (mean.warmings or mean.cycle is not None) and calmed is not None:
            steady, parts = calmed(mean.course)
    said: dict[str, Agreement] = {}
    own: list[Groups] = []
    changes = steady is not None and steady.differs
    if steady is not None and changes:
        trial = _capped(trial, steady)
    if steady is not None and parts is not None and (changes or seen):
        own = _in_band(trial, [steady.capped(part) if changes else part for part in parts()], dt,
                       process)
    if own:
        # The level of the slow noise changes on real sensors while that above stays the same.
        keys = ('noise_density', *SLOW_TERMS) if changes else SLOW_TERMS
        found = agreements(trial, own, [COLUMNS[key] for key in keys])
        said = {key: one for key, one in zip(keys, found, strict=True)
                if one.disagrees or (steady is not None and not steady.steady)}
    ramp = estimate_ramp(trial)
    walk_widening = _widening(said, 'rate_random_walk')
    walk = estimate(trial, WALK, walk_widening) if walk_widening > 1 else None
    if walk is not None:
        seen = walk.observable
    elif changes:
        seen = has_walk(trial)
    if mean is not None and seen:
        uneven = uneven_by(trial, mean.record, process.correlation_time_s if process else None)
        if uneven > walk_widening:
            walk_widening = uneven
            walk = estimate(trial, WALK, uneven)
        walks = walks and is_walk(trial, mean.record, own, even=uneven == 1,
                                  moves=ramp.observable or mean.moves)
    walk = walk or estimate(trial, WALK)
    levelling = doubt_of_walk(trial, dt, walk, walk_widening)
    walk = levelling.walk
    unclear = walk.observable and (levelling.is_likelier or not walks)
    if unclear:
        walk = replace(walk, observable=False)
    estimates = {key: walk if column == WALK else estimate(trial, column, _widening(said, key))
                 for key, column in COLUMNS.items()}
    wider = _widening(said, 'noise_density')
    density = bent_density(trial, dt, estimates['noise_density'], wider)
    estimates['noise_density'] = (with_doubt_of_flicker(trial, dt, density, wider) if doubt
                                  else density)
    flicker, wider = estimates['bias_instability'], _widening(said, 'bias_instability')
    if unclear and own:
        # What seems a walk takes from the flicker, wherever it comes from.
        flicker = either(flicker, estimate(without_walk(in_parts(trial, own)), FLICKER, wider))
    flicker = levelling.of_flicker(flicker, wider)
    estimates['bias_instability'] = (flicker if process is not None else
                                     with_doubt_of_process(trial, dt, flicker, wider))
    window = None
    if trial.bent:
        # At the edge of the band the first column no longer is quantization noise.
        window = effective_window(trial)
        estimates['quantization_noise'] = Estimate(False, 0.0, 0.0, 0.0, np.nan)
    estimates['rate_ramp'] = ramp
    return Fit(estimates, window, trial.edge_hz, trial.p_value, trial.misfit, trial.good, process,
               walk_unclear=unclear,
               warmings=mean.warmings if mean else (),
               cycle_s=mean.cycle.period_s if mean and mean.cycle else None,
               between={key: one.between for key, one in said.items()}, trial=trial,
               plain=plain, steady=steady, record=mean.record if mean else None)


def _capped(trial: Trial, steady: Steadiness) -> Trial:
    """Fit again with what noise that changes is worth."""
    groups = steady.capped(trial.groups)
    return replace(trial, groups=groups, solution=maximise(
        groups, trial.solution, fixed=trial.fixed, trend='restricted'))


def _in_band(trial: Trial, parts: Sequence[Groups], dt: float, process: Process | None
             ) -> list[Groups]:
    """Give parts of a record the band and the columns of all; none where one is too short."""
    groups = [banded(part, trial.edge_hz, trial.rolling) for part in parts]
    if process is not None:
        groups = [with_process_column(part, trial.rolling, dt, process.correlation_time_s)
                  for part in groups]
    fewest = min((len(part.frequency) for part in groups), default=0)
    return groups if fewest >= FEWEST_GROUPS else []


def _widening(said: dict[str, Agreement], key: str) -> float:
    return said[key].widening if key in said else 1.0


def _chosen(groups: Groups, start: Solution | None, dt: float
            ) -> tuple[Trial, Process | None]:
    """Choose the model: the terms over the whole band, over part of it, or with a process."""
    whole = fit_band(groups, None, start=start)
    if whole.p_value >= BENT_P:
        return _levelled_off(whole, dt)
    part = narrowed(groups, dt, whole)
    if part.described and (part.edge_hz or np.inf) * dt >= _DEEP:
        return _levelled_off(part, dt)
    # A band cut so deep, or in vain: something else than a low-pass may be the reason.
    correlated = with_gauss_markov(whole, dt)
    if correlated is not None:
        return correlated
    return (part, None) if part is whole else _levelled_off(part, dt)


def _levelled_off(trial: Trial, dt: float) -> tuple[Trial, Process | None]:
    """Add a process where the slow end of the spectrum asks for one, or a walk may be one."""
    if levels_off(trial) or promising_time(trial, dt) is not None:
        return with_gauss_markov(trial, dt) or (trial, None)
    return trial, None
