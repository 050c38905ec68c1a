# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the user should know, as data: a code, a severity, the axes, and figures.

Only `imu_allan.finding_messages` turns findings into sentences, by `imu_allan.finding_texts`, and
nothing below it makes decisions based on findings.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, get_args, Literal

from imu_allan.errors import ImuAllanError
from imu_allan.json_of_dataclasses import typed

Severity = Literal['act', 'know']

Count = Annotated[int, 'count']
Flag = Annotated[bool, 'flag']
Text = Annotated[str, 'text']
Number = Annotated[float, 'number']
Share = Annotated[float, 'share']
Seconds = Annotated[float, 's']
Hertz = Annotated[float, 'Hz']
Flaw = Literal['zero', 'constant', 'in whole seconds', 'coarse', 'out of order', 'too fast']
Celsius = Annotated[float, '°C']
InUnit = Annotated[float, 'in `unit`']
PerKelvin = Annotated[float, 'in `unit` per K']


@dataclass(frozen=True)
class Code:
    """
    What all findings of a code have in common.

    Attributes
    ----------
    severity : {'act', 'know'}
        Default, if a finding has none of its own.
    values : mapping of str to type
        Type of each figure, with its unit. One that may be None may also be left out.

    """

    severity: Severity
    values: Mapping[str, Any]


def _act(**values: Any) -> Code:
    return Code('act', values)


def _know(**values: Any) -> Code:
    return Code('know', values)


CODES: Mapping[str, Code] = {
    # the sensor does not measure
    'stood_still': _act(start_s=Seconds, duration_s=Seconds),
    'constant_axis': _act(value=InUnit, unit=Text),
    'saturated': _act(share=Share, value=InUnit, unit=Text, end=Literal['highest', 'lowest']),
    'deadband': _act(share=Share, width=InUnit, unit=Text),
    'high_passed': _act(corner_hz=Hertz),
    'filtered': _act(),
    'axis_not_finite': _act(no_column=Flag | None),
    'frozen': _act(messages=Count, since_s=Seconds | None),
    'unknown_rate': _act(),
    # the sensor was not at rest or not steady
    'mostly_motion': _act(share=Share),
    'slow_motion': _act(size=InUnit, unit=Text, start_s=Seconds, duration_s=Seconds, count=Count),
    'noise_level_changed': _act(at_s=tuple[Seconds, ...], ratios=tuple[Number, ...]),
    'bias_step': _act(size=InUnit, unit=Text, after_s=Seconds),
    'not_steady': _act(
        low_hz=Hertz | None, high_hz=Hertz | None, spread_share=Share, segment_s=Seconds),
    'warm_up': _act(
        amplitude=InUnit, unit=Text, time_constant_s=Seconds, time_constant_factor=Number | None,
        exponentials=Count, steady_after_s=Seconds, start_s=Seconds | None),
    # the data may not be what it is taken for
    'several_publishers': _act(),
    'several_frames': _act(
        frame_id=Text | None, others=tuple[Text, ...], rejected=tuple[Count, ...]),
    'rate_changed': _act(
        from_hz=Hertz, to_hz=Hertz, at_s=Seconds | None, left_out=Count, most_left_out=Flag),
    'clock_changed': _act(flaw=Flaw, since_s=Seconds),
    'clock_speed': _act(ratio=Number),
    'gravity': _act(mean=Annotated[float, 'm/s^2']),
    'implausible': _act(what=Literal['mean', 'noise_density', 'spread'], value=InUnit,
                        limit=InUnit, unit=Text, likely=Text),
    # messages are lost
    'many_missing': _act(share=Share, density_error_share=Share | None),
    'spikes': _know(messages=Count),
    'field_absent': _act(messages=Count),
    'interpolated': _act(topic=Text, half=Text),
    'damaged_recording': _know(
        fault=Literal['places', 'database', 'bytes', 'file', 'unread'],
        places=Count | None, first=Text | None, read=Count | None, bytes=Count | None,
        reason=Text | None, lost=Count | None, of=Count | None, topic=Text | None),
    'truncated_recording': _know(
        fault=Literal['compressed', 'database', 'log', 'ends'], missing_bytes=Count | None,
        bytes=Count | None, end=Text | None, whole_chunks=Count | None, reason=Text | None),
    'lost_messages': _know(found=Count, counted=Count, topic=Text),
    'missing_file': _know(missing=Count, listed=Count, files=Text),
    'malformed_messages': _know(what=Literal['line', 'message'], count=Count, topic=Text | None,
                                type=Text | None, first=Text | None),
    # what the model explains
    'short_recording': _know(
        coefficient=Text | None, duration_s=Seconds, samples=Count | None, needed=Count | None),
    'poor_fit': _act(misfit_share=Share | None),
    'recordings_disagree': _act(coefficient=Text, value=InUnit, of_recording=Text,
                                usual_value=InUnit, others=tuple[Text, ...], unit=Text),
    'thermometer': _know(fault=Literal['short', 'constant', 'unread'], covered_share=Share | None,
                         reason=Text | None),
    'trend_or_walk': _know(),
    'power_law': _know(exponent=Number, exponent_low=Number, exponent_high=Number),
    'band_limited': _know(edge_hz=Hertz | None, window_s=Seconds | None),
    'gauss_markov': _know(sigma=InUnit, unit=Text, correlation_time_s=Seconds),
    'temperature': _know(per_kelvin=PerKelvin, per_kelvin_low=PerKelvin, per_kelvin_high=PerKelvin,
                         unit=Text, lowest_c=Celsius, highest_c=Celsius, lag_s=Seconds | None),
    'slow_cycle': _know(period_s=Seconds),
    'coarse_resolution': _know(step=InUnit, unit=Text, ratio=Number),
    'tones': _know(count=Count, frequency_hz=Hertz, amplitude=InUnit, unit=Text, half_rate=Flag),
    'turn_on_bias': _know(sigma=InUnit, sigma_low=InUnit, sigma_high=InUnit, unit=Text),
    # how the data was treated
    'motion': _know(count=Count, excluded_s=Seconds),
    'rest_within_motion': _know(share=Share, rest_s=Seconds, rests=Count,
                                starts_s=tuple[Seconds, ...], durations_s=tuple[Seconds, ...]),
    'motion_kept': _know(count=Count, seen_s=Seconds, first_s=Seconds),
    'receive_clock': _know(flaw=Flaw | None),
    'counted_samples': _know(rate_hz=Hertz),
    'uneven_stamps': _know(clock=Text, hidden_share=Share | None, density_high_share=Share | None,
                           rate_error_share=Share | None),
    'clock_jumps': _know(clock=Text, count=Count),
    'held_values': _know(share=Share),
    'unit_g': _know(),
    'unit_assumed': _know(),
    'two_rates': _know(
        sensors=tuple[Text, ...], topics=tuple[Text, ...], rates_hz=tuple[Hertz | None, ...]),
    'repeated_half': _know(topic=Text, half=Text),
    'chosen_topic': _know(
        topics=Count, chosen=tuple[Text, ...], reason=Text, others=tuple[Text, ...]),
    'short_part': _know(recorded_s=Seconds, asked_s=Seconds),
    'ignored_columns': _know(count=Count, columns=tuple[Text, ...]),
    'repeated_part': _know(messages=Count),
    'no_metadata': _know(reason=Text | None),
    'unfinished_recording': _know(
        fault=Literal['unusable', 'not_regular'], file=Text, reason=Text | None),
}
"""All codes, in the order in which findings of equal severity are shown."""


@dataclass(frozen=True)
class Finding:
    """
    One thing that the user should know.

    Attributes
    ----------
    code : str
        Stable; scripts may rely on it.
    severity : {'act', 'know'}
        'act' if the numbers are not what the user wants until something is done.
    axes : tuple of str
        Axes that it is about; empty if it is about the recording.
    values : mapping of str to number, text, bool, list or None
        Figures by name, as in `CODES`, and `recording` if it is about one of several. For several
        axes, a value that is not the same for all is a list. If `more` is the only figure, it
        counts the findings of the code that are left out.
    message : str
        Text made from the other attributes when a result is returned. No code reads it.

    """

    code: str
    severity: Severity = 'know'
    axes: tuple[str, ...] = ()
    values: Mapping[str, Any] = field(default_factory=dict)
    message: str = field(default='', compare=False)

    def of(self, axis: str) -> 'Finding':
        """Return the finding as one about a single axis."""
        return replace(self, axes=(axis,))

    def with_values(self, **values: Any) -> 'Finding':
        """Return the finding with further figures."""
        return replace(self, values={**self.values, **values})


def finding(code: str, axes: Sequence[str] = (), *, severity: Severity | None = None,
            recording: str | None = None, **values: Any) -> Finding:
    """
    Return a finding, with the severity of its code unless one is given.

    Raises
    ------
    TypeError
        If a value does not match `CODES`, which is a bug.

    """
    kinds = CODES[code].values
    wrong = [name for name in {**kinds, **values}
             if name not in kinds or not is_of_kind(values.get(name), kinds[name])]
    if wrong:
        raise TypeError(f'{code}: {", ".join(f"{name}={values.get(name)!r}" for name in wrong)}')
    if recording is not None:
        values = {'recording': recording, **values}
    return Finding(code, severity or CODES[code].severity, tuple(axes), values)


def is_optional(kind: Any) -> bool:
    """Return whether a value of a type in `CODES` may be None."""
    return type(None) in get_args(kind)


def known(kind: Any) -> Any:
    """Return the type that a value has if it is not None."""
    return get_args(kind)[0] if is_optional(kind) else kind


def is_of_kind(value: object, kind: Any) -> bool:
    """Return whether a value is of a type in `CODES`."""
    try:
        typed(kind, value, '')
    except ImuAllanError:
        return False
    return True
