# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Several recordings of one IMU as one result.

The coefficients are those of the joint likelihood. The result also shows what one recording
cannot: by how much the mean differs between power-ons, and coefficients between recordings beyond
their errors. Recordings of another rate, frame or axes are no series of measurements and are
rejected; contradictions are reported. This is one module because every step compares the parts.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import exp, sqrt

from imu_allan.characterization.axis import axis_results
from imu_allan.characterization.axis_groups import FinishedRecord
from imu_allan.characterization.noise_findings import length_findings, tone_findings
from imu_allan.characterization.power_ons import turn_on_bias
from imu_allan.characterization.stream import Characterization
from imu_allan.errors import ImuAllanError
from imu_allan.finding import Finding, finding
from imu_allan.noise import chi_square
from imu_allan.noise.allan_deviation import joined_octaves, octaves
from imu_allan.noise.joint_fit import joint_fit
from imu_allan.noise.random_effects import q_statistic, random_effects
from imu_allan.noise.terms import AXES, LASTING_TERMS, TERMS
from imu_allan.noise.uncertainty import (
    leaked_share,
    log_with_error,
    mean_is_known,
    widened,
    widened_interval,
)
from imu_allan.result import AxisResult, RecordingPart, Result, Timeline, Total
from imu_allan.wording import spoken
import numpy as np

_CONTRADICTION = 1e-3
"""Probability, over all comparisons, below which the spread of a coefficient is not chance."""


@dataclass(frozen=True)
class _Part:
    """One recording with its result; `start_s` is its start with all joined end to end."""

    path: str
    start_s: float
    record: FinishedRecord
    result: Result


def joint_result(recordings: Sequence[Characterization],
                 remarks: Sequence[Sequence[Finding]] = ()) -> Result:
    """
    Characterize one IMU from several recordings.

    `recordings`: at least two, each of a whole recording. `remarks`: findings of the reader about
    each. Returns: a result with `recordings` and `turn_on_bias`. Raises ImuAllanError: if one
    has no usable samples, or they cannot be of one IMU in one setting.
    """
    parts, start_s = [], 0.0
    for recording, own in zip(recordings, remarks or [()] * len(recordings), strict=True):
        result, record = recording.fitted(own)
        if record is None:
            raise ImuAllanError(f'{recording.path}: holds no usable sample; leave it out')
        parts.append(_Part(str(recording.path), start_s, record, result))
        start_s += result.timeline.duration_s
    _agree(parts)
    rate = float(np.average([part.record.rate_hz for part in parts],
                            weights=[part.record.samples for part in parts]))
    fitted = _axis_results(parts, rate)
    error = np.max([part.record.summary.density_error for part in parts], axis=0).tolist()
    axes, contradictions, remarks_of_axes = {}, [], []
    for name, (axis, found) in fitted.items():
        compared, odd = _compared(axis, name, parts,
                                  _CONTRADICTION / (len(fitted) * len(LASTING_TERMS)))
        axes[name] = widened(widened(compared, *error), 0.0, max(
            leaked_share(axis, part.record.group_of(name).estimator.interpolated_share, 1 / rate)
            for part in parts))
        contradictions += odd
        remarks_of_axes += [remark.of(name) for remark in found]
    timeline = _timeline(parts, rate)
    # The joint coefficients give the best error of a mean over a recording.
    spread = turn_on_bias(axes, {name: [
        (alone.mean or 0.0, part.record.group_of(name).estimator.samples / part.record.rate_hz)
        for part in parts if mean_is_known(alone := part.result.axes[name])] for name in axes})
    differ = (finding('turn_on_bias', (name,), sigma=found.sigma, sigma_low=found.ci95[0],
                      sigma_high=found.ci95[1], unit=axes[name].unit)
              for name, found in spread.items() if found.sigma > 0 and found.ci95[0] > 0)
    return Result(
        parts[0].result.imu_allan_version,
        replace(parts[0].result.source, path=' + '.join(part.path for part in parts)),
        timeline, axes,
        (*contradictions, *differ, *_of_each(parts), *remarks_of_axes,
         *tone_findings(axes, rate), *length_findings(axes, timeline)),
        tuple(RecordingPart(
            part.path, part.result.source.start_time, part.result.timeline.duration_s,
            {name: axis.mean for name, axis in part.result.axes.items()
             if axis.mean is not None}) for part in parts),
        spread)


# ------------------------------------------------------------------- consistency of the recordings

def _agree(parts: Sequence[_Part]) -> None:
    first = parts[0]
    for part in parts[1:]:
        rate, other = first.record.rate_hz, part.record.rate_hz
        # Clocks differ by less, settings of the rate by more.
        if abs(other / rate - 1) > 0.005:
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


# ------------------------------------------------------------------- combination of the recordings

def _axis_results(parts: Sequence[_Part], rate_hz: float
                  ) -> dict[str, tuple[AxisResult, list[Finding]]]:
    """Fit every axis to all recordings; one that works in none of them is that of the first."""
    found: dict[str, tuple[AxisResult, list[Finding]]] = {}
    for name in parts[0].record.names:
        faulty = [part for part in parts if part.result.axes[name].fault is not None]
        if faulty:
            if len(faulty) < len(parts):
                raise ImuAllanError(f'{faulty[0].path}: {spoken(name)} is '
                                    f'{faulty[0].result.axes[name].fault}, but not in every '
                                    'recording; leave this one out')
            found[name] = replace(parts[0].result.axes[name], signal=None), []
            continue
        records = [part.record.group_of(name).only(name) for part in parts]
        fits = [fit for part in parts if (fit := part.record.fits[name]) is not None]
        [(axis, remarks)] = axis_results(
            records[0], rate_hz, [AXES[name]], [joint_fit(fits, 1 / rate_hz) if fits else None],
            joined_octaves([octaves(record) for record in records]))
        mean = float(np.average([record.mean[0] for record in records],
                                weights=[record.samples for record in records]))
        # The signals of the recordings have no common time.
        found[name] = replace(axis, mean=mean, signal=None), remarks
    return found


def _timeline(parts: Sequence[_Part], rate_hz: float) -> Timeline:
    """Add up the timelines; times continue from recording to recording."""
    timelines = [part.result.timeline for part in parts]
    counts = {name: sum(getattr(timeline, name) for timeline in timelines) for name in (
        'samples', 'duration_s', 'missing', 'duplicates', 'out_of_order', 'rejected')}
    gaps, motion = (
        tuple(replace(span, start_s=part.start_s + span.start_s) for part in parts
              for span in getattr(part.result.timeline, name)) for name in ('gaps', 'motion'))
    all_gaps, all_motion = (
        Total(sum(one.count for one in each), sum(one.duration_s for one in each))
        for each in zip(*(timeline.totals for timeline in timelines), strict=True))
    return Timeline(sample_rate_hz=rate_hz, gaps=gaps, motion=motion, **counts,
                    all_gaps=all_gaps if all_gaps.count > len(gaps) else None,
                    all_motion=all_motion if all_motion.count > len(motion) else None)


def _of_each(parts: Sequence[_Part]) -> list[Finding]:
    """Return the findings of timeline and reader about single recordings."""
    # Findings of the single fits are reported for the joint fit, if they apply to it.
    own = ('short_recording', 'band_limited', 'poor_fit', 'gauss_markov', 'power_law',
           'coarse_resolution', 'trend_or_walk', 'high_passed', 'tones')
    return [remark.with_values(recording=part.path) for part in parts
            for remark in part.result.warnings if remark.code not in own
            # An axis that is constant is so in all recordings.
            and not (remark.code == 'constant_axis' and part is not parts[0])]


# -------------------------------------------------------------- differences between the recordings

def _compared(axis: AxisResult, name: str, parts: Sequence[_Part], limit: float
              ) -> tuple[AxisResult, list[Finding]]:
    """
    Return an axis with the spread of its coefficients between recordings, and what contradicts it.

    Intervals of recordings that contradict each other are widened. Reported is which of them
    contradicts the others; `limit` is how probable their spread is then by chance.
    """
    coefficients, remarks = dict(axis.coefficients), []
    for key in LASTING_TERMS:
        found, value = coefficients[key], coefficients[key].value
        known = [(part.path, shown) for part in parts if (shown := log_with_error(
            part.result.axes[name].coefficients[key])) is not None]
        if (free := len(known) - 1) < 1:
            continue
        paths = [path for path, _ in known]
        # Logarithms of the values, and the errors of these
        values, errors = np.array([shown for _, shown in known]).T
        q = q_statistic(values, errors)
        chance = chi_square.survival(q, free)
        if value is not None and found.ci95 is not None:
            if chance <= _CONTRADICTION:
                # Birge ratio: at least as wide as the scatter of the recordings.
                found = widened_interval(found, sqrt(q / free))
            coefficients[key] = replace(
                found, between=value * random_effects(values, errors).between)
        if chance <= limit:
            # The weighted mean of the others, and its error
            weights = np.maximum(errors, 1e-12)**-2.0 * ~np.eye(len(values), dtype=bool)
            usual, of_usual = weights @ values / weights.sum(axis=1), weights.sum(axis=1)**-0.5
            odd = int(np.argmax(np.abs(values - usual) / np.hypot(errors, of_usual)))
            remarks.append(finding(
                'recordings_disagree', (name,), coefficient=key, value=exp(values[odd]),
                of_recording=paths[odd], usual_value=exp(usual[odd]),
                others=[path for path in paths if path != paths[odd]],
                unit=TERMS[key].unit(AXES[name])))
    return replace(axis, coefficients=coefficients), remarks
