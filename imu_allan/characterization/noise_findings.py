# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Findings about the noise, in one module because they are read together."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from math import isfinite, isinf, log

from imu_allan.characterization.thermometer import Temperature
from imu_allan.finding import Finding, finding
from imu_allan.noise.axis_fit import SHORTEST_RECORD
from imu_allan.noise.posterior.report import AxisReport
from imu_allan.noise.posterior.thresholds_and_priors import TOLERATED_MISFIT
from imu_allan.noise.stationarity import Steadiness
from imu_allan.noise.terms import FLICKER_FLOOR
from imu_allan.result import AxisResult, Segment, Timeline, Trend

MEAN_MOVES = {'warm_up', 'slow_cycle', 'trend_or_walk', 'bias_step'}
"""Codes of the findings about a mean that moves."""


def tone_findings(axes: Mapping[str, AxisResult], rate_hz: float) -> Iterator[Finding]:
    """Report the lines left out of the spectra: of each axis the strongest."""
    for name, axis in axes.items():
        if axis.tones:
            strongest = max(axis.tones, key=lambda tone: tone.amplitude)
            yield finding(
                'tones', (name,), unit=axis.unit, count=len(axis.tones),
                frequency_hz=strongest.frequency_hz, amplitude=strongest.amplitude,
                # Alternation from message to message stays this close to half the rate. Chosen by
                # judgment.
                half_rate=any(2 * tone.frequency_hz > 0.995 * rate_hz for tone in axis.tones))


def fit_findings(fitted: AxisReport, unit: str) -> Iterator[Finding]:
    """Report what the noise of an axis contains besides the coefficients, and its trends."""
    if fitted.high_pass_hz is not None:
        yield finding('high_passed', corner_hz=fitted.high_pass_hz)
    if fitted.edge_hz is not None:
        yield finding('band_limited', edge_hz=fitted.edge_hz)
    elif fitted.window_s is not None:
        yield finding('band_limited', window_s=fitted.window_s)
    if not fitted.acceptable:
        yield finding('poor_fit', misfit_share=fitted.misfit
                      if fitted.misfit > TOLERATED_MISFIT else None)
    if (law := fitted.power_law) is not None:
        low, high = law.exponent_ci95
        yield finding('power_law', exponent=law.exponent, exponent_low=low, exponent_high=high)
    if (process := fitted.gauss_markov) is not None:
        yield finding('gauss_markov', sigma=process.sigma, unit=unit,
                      correlation_time_s=process.correlation_time_s)
    trend = fitted.trend
    if (heat := trend.temperature) is not None:
        low, high = heat.ci95
        yield finding(
            'temperature', per_kelvin=heat.per_kelvin, per_kelvin_low=low, per_kelvin_high=high,
            unit=unit, lowest_c=heat.lowest_c, highest_c=heat.highest_c, lag_s=heat.lag_s)
    if (first := trend.warm_up) is not None:
        flicker = fitted.estimates['bias_instability']
        known = flicker.value if flicker.observable else flicker.upper
        longest_s = first.time_constant_ci95[1] if first.time_constant_ci95 else None
        yield finding(
            'warm_up', amplitude=first.amplitude, unit=unit,
            time_constant_s=first.time_constant_s,
            time_constant_factor=None if longest_s is None else longest_s / first.time_constant_s,
            exponentials=1 if trend.second_warm_up is None else 2,
            steady_after_s=steady_after_s(trend, known if isfinite(known) else 0.0))
    if trend.cycle_s is not None:
        yield finding('slow_cycle', period_s=trend.cycle_s)
    if (step := fitted.bias_step) is not None:
        yield finding('bias_step', size=step.size, unit=unit, after_s=step.at_s)
    if fitted.random_walk_unclear:
        yield finding('trend_or_walk')


def steadiness_findings(steady: Steadiness, segments: Sequence[Segment]) -> Iterator[Finding]:
    """Report in which band the noise changes most, and by how much."""
    if (change := steady.change) is not None:
        yield finding('not_steady', low_hz=change.low_hz or None,
                      high_hz=None if isinf(change.high_hz) else change.high_hz,
                      spread_share=change.spread, segment_s=segments[0].duration_s)


def steady_after_s(trend: Trend | None, flicker: float) -> float:
    """
    Return the seconds until a warm-up has decayed to a third of the flicker floor, or 0.

    If the floor is not known (zero), until a twentieth of the amplitude is left.
    """
    parts = () if trend is None else (trend.warm_up, trend.second_warm_up)
    # Without a floor, a warm-up is over after three time constants.
    return max((part.time_constant_s * max(log(abs(part.amplitude) / (
        FLICKER_FLOOR * flicker / 3 or 0.05 * abs(part.amplitude))), 0.0)
        for part in parts if part is not None and part.amplitude), default=0.0)


def thermometer_findings(seen: Temperature) -> Iterator[Finding]:
    """Report what is wrong with the readings of a thermometer."""
    if not seen.changes:
        yield (finding('thermometer', fault='short', covered_share=seen.covered)
               if seen.series is None else finding('thermometer', fault='constant'))


def with_start(found: Iterable[Finding], axes: Mapping[str, AxisResult], length_s: float
               ) -> list[Finding]:
    """
    Add to findings of a warm-up the start that leaves it out.

    `found`: findings of all axes. `axes`: their fits. `length_s`: duration of the recording, or of
    the shortest of several. Returns: `start_s` of a warm-up is what ``--start`` should be, the
    latest end of a warm-up within the first half; None if there is none.
    """
    ends = []
    for axis in axes.values():
        flicker = axis.coefficients['bias_instability']
        ends.append(steady_after_s(axis.trend, flicker.value or flicker.upper95 or 0.0))
    start_s = max((end for end in ends if 0 < end <= length_s / 2), default=None)
    return [one.with_values(start_s=start_s) if one.code == 'warm_up' else one for one in found]


def length_findings(axes: Mapping[str, AxisResult], timeline: Timeline,
                    unclear: Collection[str] = ()) -> list[Finding]:
    """
    Report what the record is too short for.

    `axes`: their fits. `timeline`: of the same record. `unclear`: axes whose random walk is hidden
    by a trend, not by the length of the record.
    """
    live = {name: axis for name, axis in axes.items() if axis.goodness_of_fit.p_value is not None}
    if not live and timeline.samples < SHORTEST_RECORD:
        return [finding('short_recording', severity='act', samples=timeline.samples,
                        needed=SHORTEST_RECORD, duration_s=timeline.rest_s)]
    return [finding('short_recording', (name,), coefficient=key, duration_s=timeline.rest_s,
                    severity='act' if key == 'noise_density' else 'know')
            for key, hidden in (('noise_density', ()), ('rate_random_walk', unclear))
            for name, axis in live.items()
            if not axis.coefficients[key].observable and name not in hidden]
