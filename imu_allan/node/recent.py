# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""How much counts have grown lately: levels are about now, totals about the whole run."""

from collections.abc import Mapping

RECENT_S = 30.0
"""Somebody who looks twice a minute sees what happened; what is longer ago is a total."""


class Recent:
    """Growth of counts within the last `RECENT_S`."""

    def __init__(self) -> None:
        self._seen: dict[str, list[tuple[float, int]]] = {}

    def see(self, now: float, totals: Mapping[str, int], *, known: bool = False) -> None:
        """Note the totals; those of a resumed run are `known`, one that falls begins anew."""
        for name, total in totals.items():
            seen = self._seen.setdefault(name, [(now, total if known else 0)])
            if total < seen[-1][1]:
                seen[:] = [(now, 0)]
            if total > seen[-1][1]:
                seen.append((now, total))
            # The first entry is what had been counted when the window began.
            while len(seen) > 1 and now - seen[1][0] > RECENT_S:
                seen.pop(0)

    def __getitem__(self, name: str) -> int:
        """Growth of one count."""
        seen = self._seen.get(name)
        return seen[-1][1] - seen[0][1] if seen else 0
