# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A result that is looked at from every side, and a browser for its pages."""

from collections.abc import Iterator

from browser import Browser, running_browser
from exact_results import build_result
from imu_allan.result import Result
import pytest


@pytest.fixture(scope='session')
def result() -> Result:
    return build_result()


@pytest.fixture(scope='module')
def browser() -> Iterator[Browser]:
    with running_browser() as browser:
        yield browser
