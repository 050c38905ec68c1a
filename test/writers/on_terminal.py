# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What is shown, and whether it is as before; the curve of a constant axis."""

import io
import os
from pathlib import Path
from typing import Any

from imu_allan.result import Curve, Result
from imu_allan.writers.table import result_table
from rich.console import Console, RenderableType

FLAT = Curve((0.01, 0.02), (0.0, 0.0), (5.0, 2.0), ((0.0, 0.0),) * 2, ((0.0, 0.0),) * 2,
             (0.0, 0.0))


def printed(result: Result, width: int = 80, si: bool = False, verbose: bool = False,
            **options: Any) -> str:
    """Return a result as the command prints it; `options` are those of the console."""
    out = io.StringIO()
    Console(file=out, width=width, highlight=False, **options).print(
        result_table(result, width, si=si, verbose=verbose))
    return out.getvalue()


def shown(table: RenderableType, width: int) -> str:
    out = io.StringIO()
    Console(file=out, width=width).print(table)
    return out.getvalue()


def assert_as_before(text: str, name: str) -> None:
    """Compare a text with the one that is kept, which IMU_ALLAN_SNAPSHOTS=write replaces."""
    snapshot = Path(__file__).parent / name
    if os.environ.get('IMU_ALLAN_SNAPSHOTS') == 'write':
        snapshot.write_text(text)
    assert text == snapshot.read_text()
