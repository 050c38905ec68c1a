# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The first screens of eight typical recordings, whose results `screens/` holds, line by line."""

import os
from pathlib import Path
import re

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
    # Whether it is good and which numbers to take; a line that is broken is set in, and one still.
    whole = [line for line in lines if line and (line[0] != ' ' or ' filter N ' in line)]
    for line, sensor in zip(whole, ('Gyroscope', 'Accelerometer'), strict=False):
        assert line.startswith((f'{sensor}: N is good (+-', f'{sensor}: use with care: ',
                                f'{sensor}: not usable: '))
    assert whole[2].startswith('Tuned for a filter corrected every ')
    assert whole[2].endswith('(imu_allan export)')
    assert [line.split()[:3] for line in whole[3:5]] == [
        ['gyro', 'filter', 'N'], ['accel', 'filter', 'N']]
    # The tuned K and the measured one stand in one block, by different names.
    if stored.stem == 'vibration':
        # Its findings leave no line; the table has K, too.
        assert [line for line in lines if re.match(r'K deg/h/sqrt\(h\) .* <', line)]
        return
    [measured] = [line for line in lines if 'measured K' in line]
    assert lines.index(measured) == lines.index(whole[4]) + 1
    assert re.fullmatch(r'  measured K: gyro (not visible, < )?\d\S*( \(.*\))?; '
                        r'accel (not visible, < )?\d\S*( \(.*\))?', measured)
