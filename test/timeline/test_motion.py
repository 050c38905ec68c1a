# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Knocks, turns and drives are cut out and listed, noise is not; what rests between is used."""

from functools import partial
from itertools import count

from imu_allan.block import EvenBlock
from imu_allan.noise.simulate import NoiseStream
from imu_allan.timeline.motion import MotionDetector
from imu_allan.writers.table import result_text
from imu_messages import codes, rows_by_place, run, said, SIGMA, still
import numpy as np
import pytest
from repeated import slow
from scenarios import at_rest, characterized, MOVES
from whole_lines import refused

N = 0.0045 * np.pi / 180
B = 0.0014 * np.pi / 180
K = 6.5e-5 * np.pi / 180


def covered(spans, start_s, duration_s):
    return any(span.start_s <= start_s + 1e-6
               and span.start_s + span.duration_s >= start_s + duration_s - 1e-6
               for span in spans)


def times(block):
    return (block.header_ns - block.header_ns[0]) / 1e9


@pytest.mark.parametrize(('rate_hz', 'axes'), [(100.0, slice(1, 2)), (4000.0, slice(0, 6))])
def test_knocks_of_twenty_sigma_over_50_ms_are_cut_out_and_listed(rate_hz, axes):
    rng = np.random.default_rng(3)
    block = still(int(240 * rate_hz), rate_hz)
    knocks = (20.3, 100.0, 150.13, 200.37, 239.0)
    time = times(block)
    for at in knocks:
        hit = (time >= at) & (time < at + 0.05)
        block.samples[hit, axes] += 20 * SIGMA * rng.normal(size=block.samples[hit, axes].shape)
    summary, even = run(block)
    assert summary.motion.cut.count == len(summary.timeline.motion) == len(knocks)
    for at in knocks:
        assert covered(summary.timeline.motion, at - 0.3, min(0.65, 240 - at + 0.3))
    assert summary.motion.cut.total_s < 4 * len(knocks)
    assert not summary.mostly_motion
    places, rows = rows_by_place(even)
    assert len(places) == pytest.approx(len(block) - summary.motion.cut.total_s * rate_hz)
    assert np.abs(rows - [0, 0, 0, 0, 0, 9.81]).max() < 7 * SIGMA
    assert np.array_equal(rows, block.samples[places])
    assert 'motion' in codes(summary)


@pytest.mark.parametrize('rate_hz', [20.0, 1000.0])
def test_an_imu_that_is_picked_up_turned_and_put_back_is_cut_out(rate_hz):
    block = still(int(240 * rate_hz), rate_hz)
    time = times(block)
    angle = np.interp(time, [150, 152, 158, 160], [0.0, 0.8, 0.8, 0.0])
    block.samples[:, 0] += np.gradient(angle, 1 / rate_hz)
    block.samples[:, 4] += 9.81 * np.sin(angle)
    block.samples[:, 5] += 9.81 * (np.cos(angle) - 1)
    summary, even = run(block)
    assert covered(summary.timeline.motion, 149.5, 3.0)
    assert covered(summary.timeline.motion, 157.5, 3.0)
    assert summary.motion.cut.total_s < 25
    _, rows = rows_by_place(even)
    assert np.abs(rows[:, 0]).max() < 7 * SIGMA


@pytest.mark.parametrize(('rate_hz', 'moving_s'), [(20.0, 25.0), (100.0, 5.0), (1000.0, 45.0)])
def test_a_recording_that_begins_with_motion_is_cut_at_its_start(rate_hz, moving_s):
    block = still(int(300 * rate_hz), rate_hz)
    time = times(block)
    early = time < moving_s
    block.samples[early] += 0.3 * np.sin(2 * np.pi * 1.3 * time[early])[:, None]
    summary, even = run(block)
    assert covered(summary.timeline.motion, 0.0, moving_s)
    assert summary.motion.cut.total_s < moving_s + 10
    places, _ = rows_by_place(even)
    assert even[0].new_run
    assert places[0] >= moving_s * rate_hz


def test_motion_is_no_rest_though_it_is_not_listed(monkeypatch):
    monkeypatch.setattr('imu_allan.timeline.motion.LISTED_SPANS', 2)
    block = still(60_000)
    for knock in range(5000, 60_000, 10_000):
        block.samples[knock:knock + 20] += 50 * SIGMA
    summary, even = run(block)
    timeline = summary.timeline
    assert (len(timeline.motion), timeline.all_motion.count) == (2, 6)
    assert timeline.rest_s == pytest.approx(sum(map(len, even)) / 100.0, rel=1e-6)


def test_kept_motion_stays_and_is_reported():
    block = still(12_000)
    assert not run(block, motion='keep')[0].remarks
    block.samples[6000:6100] += 1.0
    summary, even = run(block, motion='keep')
    assert summary.timeline.motion == ()
    assert np.array_equal(rows_by_place(even)[1], block.samples)
    assert (summary.motion.cut.count, summary.mostly_motion) == (0, False)
    (remark,) = summary.remarks
    assert (remark.code, remark.values['count']) == ('motion_kept', 1)
    assert 1 <= remark.values['seen_s'] < 10
    assert remark.values['first_s'] < 60 < remark.values['first_s'] + remark.values['seen_s']


def test_a_fan_that_goes_on_running_is_reported_and_kept_after_a_while():
    block = still(120_000)
    block.samples[60_000:] += np.random.default_rng(1).normal(size=(60_000, 6)) * 3.5 * SIGMA
    summary, even = run(block)
    assert not summary.mostly_motion
    assert summary.motion.cut.total_s < 200
    assert 'noise_level_changed' in codes(summary)
    assert rows_by_place(even)[0][-1] == 119_999


def noise_at_rest(kind, rate_hz, seed):
    """Give six axes at rest, of `kind`."""
    seeds = count(100 * seed)
    sigma = N * rate_hz ** 0.5

    def axis(*tones, slope=0.0, warm_up=0.0, step=0.0, **coefficients):
        stream = NoiseStream(coefficients, rate_hz, next(seeds))

        def draw(rows, time):
            values = stream.draw(rows) + slope * time + warm_up * (1 - np.exp(-time / 600)) + sum(
                amplitude * np.sin(2 * np.pi * frequency_hz * time)
                for frequency_hz, amplitude in tones)
            return np.round(values / step) * step if step else values

        return draw

    usual = partial(axis, noise_density=N, bias_instability=B)
    if kind == 'terms':
        return [axis(noise_density=N), usual(rate_random_walk=K),
                axis(noise_density=N, bias_instability=10 * B, rate_random_walk=100 * K),
                axis(quantization_noise=0.1 * N, noise_density=N / 100),
                axis(rate_random_walk=K), axis(bias_instability=B)]
    if kind == 'drift':
        return [axis(noise_density=N, slope=1e-6, warm_up=0.01),
                axis(noise_density=N / 1000, warm_up=0.01),
                *(axis(noise_density=N / less, gauss_markov={
                    'sigma': drift, 'correlation_time_s': time_s}) for less, drift, time_s in (
                    (10, 1e-3, 30.0), (100, 1e-4, 1.0), (100, 1e-4, 0.2))),
                usual((0.01, 5 * sigma))]
    if kind == 'outputs':
        return [usual(rate_random_walk=K, step=3 * sigma),
                usual(rate_random_walk=30 * K, step=10 * sigma),
                axis(rate_random_walk=K, step=5 * N),
                *3 * [lambda rows, _: np.full(rows, 9.81)]]
    return [usual((0.07 * rate_hz, 20 * sigma)), usual((7.0, 20 * sigma), (7.05, 10 * sigma)),
            usual((0.3, 10 * sigma)), usual((0.467, 3 * sigma)),
            usual((8.0, 20 * sigma), (8.01, 20 * sigma)),
            usual((0.001, 5 * sigma), step=2 * sigma)]


@pytest.mark.parametrize('kind', ['terms', 'drift', 'outputs', 'tones'])
@pytest.mark.parametrize(('rate_hz', 'hours'), [
    (100.0, 0.5), slow(20.0, 24.0), slow(100.0, 24.0), slow(1000.0, 4.0)])
def test_noise_drift_and_steady_vibration_are_no_motion(kind, rate_hz, hours):
    axes, detector = noise_at_rest(kind, rate_hz, 1 + (hours > 1)), MotionDetector(1 / rate_hz)
    total, given = int(hours * 3600 * rate_hz), 0
    for first in range(0, total, 403_200):
        size = min(403_200, total - first)
        time = (first + np.arange(size)) / rate_hz
        rows = np.column_stack([axis(size, time) for axis in axes])
        for at in range(0, size, 4032):
            given += sum(map(len, detector.push(EvenBlock(
                rows[at:at + 4032], first + at, new_run=first + at == 0,
                start_s=(first + at) / rate_hz))))
    given += sum(map(len, detector.flush()))
    assert detector.summary.cut.count == 0
    assert given == total


@pytest.mark.parametrize(('rate_hz', 'rows'), [(100.0, 150), (100.0, 600), (4000.0, 2800)])
def test_a_few_windows_at_rest_are_no_motion_and_a_knock_among_them_is(rate_hz, rows):
    rng = np.random.default_rng(rows)
    for seed in range(15):
        block = still(rows, rate_hz, seed=seed)
        assert run(block)[0].timeline.motion == ()
    if rate_hz == 100:
        at = int(rng.integers(rows // 3, rows * 2 // 3))
        block.samples[at:at + 5] += 60 * SIGMA * rng.normal(size=(5, 6))
        summary, _ = run(block)
        (span,) = summary.timeline.motion
        assert span.start_s <= at / 100 <= span.start_s + span.duration_s
        assert summary.mostly_motion == (rows < 400)


def driven(moving, times):
    """Give 400 s of messages that shake by `times` the noise, and sway, while they move."""
    rng = np.random.default_rng(1)
    messages, truth = at_rest(40_000, 100.0, rng)
    time = messages.header
    drives = {'take-off after 10 s': time > 10, 'stops every 40 s': np.floor(time / 20) % 2 == 1,
              'drives first': (time < 120) | (np.floor(time / 20) % 4 != 1),
              'stops at the end': time < 290, 'throughout': time >= 0}[moving]
    messages.samples[drives] += rng.normal(size=(np.count_nonzero(drives), 6)) * times * SIGMA
    messages.samples[drives] += 0.3 * np.sin(2 * np.pi * 0.3 * time[drives])[:, None]
    return messages, truth


@pytest.mark.parametrize('times', [slow(5), 20])
@pytest.mark.parametrize(('moving', 'rest_s'), [
    ('take-off after 10 s', 8.5), ('stops every 40 s', 158), ('drives first', 46.5),
    ('stops at the end', 107)])
def test_what_is_at_rest_is_used_and_listed(moving, times, rest_s):
    messages, truth = driven(moving, times)
    result = characterized(messages)
    for axis in result.axes.values():
        density = axis.coefficients['noise_density']
        low, high = density.ci95
        assert low - (density.value - low) < truth.density < high + (high - density.value)
    found = said(result, 'rest_within_motion').values
    assert found['rest_s'] == pytest.approx(rest_s, rel=1e-3)
    if moving == 'drives first':
        assert found['starts_s'] == pytest.approx([183, 263, 343], abs=0.5)
        assert found['durations_s'] == pytest.approx([15.5] * 3, abs=0.05)
    assert sum(span.duration_s for span in result.timeline.motion) == pytest.approx(
        400 - rest_s, abs=0.6)


def test_rest_is_the_same_whatever_the_blocks_and_saves():
    messages, _ = driven('drives first', 20)
    messages.absent[:, 1] = True
    whole = characterized(messages).to_dict()
    for seed in range(3):
        assert characterized(messages, np.random.default_rng(seed)).to_dict() == whole


def test_what_moves_throughout_is_refused():
    with refused(MOVES):
        characterized(driven('throughout', 20)[0])


def test_less_than_a_minute_of_rest_is_never_called_good():
    text = result_text(characterized(driven('take-off after 10 s', 20)[0]))
    assert ('40,000 samples at 100 Hz, 6 min 40 s, 8.5 s at rest; '
            '1 segment of motion (6 min 32 s)') in ' '.join(text.split())
    assert text.splitlines()[:2] == [
        'Gyroscope: not usable: 8.5 s at rest.', 'Accelerometer: not usable: 8.5 s at rest.']
