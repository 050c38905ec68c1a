# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The whole path with the faults of a real driver, held against the clean run."""

import json

from characterized import B, ends, in_blocks, K, N, said, streamed
from imu_allan import analyze
from imu_allan.characterization import Characterization
from imu_allan.datasheet import check
from imu_allan.finding_messages import with_words
from imu_allan.noise.simulate import simulate
from imu_allan.noise.terms import AXES
from imu_allan.recordings import reading
from imu_allan.recordings.write import write_recording
from imu_allan.result import Result
from imu_allan.sensor.noise_model import parse_model
import numpy as np
import pytest
from repeated import slow
from whole_lines import refused, Varying

RATE = 100.0


def still_imu(samples):
    """Draw six axes at rest, shape (samples, 6)."""
    gyro, accel = ({N: n, B: b, K: k} for n, b, k in ((7e-5, 2.4e-5, 4e-6), (1.5e-3, 4e-4, 6e-5)))
    columns = [simulate(gyro if name.startswith('gyro') else accel, samples, RATE, seed)
               for seed, name in enumerate(AXES)]
    columns[5] += 9.81
    return np.stack(columns, axis=1)


def characterized(rows, index=None):
    return streamed(in_blocks(rows, RATE, index)).result()


def test_a_kind_of_source_that_no_result_names_is_refused():
    with refused("kind must be 'recording' or 'topic', not 'live'", ValueError):
        Characterization(kind='live')


def test_an_imu_that_is_turned_between_rests_keeps_the_coefficients_of_each_axis():
    rows = still_imu(48_000)
    upright = characterized(rows)
    turned, rng = rows.copy(), np.random.default_rng(4)
    # Put down at 2 degrees, upside down and on its side, as seen by an accelerometer.
    for part, level in enumerate([[0, 0, 0], [0.34, 0, 0], [0, 0, -19.62], [0, 9.81, -9.81]]):
        turned[12_000 * part:12_000 * (part + 1), 3:] += level
        turned[12_000 * part - 400:12_000 * part] += rng.normal(0, 0.5, (400, 6)) if part else 0
    result = characterized(turned)
    assert len(result.timeline.motion) == 3
    assert not {'poor_fit', 'slow_motion', 'band_limited', 'bias_step'} & {
        found.code for found in result.warnings}
    for name, axis in result.axes.items():
        assert axis.coefficients[N].value == pytest.approx(
            upright.axes[name].coefficients[N].value, rel=0.02)
        for key in (B, K):
            (low, high), (lowest, highest) = (
                ends(one.axes[name].coefficients[key]) for one in (upright, result))
            assert low <= highest
            assert lowest <= high
    # What was cut out takes its time in the signals of both sensors.
    ends_s = {axis.signal.step_s * len(axis.signal.mean) for axis in result.axes.values()}
    assert max(ends_s) - min(ends_s) < 0.01 * result.timeline.duration_s


def test_a_floor_that_is_not_quite_flat_is_no_random_walk_of_the_accelerometer():
    rng = np.random.default_rng(6)
    rows = np.column_stack([simulate({N: density}, 180_000, RATE, seed)
                            for seed, density in enumerate([7e-5] * 3 + [1.5e-3] * 3)])
    for stop in range(6_000, 180_000, 6_000):
        rows[stop - 1_000:stop] += rng.normal(0, 0.5, (1_000, 6))
        # By a fiftieth of a degree, a fifth of the noise of a sample.
        rows[stop:, 3:] += rng.normal(0, 0.003, 3)
    result = characterized(rows)
    assert len(result.timeline.motion) == 29
    assert not {'bias_step', 'trend_or_walk'} & {found.code for found in result.warnings}
    for axis in result.axes.values():
        assert not axis.coefficients[K].observable


@pytest.mark.parametrize('hours', [0.4, slow(3)])
def test_drops_gaps_and_knocks_leave_the_coefficients_alone(hours):
    samples = round(hours * 3600 * RATE)
    rng = np.random.default_rng(2)
    rows = still_imu(samples)
    clean = characterized(rows)

    hurt, keep = rows.copy(), rng.random(samples) > 0.01
    knocks = np.linspace(0.2, 0.9, 5) * samples
    for at in knocks.astype(int):
        ring = np.exp(-np.arange(40) / 10) * np.sin(np.arange(40))
        hurt[at:at + 40] += 40 * rows.std(axis=0) * ring[:, None]
    for at in (np.array([0.31, 0.52, 0.77]) * samples).astype(int):
        keep[at:at + 1000] = False
    keep[[0, -1]] = True
    index = np.flatnonzero(keep)
    faulty = characterized(hurt[index], index)

    assert faulty.timeline.missing == samples - len(index)
    # The length that is too short is the time at rest, as in the verdict.
    assert {found.values['duration_s'] for found in faulty.warnings
            if found.code == 'short_recording'} <= {faulty.timeline.rest_s}
    assert sum(gap.duration_s > 9 for gap in faulty.timeline.gaps) == 3
    assert len(faulty.timeline.motion) == 5
    for knock, span in zip(knocks, faulty.timeline.motion, strict=True):
        assert span.start_s <= knock / RATE <= span.start_s + span.duration_s
    for name in AXES:
        one, other = clean.axes[name].coefficients, faulty.axes[name].coefficients
        assert other[N].value == pytest.approx(one[N].value, rel=0.01)
        for key in (B, K):
            # What each knows of it is not contradicted by the other.
            (low, high), (lowest, highest) = ends(one[key]), ends(other[key])
            assert max(low, lowest) < min(high, highest), (name, key)
            if other[key].observable and one[key].observable:
                assert low <= other[key].value <= high, (name, key)


def test_looking_saving_and_loading_do_not_disturb_the_stream():
    """A node has a state written by another thread, while samples come in."""
    rows = still_imu(30_000)
    whole, part = (Characterization(kind='topic', topic='/imu') for _ in range(2))
    for number, block in enumerate(in_blocks(rows, RATE, gyro_alone=True)):
        whole.update(block)
        part.update(block)
        if number % 4 == 0:
            part.result()
        if number == 4:
            state = part.to_state()
            then = {key: array.copy() for key, array in state.items()}
            loaded = Characterization.from_state(state)
        if number > 4:
            loaded.update(block)
    assert part.result() == loaded.result() == whole.result()
    assert [key for key in then if not np.array_equal(
        then[key], state[key], equal_nan=then[key].dtype.kind == 'f')] == []


def test_an_interruption_begins_a_new_run_and_loses_nothing():
    stream = Characterization(kind='topic', topic='/imu')
    nothing = stream.result()
    assert (nothing.axes, nothing.timeline.samples) == ({}, 0)
    rows = still_imu(20_000)
    for first, place in ((0, 0), (10_000, 10_000_000)):
        stream.take(in_blocks(rows[first:first + 10_000], RATE, np.arange(10_000) + place,
                              gyro_alone=True))
        stream.break_run()
    result = stream.result()
    assert result.timeline.samples == 20_000
    assert list(result.axes) == ['gyro_x', 'gyro_y', 'gyro_z']
    assert result.axes['gyro_x'].coefficients[N].value == pytest.approx(7e-5, rel=0.03)


def cut_off(rows):
    rows[:, 5] = np.minimum(rows[:, 5], np.median(rows[:, 5]))
    return ('accel_z',), {'share': pytest.approx(0.5, abs=1e-3), 'unit': 'm/s^2',
                          'value': pytest.approx(rows[:, 5].max()), 'end': 'highest'}


def dead_about_zero(rows):
    rows[:, 0] -= rows[:, 0].mean()
    rows[np.abs(rows[:, 0]) < 2 * rows[:, 0].std(), 0] = 0.0
    zero = rows[:, 0] == 0
    return ('gyro_x',), {'share': pytest.approx(zero.mean(), abs=1e-2), 'unit': 'rad/s',
                         'width': pytest.approx(abs(rows[~zero, 0]).min(), rel=0.1)}


@pytest.mark.parametrize(('code', 'spoil', 'reason'), [
    ('saturated', cut_off, 'the axis is saturated: 50.0 % of the samples stand at <number> m/s^2, '
     'the highest value: the output is cut off there'),
    ('deadband', dead_about_zero, 'the axis is zeroed: 9<number> % of the samples are exactly 0, '
     'and none lies between 0 and <number> rad/s: the driver gives small values as 0')])
def test_an_axis_at_fault_is_reported_in_a_result_that_fails_its_limit(code, spoil, reason):
    rows = still_imu(20_000)
    names, values = spoil(rows)
    result = characterized(rows)
    [found] = said(result, code)
    assert (found.axes, found.values) == (names, values)
    assert tuple(name for name, axis in result.axes.items() if axis.fault) == names
    assert not any(c.observable for c in result.axes[names[0]].coefficients.values())
    assert Result.from_dict(json.loads(result.to_json())) == result
    verdicts = {verdict.axis: verdict for verdict in check(result, parse_model(
        'gyro: {noise_density: 0.01 rad/s/sqrt(Hz)}\naccel: {noise_density: 0.1 m/s^2/sqrt(Hz)}'))}
    assert tuple(axis for axis, one in verdicts.items() if one.verdict == 'fail') == names
    assert verdicts[names[-1]].reason == Varying(f'{names[-1]} N: {reason}')


@pytest.mark.parametrize('part', ['timeline', 'epoch_ns'])
def test_a_state_without_a_part_is_refused(part):
    state = Characterization(kind='topic', topic='/imu').to_state()
    del state[part]
    with refused(f'saved characterization: {part} is missing'):
        Characterization.from_state(state)


def test_every_container_and_batch_gives_the_same_result_to_the_last_bit(tmp_path, monkeypatch):
    # Most of the time goes into the fits: one axis has values.
    rows = np.where(np.arange(6) == 2, still_imu(30_000), np.nan)
    whole = streamed(in_blocks(rows, RATE, size=777, gyro_alone=True), None, topic='/imu/data_raw')
    expected = with_words(whole.result()).to_dict()
    for storage in ('mcap', 'sqlite3'):
        bag = write_recording(tmp_path / storage, in_blocks(rows, RATE, gyro_alone=True),
                              storage=storage)
        # Read by a thread in blocks as they come, or by a process in blocks of another size.
        for worthwhile_bytes in (1 << 40, 0):
            monkeypatch.setattr(reading, 'WORTHWHILE_BYTES', worthwhile_bytes)
            document = analyze(bag).to_dict()
            assert document | {'source': document['source'] | {
                'path': None, 'files': None}} == expected
