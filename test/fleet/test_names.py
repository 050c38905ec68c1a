# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from imu_allan.fleet.names import distinct_labels, name_pattern, natural, unit_name
import pytest
from whole_lines import refused, Varying


def test_a_unit_is_called_like_its_recording_its_folder_or_what_a_pattern_finds(tmp_path):
    paths = [str(tmp_path / f'sn{number}' / 'night.mcap') for number in (7, 12)]
    for source, names in (('file', ['night', 'night']), ('folder', ['sn7', 'sn12']),
                          (r'sn(\d+)', ['7', '12']), (r'sn\d+', ['sn7', 'sn12'])):
        assert [unit_name(path, name_pattern(source)) for path in paths] == names
    # A folder has no suffix.
    (tmp_path / 'unit.7').mkdir()
    assert unit_name(str(tmp_path / 'unit.7')) == 'unit.7'


def test_a_pattern_that_finds_nothing_or_is_none_is_refused():
    with refused('a/b.csv: --name-from sn([0-9]+) finds no name in this path'):
        unit_name('a/b.csv', name_pattern('sn([0-9]+)'))
    with refused(Varying('--name-from: ( is neither folder nor file nor a regular expression '
                         '(<words>)')):
        name_pattern('(')


def test_units_stand_in_the_order_of_their_numbers():
    assert sorted(['unit10', 'Unit2', 'unit1', '3', 'a', 'unit10b2', 'unit10b12'], key=natural) \
        == ['3', 'a', 'unit1', 'Unit2', 'unit10', 'unit10b2', 'unit10b12']


@pytest.mark.parametrize(('names', 'shown'), [
    (['unit1', 'unit2'], ['unit1', 'unit2']),
    (['bench_of_monday_1', 'bench_of_monday_2'], ['bench_…nday_1', 'bench_…nday_2']),
    ([f'imu_bench_{unit}_monday_night' for unit in 'ab'], ['imu_bench_a…', 'imu_bench_b…']),
    ([f'monday_night_{unit}_adis16405' for unit in (9, 10)], ['…day_night_9…', '…day_night_10…']),
    ([f'{unit}_monday_{night}_imu_{unit}' for unit in 'ab' for night in 'xy'], list('1234')),
    ([], [])])
def test_shortened_names_of_two_units_differ(names, shown):
    assert distinct_labels(names, 14) == shown
