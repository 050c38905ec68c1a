# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What stands on a terminal; the curve of a constant axis, which leaves nothing to show."""

import io
from typing import Any

from imu_allan.result import Curve, Result
from imu_allan.writers.table import print_result
from rich.console import Console, RenderableType

FLAT = Curve((0.01, 0.02), (0.0, 0.0), (5.0, 2.0), ((0.0, 0.0),) * 2, ((0.0, 0.0),) * 2,
             (0.0, 0.0))


def printed(result: Result, width: int = 80, units: str = 'datasheet', verbose: bool = False,
            **options: Any) -> str:
    """Return a result as the command prints it; `options` are those of the console."""
    out = io.StringIO()
    print_result(result, Console(file=out, width=width, **options), units=units, verbose=verbose)
    return out.getvalue()


def shown(table: RenderableType, width: int) -> str:
    """Return a table as it stands on a terminal."""
    out = io.StringIO()
    Console(file=out, width=width).print(table)
    return out.getvalue()
