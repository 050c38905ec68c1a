# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Parameters of which the everyday tests try the telling ones, and the slow tests all."""

from collections.abc import Iterable, Sequence
from itertools import product
from typing import Any

import pytest


def slow(*values: Any) -> Any:
    return pytest.param(*values, marks=pytest.mark.slow)


def combined(*values: Sequence[Any], everyday: Iterable[tuple[Any, ...]]) -> list[Any]:
    """Give all combinations, of which some are tried every day."""
    kept = list(everyday)
    every = list(product(*values))
    assert all(one in every for one in kept)
    return [one if one in kept else slow(*one) for one in every]
