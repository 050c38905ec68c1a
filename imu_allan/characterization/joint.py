# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Several recordings of one IMU as one result, in one module because every step compares the parts.

The coefficients are those of the joint likelihood. Beside them stands what one recording cannot
show: how much the mean differs from one power-on to the next, and the coefficients between
recordings beyond their errors. What cannot be one series of measurements (another rate, frame,
axes or filter) is refused; recordings that contradict each other are reported.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from math import exp, log, sqrt

from imu_allan.characterization.axis import axis_results, widened
from imu_allan.characterization.exponents import (
    exponents_differ,
    OF_THE_COMMON_FIT,
    remark_on_exponents,
    with_own_exponents,
)
from imu_allan.characterization.findings import length_remarks, tone_findings, with_start
from imu_allan.characterization.mean import mean_is_known
from imu_allan.characterization.power_ons import turn_on_bias
from imu_allan.characterization.stream import Characterization
from imu_allan.characterization.taken import FinishedRecord
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding, finding
from imu_allan.noise import chi_square
from imu_allan.noise.axis_fit import AxisFit
from imu_allan.noise.chi_square import NORMAL95
from imu_allan.noise.joint import joint_fit
from imu_allan.noise.random_effects import q_statistic, random_effects
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.terms import AXES, LASTING_TERMS, TERMS
from imu_allan.result import (
    AxisResult,
    Coefficient,
    RecordingPart,
    Result,
    Source,
    Span,
    Stationarity,
    Timeline,
    TurnOnBias,
)
import numpy as np

_SAME_RATE = 0.005
"""Relative difference of rates that a clock may have; a setting differs by more."""
_SAME_BAND = 0.2
"""Relative difference at the fast end of the spectra beyond error: another filter, not noise."""
_CONTRADICTION = 1e-3
"""Probability below which the spread of a coefficient is no chance, over all that are compared."""


@dataclass(frozen=True)
class _Part:
    """One recording with its own result."""

    path: str
    record: FinishedRecord
    result: Result
    fits: Mapping[str, AxisFit | None]


def joint_result(recordings: Sequence[Characterization],
                 remarks: Sequence[Sequence[Finding]] = ()) -> Result:
    """
    Characterize one IMU from several recordings.

    Parameters
    ----------
    recordings : sequence of Characterization
        At least two, each of a whole recording.
    remarks : sequence of sequence of Finding, optional
        Findings of the front door about each.

    Returns
    -------
    Result
        With `recordings` and `turn_on_bias`.

    Raises
    ------
    ImuAllanError
        If there are fewer than two, one of them holds nothing usable, or they cannot be recordings
        of one IMU in one setting.

    """
    if len(recordings) < 2:
        raise ImuAllanError('a joint result needs at least two recordings')
    parts = []
    for recording, own in zip(recordings, remarks or [()] * len(recordings), strict=True):
        record = recording.record()
        if record is None:
            raise ImuAllanError(f'{recording.path}: holds no usable sample; leave it out')
        parts.append(_Part(str(recording.path), record, *recording.fitted(own)))
    _agree(parts)
    first = parts[0].record
    rate = float(np.average([part.record.rate_hz for part in parts],
                            weights=[part.record.samples for part in parts]))
    fitted = _axis_results(parts, rate)
    for name, (axis, own) in fitted.items():
        singles = {part.path: part.result.axes[name] for part in parts
                   if part.result.axes[name].spectrum is not None}
        if exponents_differ(axis, list(singles.values())):
            fitted[name] = with_own_exponents(axis, list(singles.values())), [
                remark_on_exponents(singles),
                *(remark for remark in own if remark.code not in OF_THE_COMMON_FIT)]
    error = np.max([part.record.summary.density_error for part in parts], axis=0).tolist()
    axes = {name: widened(replace(_with_faults(_with_spread(axis, name, parts), name, parts),
                                  stationarity=_stationarity(name, parts)), *error)
            for name, (axis, _) in fitted.items()}
    found = [remark.of(name) for name, (_, own) in fitted.items() for remark in own]
    timeline = _timeline([part.result.timeline for part in parts], rate)
    summary = replace(first.summary, timeline=timeline)
    source = parts[0].result.source
    paths = [part.path for part in parts]
    spread = _turn_on_bias(parts, axes)
    return Result(
        parts[0].result.imu_allan_version,
        Source('recording', ' + '.join(paths), source.topic, source.frame_id, source.start_time,
               source.clock),
        timeline, axes,
        (*_contradictions(parts, axes), *_turn_on_remarks(spread, axes), *_of_each(parts, axes),
         *with_start(found, axes, min(part.result.timeline.duration_s for part in parts),
                     several=True),
         *tone_findings(axes),
         *length_remarks(axes, summary)),
        tuple(RecordingPart(part.path, part.result.source.start_time,
                            part.result.timeline.duration_s, _means(part)) for part in parts),
        spread)


# ------------------------------------------------------------------------------ what must be equal

def _agree(parts: Sequence[_Part]) -> None:
    first = parts[0]
    for part in parts[1:]:
        rate, other = first.record.rate_hz, part.record.rate_hz
        if abs(other / rate - 1) > _SAME_RATE:
            raise ImuAllanError(f'{part.path}: sampled at {other:.6g} Hz, {first.path} at '
                                f'{rate:.6g} Hz; analyze recordings of different rates apart')
        frames = first.result.source.frame_id, part.result.source.frame_id
        if frames[0] != frames[1]:
            raise ImuAllanError(f'{part.path}: frame {frames[1]!r}, but {frames[0]!r} in '
                                f'{first.path}; analyze different IMUs apart')
        if part.record.names != first.record.names:
            raise ImuAllanError(f'{part.path}: axes {", ".join(part.record.names)}, but '
                                f'{", ".join(first.record.names)} in {first.path}; analyze them '
                                'apart')
        for name in first.record.names:
            _same_band(first, part, name)
    for name in first.record.names:
        _same_slow_end(parts, name)


def _same_band(first: _Part, part: _Part, name: str) -> None:
    """Refuse recordings that were low-passed differently: their white noise is not one."""
    axes = first.result.axes[name], part.result.axes[name]
    if any(axis.power_law is not None for axis in axes) \
            and all(axis.band_limit_s is None and axis.band_edge_hz is None for axis in axes):
        # Slow noise that reaches so far makes the fast end lower, too.
        return
    one, other = _fast_end(axes[0], first.record.rate_hz), _fast_end(axes[1], part.record.rate_hz)
    if one is None or other is None:
        return
    (a, error_a), (b, error_b) = one, other
    if abs(log(b / a)) > _SAME_BAND + 4 * sqrt(error_a**2 + error_b**2):
        raise ImuAllanError(
            f'{part.path}: {name} falls by another low-pass than in {first.path} (noise at the '
            f'fast end {100 * (b / a - 1):+.0f} %); analyze different settings apart')


def _same_slow_end(parts: Sequence[_Part], name: str) -> None:
    """Refuse recordings of which a filter has taken the slow part out of some."""
    # One without a fit, too short or constant, is not in the joint likelihood either.
    fitted = [part for part in parts if part.result.axes[name].spectrum is not None]
    filtered = [part for part in fitted if part.result.axes[name].high_passed_hz is not None]
    raw = next((part for part in fitted if part not in filtered), None)
    if filtered and raw is not None:
        raise ImuAllanError(
            f'{filtered[0].path}: a filter has taken out the slow part of {name}, which is not '
            f'certain in {raw.path}; analyze the raw topic of each')


def _fast_end(axis: AxisResult, rate_hz: float) -> tuple[float, float] | None:
    """Density of the fastest octave over that three octaves below, and its relative error."""
    if axis.spectrum is None:
        return None
    frequency, psd = np.array(axis.spectrum.frequency_hz), np.array(axis.spectrum.psd)
    means = []
    for top in (rate_hz / 2, rate_hz / 16):
        band = psd[(frequency > top / 2) & (frequency <= top)]
        # The median: a line in one of the bands is no low-pass.
        if len(band) < 4 or (middle := float(np.median(band))) <= 0:
            return None
        means.append((middle, float(np.std(band)) / middle / sqrt(len(band))))
    return means[0][0] / means[1][0], sqrt(means[0][1]**2 + means[1][1]**2)


# ---------------------------------------------------------------------------- what is put together

def _axis_results(parts: Sequence[_Part], rate_hz: float
                  ) -> dict[str, tuple[AxisResult, list[Finding]]]:
    """Fit every axis to the recordings in which it works, if there are any."""
    found = {}
    for name in parts[0].record.names:
        working = [part for part in parts if part.result.axes[name].fault is None] or parts
        fits = [fit for part in working if (fit := part.fits[name]) is not None]
        [found[name]] = axis_results(
            _merged([part.record.group_of(name).only(name) for part in working]), rate_hz,
            [AXES[name]], [joint_fit(fits, 1 / rate_hz) if fits else None])
    return found


def _merged(estimators: Sequence[Estimator]) -> Estimator:
    """One estimator with the samples of all, for the curve; no difference across the seams."""
    merged = estimators[0].copy()
    for estimator in estimators[1:]:
        merged.merge(estimator)
    return merged


def _with_faults(axis: AxisResult, name: str, parts: Sequence[_Part]) -> AxisResult:
    """Keep what was wrong with an axis in one recording, though the others give its numbers."""
    if axis.constant:
        return axis
    still, start = axis.stood_still, 0.0
    for part in parts:
        own, length = part.result.axes[name], part.result.timeline.duration_s
        span = Span(0.0, length) if own.constant else own.stood_still
        if span is not None and still is None:
            still = Span(start + span.start_s, span.duration_s)
        start += length
    ends = [end for part in parts if (end := part.result.axes[name].saturated) is not None]
    bands = [band for part in parts if (band := part.result.axes[name].deadband) is not None]
    return replace(axis, stood_still=still,
                   saturated=max(ends, key=lambda end: end.share, default=axis.saturated),
                   deadband=max(bands, key=lambda band: band.share, default=axis.deadband),
                   copy_of=next((of for part in parts if (
                       of := part.result.axes[name].copy_of) is not None), axis.copy_of))


def _timeline(timelines: Sequence[Timeline], rate_hz: float) -> Timeline:
    """Add up what was seen; spans count on from recording to recording."""
    def shifted(name: str) -> tuple[Span, ...]:
        spans, start = [], 0.0
        for timeline in timelines:
            spans += [Span(start + span.start_s, span.duration_s)
                      for span in getattr(timeline, name)]
            start += timeline.duration_s
        return tuple(spans)

    counts = {name: sum(getattr(timeline, name) for timeline in timelines) for name in (
        'samples', 'duration_s', 'missing', 'duplicates', 'out_of_order', 'rejected')}
    return Timeline(sample_rate_hz=rate_hz, gaps=shifted('gaps'), motion=shifted('motion'),
                    **counts)


def _means(part: _Part) -> dict[str, float]:
    return {name: axis.mean for name, axis in part.result.axes.items() if axis.mean is not None}


def _of_each(parts: Sequence[_Part], axes: Mapping[str, AxisResult]) -> list[Finding]:
    """Return what the timeline and the front door said about one recording or another."""
    # An axis that is constant in all of them is said once.
    constant = {name for name, axis in axes.items() if axis.constant}
    # What the single fits found is said of the joint one, or the joint one does without.
    own = ('short_recording', 'band_limited', 'poor_fit', 'gauss_markov', 'power_law',
           'coarse_resolution', 'warm_up', 'slow_cycle', 'trend_or_walk', 'temperature',
           'high_passed', 'tones')
    return [remark.with_values(recording=part.path) for part in parts
            for remark in part.result.warnings if remark.code not in own
            and not (remark.code == 'constant_axis' and constant.issuperset(remark.axes))]


def _stationarity(name: str, parts: Sequence[_Part]) -> Stationarity | None:
    """Lay the segments of all records end to end; steady is what is so in each of them."""
    found, segments, start = [], [], 0.0
    for part in parts:
        own = part.result.axes[name].stationarity
        if own is not None:
            found.append(own)
            segments += [replace(segment, start_s=start + segment.start_s)
                         for segment in own.segments]
        start += part.result.timeline.duration_s
    if not found:
        return None
    tests = [own.p_value for own in found if own.p_value is not None]
    # Of several tests the smallest probability, times their number (Bonferroni).
    return Stationarity(all(own.steady for own in found),
                        min(1.0, len(tests) * min(tests)) if tests else None, tuple(segments))


# ----------------------------------------------------------------------- what differs between them

def _turn_on_bias(parts: Sequence[_Part], axes: Mapping[str, AxisResult]) -> dict[str, TurnOnBias]:
    spread = {}
    for name, axis in axes.items():
        if not mean_is_known(axis):
            continue
        own = [part for part in parts if mean_is_known(part.result.axes[name])]
        # The joint coefficients know best how much a mean wanders during a recording.
        means = [part.result.axes[name].mean or 0.0 for part in own]
        lengths = [part.record.group_of(name).estimator.samples / part.record.rate_hz
                   for part in own]
        if len(own) > 1 and any(axis.curve.adev):
            spread[name] = turn_on_bias(means, axis, lengths)
    return spread


def _turn_on_remarks(spread: Mapping[str, TurnOnBias], axes: Mapping[str, AxisResult]
                     ) -> list[Finding]:
    remarks = []
    for name, found in spread.items():
        if found.sigma > 0 and found.ci95[0] > 0:
            remarks.append(finding('turn_on_bias', (name,), sigma=found.sigma,
                                   sigma_low=found.ci95[0], sigma_high=found.ci95[1],
                                   unit=axes[name].unit))
    return remarks


def _with_spread(axis: AxisResult, name: str, parts: Sequence[_Part]) -> AxisResult:
    """Enter the spread between recordings; where they contradict each other intervals widen."""
    coefficients = dict(axis.coefficients)
    for key in LASTING_TERMS:
        values, errors = _logarithms(name, key, parts)
        found = coefficients[key]
        value = found.value
        if value is None or found.ci95 is None:
            continue
        coefficients[key] = found = with_between(found, name, key, parts)
        if len(values) < 2:
            continue
        between = random_effects(list(values.values()), list(errors.values())).between
        coefficients[key] = replace(_widened(found, values, errors),
                                    between=value * between)
    return replace(axis, coefficients=coefficients)


def with_between(found: Coefficient, name: str, key: str, parts: Sequence[_Part]) -> Coefficient:
    """Add what a coefficient changes by in each record: the joint likelihood does not know it."""
    assert found.value is not None
    assert found.ci95 is not None
    whole = sum(part.result.timeline.duration_s for part in parts)
    variance = 0.0
    for part in parts:
        own = part.result.axes[name].coefficients[key]
        if own.value and own.between:
            share = part.result.timeline.duration_s / whole
            variance += (share * own.between / own.value)**2
    if not variance:
        return found
    # An interval that begins at 0 cannot begin lower.
    low, high = (found.value * exp(sign * sqrt(log(bound / found.value)**2
                                               + NORMAL95**2 * variance)) if bound > 0 else bound
                 for sign, bound in zip((-1, 1), found.ci95, strict=True))
    return replace(found, ci95=(low, high))


def _widened(found: Coefficient, values: Mapping[str, float], errors: Mapping[str, float]
             ) -> Coefficient:
    """Birge's ratio: an interval is as wide as the scatter of the recordings says at least."""
    assert found.value is not None
    assert found.ci95 is not None
    q = q_statistic(list(values.values()), list(errors.values()))
    free = len(values) - 1
    if _survival(q, free) > _CONTRADICTION:
        return found
    factor = sqrt(q / free)
    low, high = (found.value * exp(factor * log(bound / found.value)) if bound > 0 else bound
                 for bound in found.ci95)
    return replace(found, ci95=(low, high))


def _contradictions(parts: Sequence[_Part], axes: Mapping[str, AxisResult]) -> list[Finding]:
    """Say which recording contradicts the others, and in what."""
    remarks = []
    compared = [(name, key) for name in axes for key in LASTING_TERMS]
    for name, key in compared:
        values, errors = _logarithms(name, key, parts)
        if len(values) < 2:
            continue
        q = q_statistic(list(values.values()), list(errors.values()))
        if _survival(q, len(values) - 1) > _CONTRADICTION / len(compared):
            continue
        odd = max(values, key=lambda path: _distance(path, values, errors))
        others = [path for path in values if path != odd]
        weights = [errors[path]**-2 for path in others]
        usual = exp(float(np.average([values[path] for path in others], weights=weights)))
        remarks.append(finding(
            'recordings_disagree', (name,), coefficient=key, value=exp(values[odd]),
            of_recording=odd, usual_value=usual, others=others,
            unit=TERMS[key].unit(AXES[name])))
    return remarks


def _logarithms(name: str, key: str, parts: Sequence[_Part]
                ) -> tuple[dict[str, float], dict[str, float]]:
    """Logarithm of a coefficient and its error, by path, of the recordings that show it."""
    values, errors = {}, {}
    for part in parts:
        found = part.result.axes[name].coefficients[key]
        if found.value is not None and found.ci95 is not None and found.value > 0:
            low, high = found.ci95
            values[part.path] = log(found.value)
            half = log(high / low) / 2 if low > 0 else log(high / found.value)
            errors[part.path] = half / NORMAL95
    return values, errors


def _distance(path: str, values: Mapping[str, float], errors: Mapping[str, float]) -> float:
    """How far a recording lies from the others, in units of the errors."""
    others = [other for other in values if other != path]
    weights = np.array([max(errors[other], 1e-12)**-2 for other in others])
    mean = float(np.average([values[other] for other in others], weights=weights))
    return abs(values[path] - mean) / sqrt(errors[path]**2 + 1 / float(weights.sum()))


def _survival(q: float, free: int) -> float:
    return float(chi_square.survival(q, free))
