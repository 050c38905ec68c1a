# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What the node knows of its topics and of itself, as log and ``/diagnostics`` report it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from imu_allan.node.standards import Comparison
from imu_allan.result import Timeline

RECENT_S = 30.0
"""Window of recent counts: a user who looks twice a minute sees every event. Totals keep all."""


class Recent:
    """Increase of counts within the last `RECENT_S`."""

    def __init__(self) -> None:
        self._seen: dict[str, list[tuple[float, int]]] = {}

    def see(self, now: float, totals: Mapping[str, int], *, known: bool = False) -> None:
        """Record totals; first totals that are `known` are not recent, and a drop restarts."""
        for name, total in totals.items():
            seen = self._seen.setdefault(name, [(now, total if known else 0)])
            if total < seen[-1][1]:
                seen[:] = [(now, 0)]
            if total > seen[-1][1]:
                seen.append((now, total))
            # The first entry is the total at the beginning of the window.
            while len(seen) > 1 and now - seen[1][0] > RECENT_S:
                seen.pop(0)

    def __getitem__(self, name: str) -> int:
        """Return the recent increase of one count."""
        seen = self._seen.get(name)
        return seen[-1][1] - seen[0][1] if seen else 0


@dataclass
class Facts:
    """
    Counts and conditions of one topic of an IMU, for ``/diagnostics``.

    The facts of the first topic also hold what concerns the whole node.
    """

    topic: str
    queue: int
    expected_rate: float  # Hz; 0 if unknown
    half: str | None = None  # the sensor on the topic, if it carries only one
    received: int = 0
    lost: int = 0
    malformed: int = 0
    skipped: int = 0  # passed over while paused
    malformed_why: str = ''
    overrun: int = 0  # how often the queue was full when it was emptied
    recent: Recent = field(default_factory=Recent)
    mixed: bool = False  # messages of two publishers are being passed over
    mixed_samples: int = 0  # passed over because publishers were mixed
    looping: bool = False  # earlier messages are repeated, as by a recording played in a loop
    publishers: int = 0
    publisher_names: Sequence[str] = ()  # if there are several
    refused: list[str] = field(default_factory=list)  # why publishers are not matched
    silent_s: float = 0.0  # since the last message, or since the wait for the first one began
    silence_why: str | None = None  # how the log explains it; None before it is worth a line
    received_hz: float = 0.0  # recent
    cpu_s: float | None = None  # recent CPU time of the whole process per message
    longest_hold_s: float = 0.0  # longest time between two calls of `take`, since the last report
    paused: bool = False
    on_probation: bool = False  # messages are held back until they show which IMU they are from
    fit_s: float | None = None
    update_error: str = ''  # why the latest samples cannot be used
    errors: Mapping[str, str] = field(default_factory=dict)  # those of the `Worker`
    state_file: str = ''  # empty if none is kept
    checkpointed_at: float | None = None  # by the monotonic clock
    resumed: str = ''  # what became of the state file at the start
    timeline: Timeline | None = None  # at the last look
    temperature_topic: str = ''
    temperature_c: float | None = None
    temperature_at: float | None = None  # of the last reading, by the monotonic clock
    comparisons: list[Comparison] = field(default_factory=list)
