# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What the user should know, as data: a code, how much it matters, which axes, and figures.

Nothing below the writers makes a sentence of a finding and nothing decides by one:
`imu_allan.writers.words` has the words of every code, in one table.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal

Severity = Literal['act', 'know']

ACT = frozenset({
    'alternating', 'axis_not_finite', 'batches', 'bias_step', 'clock_changed', 'clock_speed',
    'constant_axis', 'copied_axis', 'deadband', 'field_absent', 'filtered', 'frozen', 'gravity',
    'high_passed', 'implausible', 'interpolated', 'many_missing', 'mostly_motion',
    'noise_level_changed', 'not_steady', 'poor_fit', 'rate_changed', 'recordings_disagree',
    'saturated', 'several_frames', 'several_publishers', 'slow_motion', 'stood_still',
    'unknown_rate', 'warm_up'})
"""Codes after which the numbers are not what one wants until something is done."""


@dataclass(frozen=True)
class Finding:
    """
    What the user should know.

    Attributes
    ----------
    code : str
        Fixed; scripts may rely on it.
    severity : {'act', 'know'}
        Whether the numbers are not what the user wants until something is done.
    axes : tuple of str
        Which axes it is about; empty where it is about the recording.
    values : mapping of str to number, text, bool, list or None
        Figures by name, in SI units; documented by code in docs/findings.md. Of several axes a
        value is a list, one for each, where it is not the same for all.
    message : str
        Made of the rest where a result is handed out. Nothing reads it.

    """

    code: str
    severity: Severity = 'know'
    axes: tuple[str, ...] = ()
    values: Mapping[str, Any] = field(default_factory=dict)
    message: str = field(default='', compare=False)

    def of(self, axis: str) -> 'Finding':
        """Return the finding as one about an axis."""
        return replace(self, axes=(axis,))

    def with_values(self, **values: Any) -> 'Finding':
        """Return the finding with further figures."""
        return replace(self, values={**self.values, **values})


def finding(code: str, axes: Sequence[str] = (), *, severity: Severity | None = None,
            **values: Any) -> Finding:
    """Return a finding; what its code says about the severity holds unless one is given."""
    return Finding(code, severity or ('act' if code in ACT else 'know'), tuple(axes), values)
