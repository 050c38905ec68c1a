# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Options of the timeline that the user can set."""

from dataclasses import dataclass
from typing import Literal

from imu_allan.argument_checks import positive

RATE_TOLERANCE = 0.02
"""Rates that differ by a larger share are different: a stated rate may be rounded, and a clock
slightly off. Messages at another rate are left out; if they persist, the node begins another
run."""


@dataclass(frozen=True)
class TimelineOptions:
    """
    What the user may decide about the timeline.

    Attributes
    ----------
    clock : {'auto', 'header', 'receive'}
        Which stamps to use; 'auto' takes header stamps unless they are unusable.
    rate_hz : float or None
        Sample rate stated by the user, which overrides the measured one.
    force_rate : bool
        Use the stated rate even if the measured one differs by more than 2 %.
    gap_tolerance : int
        Longest gap, in samples, that is interpolated by the local mean.
    motion : {'exclude', 'keep'}
        Whether motion and knocks are cut out.

    """

    clock: Literal['auto', 'header', 'receive'] = 'auto'
    rate_hz: float | None = None
    force_rate: bool = False
    gap_tolerance: int = 5
    motion: Literal['exclude', 'keep'] = 'exclude'

    def __post_init__(self) -> None:
        """Reject unknown values, which a state file may contain."""
        if self.clock not in ('auto', 'header', 'receive'):
            raise ValueError(f'clock {self.clock!r} is not auto, header or receive')
        if self.motion not in ('exclude', 'keep'):
            raise ValueError(f'motion {self.motion!r} is not exclude or keep')
        if self.rate_hz is not None:
            positive('rate_hz', self.rate_hz)
