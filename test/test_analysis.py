# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A recording in, a result out: where it begins, and that the same messages count once."""

from os import PathLike

from imu_allan.analysis import analyze
from imu_allan.block import ImuBlock
from imu_allan.cli.main import main
from imu_allan.noise.simulate import simulate
from imu_allan.recordings import RecordingOptions
from imu_allan.recordings.repeated_messages import sampled, share_messages
from imu_allan.timeline import TimelineOptions
from imu_allan.wording import origin_of
from imu_allan.writers.filters import export
import numpy as np
import pytest
from whole_lines import refused

RATE = 5.0
TIME = np.arange(36_000) / RATE
MANY = 20_000
ROWS = np.random.default_rng(0).normal(size=(MANY, 6))


@pytest.fixture
def written(tmp_path):
    def write(settling=0.0, seed=1, name='imu.csv', part=slice(None)):
        rows = np.column_stack((TIME, settling + simulate(
            {'noise_density': 1e-3, 'bias_instability': 1e-3}, len(TIME), RATE, seed)))
        np.savetxt(tmp_path / name, rows[part], fmt='%.9g', delimiter=',',
                   header='time_s,gyro_x', comments='')
        return tmp_path / name
    return write


def test_the_start_that_is_advised_leaves_out_the_warm_up(written):
    path = written(0.02 * np.exp(-TIME / 500))
    cold = analyze(path)
    [said] = [one.values for one in cold.warnings if one.code == 'warm_up']
    assert 1200 <= said['start_s'] <= 3000
    warm = analyze(path, start_s=said['start_s'])
    assert cold.axes['gyro_x'].trend.warm_up is not None
    assert warm.axes['gyro_x'].trend.warm_up is None
    assert 3000 < warm.timeline.duration_s < 6000
    assert not warm.axes['gyro_x'].coefficients['rate_random_walk'].observable


def test_the_start_that_is_advised_takes_the_place_of_the_one_that_was_given(written):
    cut = written(settling := 0.02 * np.exp(-TIME / 500), name='cut.csv', part=TIME >= 300)
    starts = [found.values['start_s'] for result in (
        analyze(cut), analyze(written(settling), start_s=300))
        for found in result.warnings if found.code == 'warm_up']
    assert starts[1] == pytest.approx(300 + starts[0])


@pytest.mark.parametrize(('first', 'other'), [
    (slice(None), None), (slice(None), slice(12_000, 30_000)),
    (slice(0, 18_500), slice(17_500, 36_000))],
    ids=['a link', 'its middle', 'ten seconds of it'])
def test_the_same_recording_given_twice_is_refused(written, first, other):
    path = written(part=first)
    beside = path.with_name('other.csv')
    if other is None:
        beside.symlink_to(path)
    else:
        written(name=beside.name, part=other)
    for one, two in ((path, beside), (beside, path)):
        with refused(f'{one} and {two} hold the same messages, which would count twice; give each '
                     'recording of the IMU once'):
            analyze([one, two])


@pytest.mark.parametrize('paths', [[], ['alone.csv']])
def test_a_joint_result_of_fewer_than_two_is_refused_before_anything_is_read(paths):
    with refused('a joint result needs at least two recordings'):
        analyze(paths)


def kept(stamps, samples):
    found = {}
    list(sampled([ImuBlock(stamps, stamps, samples, np.zeros((len(stamps), 2), bool), 'imu')],
                 found))
    return found


@pytest.mark.parametrize('batch', [1, 5])
@pytest.mark.parametrize('rows', [slice(5001, None), np.delete(np.arange(MANY), 6000)],
                         ids=['part from within a batch', 'one lost'])
def test_a_part_is_recognised_where_batches_share_a_stamp(batch, rows):
    stamps = 10**18 + np.arange(MANY) // batch * batch * 10_000_000
    assert share_messages(kept(stamps, ROWS), kept(stamps[rows], ROWS[rows]))


@pytest.mark.parametrize('batch', [1, 2, 8, 100, MANY])
@pytest.mark.parametrize('step', [1, 2])
def test_coarse_values_of_one_batch_are_not_the_same_by_chance(batch, step):
    stamps = 10**18 + np.arange(MANY) // batch * batch * 10_000_000
    coarse = np.round(ROWS / step) * step
    coarse[:, 3:] = np.nan
    assert not share_messages(kept(stamps, coarse), kept(stamps, coarse[::-1]))


def test_stamps_that_leap_take_no_memory():
    count = 2**18 + 10
    assert len(kept(10**11 * np.arange(count) % 2**60, np.zeros((count, 6)))) <= 2**18


@pytest.mark.parametrize(('first', 'seed', 'ordered', 'repeated'), [
    (0, 1, False, 36_000), (9000, 1, False, 27_000), (0, 2, False, 0), (0, 1, True, 36_000)],
    ids=['the whole', 'a part', 'a device that counts from its start', 'each row'])
def test_what_a_recording_holds_twice_counts_once(written, first, seed, ordered, repeated):
    path, other = written(), written(seed=seed, name='other.csv', part=slice(first, None))
    header, *rows = path.read_text().splitlines()
    rows += other.read_text().splitlines()[1:]
    if ordered:
        rows.sort(key=lambda row: float(row.partition(',')[0]))
    path.write_text('\n'.join([header, *rows, '']))
    result = analyze(path)
    assert result.timeline.samples == pytest.approx(72_000 if seed == 2 else 36_000, abs=300)
    assert [one.values['messages'] for one in result.warnings if one.code == 'repeated_part'] == (
        [pytest.approx(repeated, abs=300)] if repeated else [])


@pytest.mark.parametrize(('given', 'line'), [
    ({'start_s': np.nan}, 'start_s must be a number from 1e-06 to 3.2e+09, not nan'),
    ({'start_s': -5}, 'start_s must be a number from 1e-06 to 3.2e+09, not -5'),
    ({'duration_s': '10s'}, "duration_s must be a number from 1e-06 to 3.2e+09, not '10s'")])
def test_an_argument_that_makes_no_sense_is_refused_before_anything_is_read(given, line):
    with refused(line):
        analyze('no such file', **given)


def test_what_was_given_as_numbers_of_numpy_is_the_same_in_a_result(written):
    path = written()
    found, plain = (analyze(path, options=TimelineOptions(rate_hz=kind(5.0)),
                            reading=RecordingOptions(rate_hz=kind(5.0)),
                            start_s=kind(8.1), duration_s=kind(600.1))
                    for kind in (np.float32, float))
    assert found.to_json() == plain.to_json()


def test_recordings_of_one_time_with_other_values_are_two(written):
    assert len(analyze([written(), written(seed=2, name='other.csv')]).recordings) == 2


def test_a_table_that_counts_from_zero_has_no_date_and_no_topic(written, capsys):
    class Given(PathLike):
        """Any kind of path is one recording."""

        def __fspath__(self):
            return str(path)

    path = written()
    result = analyze(Given())
    assert result.source.path == str(path)
    assert result.source.start_time is None
    assert origin_of(result) == ['time column']
    assert 'rostopic: "/imu/data_raw"' in export(result, 'kalibr')
    assert main(['info', result.source.path]) == 0
    shown = capsys.readouterr().out
    assert '  clock       time column' in shown.splitlines()
    assert '1970' not in shown
