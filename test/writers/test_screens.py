# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The first screens of eight typical recordings, whose results `screens/` holds, line by line."""

import os
from pathlib import Path

from imu_allan.writers.result_file import load_result
from on_terminal import printed
import pytest

SCREENS = sorted(Path(__file__).with_name('screens').glob('*.json'))
assert len(SCREENS) == 8


@pytest.mark.parametrize('stored', SCREENS, ids=lambda path: path.stem)
def test_a_screen_is_as_it_was_and_begins_with_what_a_newcomer_wants(stored: Path) -> None:
    """After a wanted change: IMU_ALLAN_SNAPSHOTS=write pytest test/writers/test_screens.py."""
    lines = [line.rstrip() for line in printed(load_result(stored)).splitlines()]
    # The last of 24 says how to save.
    assert len(lines) <= 23
    assert max(map(len, lines)) <= 80
    snapshot = stored.with_suffix('.txt')
    if os.environ.get('IMU_ALLAN_SNAPSHOTS') == 'write':
        snapshot.write_text('\n'.join([*lines, '']))
    assert lines == snapshot.read_text().splitlines()
