# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Faults that made a number wrong without a word: each is right now, or reported."""

from dataclasses import replace
from functools import partial

from imu_allan.timeline import TimelineOptions, TimelineStage
from imu_allan.timeline.values import alternates
from imu_messages import codes, cut, run, said
import numpy as np
import pytest
from repeated import slow
import scenarios
from scenarios import at_rest, characterized, MORE_FAULTS, SIGMA, verdict
from scipy.signal import butter, lfilter
from whole_lines import refused

APART = 3 * SIGMA * np.array([1, -2, 0.5, -1, 1, 0.3])
"""Between the means of two sensors."""


def rest(rate_hz=100.0, duration_s=150.0, seed=0):
    rng = np.random.default_rng(seed)
    return (*at_rest(round(rate_hz * duration_s), rate_hz, rng), rng)


def gyro(rate_hz=100.0, duration_s=150.0, seed=0):
    """Give a gyroscope alone: nearly all of the time goes into the fits of the axes."""
    messages, truth, rng = rest(rate_hz, duration_s, seed)
    messages.absent[:, 1] = True
    return messages, truth, rng


def lose(messages, lost, rng=None):
    """Lose a share of the messages at random, or in turn where a pattern has zeros."""
    n = len(messages.place)
    return messages.pick(np.resize([one == '1' for one in lost], n) if isinstance(lost, str)
                         else rng.random(n) >= lost)


def in_ticks(messages, tick, since):
    return replace(messages, header=np.floor((messages.header + since) / tick) * tick)


def one_clock(messages):
    return replace(messages, receive=messages.header.copy())


def late_receive(messages, rng):
    late = messages.header + 2e-4 + rng.exponential(2e-4, len(messages.place))
    return replace(messages, receive=np.maximum.accumulate(late) + 1e-7 * messages.place)


def dated_back(messages, size, interval, rate_hz=100.0):
    """Stamp batches back from when they are read, by an interval that is not the true one."""
    place = messages.place
    return replace(messages, header=((place // size + 1) * size
                                     - (size - 1 - place % size) * interval) / rate_hz)


def late_by_half(messages, rng, by):
    """Let a fifth of the messages be late by more or less than half an interval of 10 ms."""
    n = len(messages.place)
    delay = (rng.random(n) < 0.2) * by + rng.exponential(0.02, n)
    header = np.maximum.accumulate(messages.header + delay / 100) + 1e-7 * messages.place
    return replace(messages, header=header, receive=np.maximum.accumulate(
        header + 1e-4 + rng.exponential(2e-4, n)))


def outages(messages, rng, on_s, off_s):
    there, at = np.zeros(len(messages.place), bool), 0.0
    while at < messages.header[-1]:
        lasts = on_s * rng.uniform(0.5, 1.5)
        there |= (messages.header >= at) & (messages.header < at + lasts)
        at += lasts + off_s * rng.uniform(0.5, 1.5)
    return messages.pick(there)


def overrun(messages, rng, share, shifts):
    """Poll late now and then; the timer starts anew then, or leaves out the time that passed."""
    n = len(messages.place)
    by = np.where(rng.random(n) < share, rng.uniform(0.3, 1.5, n), 0)
    header = (messages.place + np.cumsum(np.minimum(by, 0.9)) if shifts
              else np.maximum.accumulate(messages.place + by)) / 100
    return replace(messages, header=header, receive=header + 1e-3).pick(
        shifts | np.append(True, by[:-1] <= 1))


def in_batches(messages, size, rate_hz, apart_s=2e-5):
    """Stamp messages when a batch of them is read."""
    stamps = (messages.place // size + 1) * size / rate_hz + messages.place % size * apart_s
    return replace(messages, header=stamps, receive=stamps + 1e-3)


def read_by_timer(messages, rng, every_s, late_s):
    """Stamp messages when a timer, which is late itself, finds them ready, one after the other."""
    tick = np.ceil((messages.header + 0.3 * every_s) / every_s).astype(int)
    fires = every_s * np.arange(tick[-1] + 1) + rng.exponential(late_s, tick[-1] + 1)
    header = np.maximum.accumulate(fires[tick]) + 1e-6 * messages.place
    return replace(messages, header=header, receive=np.maximum.accumulate(
        header + 1e-4 + rng.exponential(1e-4, len(header))))


def by_radio(messages, rng, slot_s=0.03):
    """Stamp messages when they have come over a radio, in slots, with losses in bursts."""
    late = rng.exponential(2e-3, len(messages.place))
    header = np.ceil(messages.header / slot_s) * slot_s + late
    header = np.maximum.accumulate(header) + 1e-6 * messages.place
    lost = np.convolve(rng.random(len(header)) < 0.03, np.ones(4))[:len(header)] > 0
    return one_clock(replace(messages, header=header)).pick(~lost)


def missed(messages):
    return int(messages.place[-1] - messages.place[0]) + 1 - len(messages.place)


def unsure(remarks, name='hidden_share'):
    """Give a share that stamps which come too unevenly leave open; 0 if they are not reported."""
    for found in remarks:
        if found.code == 'uneven_stamps':
            return found.values[name] or 0.0
    return 0.0


def assert_right(result, truth, tolerance=0.03, axes=None):
    assert result.timeline.sample_rate_hz == pytest.approx(truth.rate_hz, rel=2e-3)
    assert len(result.axes) in ((3, 6) if axes is None else (axes,))
    for axis in result.axes.values():
        density = axis.coefficients['noise_density']
        assert density.value == pytest.approx(truth.density, rel=tolerance)


def received(messages, stamps):
    return replace(messages, header=0 * messages.header, receive=stamps)


def in_pairs(messages):
    """Stamp messages of 40 Hz as a USB device does that hands over two samples at a time."""
    return messages.header + 0.0185 * (messages.place % 2 == 0)


def now_and_then_late(messages, rng):
    """Let one step in seven be a tenth longer, which the median of the steps is not."""
    steps = rng.choice([1.0, 1.1], len(messages.place), p=[0.86, 0.14])
    return one_clock(replace(messages, header=np.cumsum(steps) / steps.mean() / 100))


STAMPS = [
    ('outages of any length', 100.0, 400, 1e-4, 0, partial(outages, on_s=1, off_s=3)),
    ('slots of a radio', 10.0, 1200, 1e-3, 2, by_radio),
    *((f'a timer of {every_s} s reads {rate_hz} Hz', rate_hz, 100, 1e-3, 0, partial(
        read_by_timer, every_s=every_s, late_s=late_s)) for rate_hz, every_s, late_s in (
            (100.3, 0.016, 1e-3), (83.6, 0.008, 1e-3), (100.3, 1 / 150, 5e-4),
            (334.0, 0.008, 2e-4))),
    ('few messages between outages', 5.0, 1200, 1e-4, 0, lambda m, _: replace(
        m, receive=np.full(len(m.place), m.receive[-1])).pick(m.place % 24 < 3)),
    ('batches, outages', 100.0, 150, 1e-3, 6, lambda m, _: in_batches(m, 10, 100.0).pick(
        m.header % 6 < 5)),
    *((f'batches of {size} received', 400.0, 75, rel, 0, lambda m, _, size=size: received(
        m, in_batches(m, size, 400.0).receive)) for size, rel in ((2, 1e-4), (25, 1e-3))),
    ('four received together', 100.0, 200, 1e-3, 0, lambda m, _: received(
        m, np.repeat(m.receive[3::4], 4))),
    ('pairs', 40.0, 500, 1e-4, 0, lambda m, _: one_clock(replace(m, header=in_pairs(m)))),
    ('pairs received', 40.0, 500, 1e-4, 0, lambda m, _: received(m, in_pairs(m))),
    ('late now and then', 100.0, 200, 1e-4, 0, now_and_then_late),
    ('stalls of the host', 200.0, 150, 1e-4, 0, lambda m, _: one_clock(replace(
        m, header=m.header + np.maximum(40 - (m.place + 777) % 1777, 0) * 0.99 / 200))),
    ('a tick of 1 ms', 952.0, 60, 1e-3, 4, lambda m, rng: lose(
        one_clock(in_ticks(m, 1e-3, 0.123456789)), 1e-3, rng)),
    ('a tick of 10 ms', 104.0, 60, 1e-4, 0, lambda m, _: one_clock(in_ticks(m, 1e-2, 0))),
    ('a tick of an interval', 9.862, 800, 1e-4, 0, lambda m, _: one_clock(in_ticks(m, 0.1, 0))),
    # A grid of the tick has its empty places, too: the receive stamps do not lie on it.
    ('a tick of 10 ms, one of 12 lost', 62.5, 60, 1e-4, 0,
     lambda m, _: in_ticks(m, 1e-2, 0).pick(m.place % 12 > 0)),
    ('a tick of 1 ms, a tenth lost, late receive stamps', 833.0, 6, 1e-3, 2,
     lambda m, rng: lose(in_ticks(late_receive(m, rng), 1e-3, 0), 0.1, rng)),
    ('a timer of 1 ms reads 952 Hz, late receive stamps', 952.0, 6, 1e-3, 0,
     lambda m, rng: late_receive(read_by_timer(m, rng, 1e-3, 3e-5), rng)),
    # Over a third of a second, its beat with the timer is as regular as messages dropped in turn.
    *((f'a timer of 1 ms reads 833 Hz for {lasts} s', 833.0, lasts, 2e-3, 0,
       lambda m, rng: late_receive(read_by_timer(m, rng, 1e-3, 5e-5), rng))
      for lasts in (0.5, 1.2)),
    ('a timer of 5 ms reads 166 Hz, an outage', 166.0, 1.8, 5e-3, 0, lambda m, rng: one_clock(
        read_by_timer(m, rng, 5e-3, 1e-4)).pick(abs(m.place - 100) > 4)),
    ('1101', 100.0, 150, 1e-3, 2, lambda m, _: lose(m, '1101')),
    ('one lost after three to thirteen', 200.0, 1.75, 1e-4, 0, lambda m, _: one_clock(m).pick(
        ~np.isin(m.place, np.cumsum(np.random.default_rng(1).integers(3, 14, 40) + 1) - 1))),
    ('11100 by one clock', 5.0, 1200, 1e-3, 2, lambda m, _: lose(one_clock(m), '11100')),
    ('batches that hide what is dropped in turn', 100.0, 50, 1e-3, 2,
     lambda m, _: dated_back(m, 8, 1.08).pick(m.place % 4 != 0)),
    ('batches dated back', 1000.0, 60, 1e-4, 0, lambda m, _: dated_back(m, 16, 1.08, 1000.0)),
    ('most lost of late receive stamps', 800.0, 20, 1e-3, 50, lambda m, rng: lose(
        received(m, m.receive), 0.55, rng)),
    *((f'overruns of {share}, {shifts=}', 100.0, 150, rel, 200 * shifts, partial(
        overrun, share=share, shifts=shifts))
      for share, shifts, rel in ((0.05, False, 1e-4), (0.01, True, 1e-3))),
    ('a fifth late by more than half', 100.0, 150, 1e-4, 0, partial(late_by_half, by=0.6)),
    ('a fifth late by less than half', 100.0, 150, 1e-3, 9, lambda m, rng: lose(
        late_by_half(m, rng, 0.4), 0.1, rng)),
    ('jitter beside gaps', 800.0, 10.5, 1e-4, 0, lambda m, rng: replace(
        m, header=np.maximum.accumulate(m.header + rng.exponential(2.5e-4, len(m.place)))
        + 1e-8 * m.place).pick(m.place % 178 >= 46)),
]


@pytest.mark.parametrize(('rate_hz', 'duration_s', 'rel', 'off', 'spoil'), [
    pytest.param(*case, id=name) for name, *case in STAMPS])
def test_rate_and_losses_are_right_whatever_the_stamps(rate_hz, duration_s, rel, off, spoil):
    messages, truth, rng = rest(rate_hz, duration_s)
    kept = spoil(messages, rng)
    summary, _ = run(kept.block())
    assert summary.timeline.sample_rate_hz == pytest.approx(truth.rate_hz, rel=rel)
    assert off or not unsure(summary.remarks)
    assert summary.timeline.missing == pytest.approx(missed(kept), abs=off)
    assert (summary.timeline.samples, summary.timeline.duplicates) == (len(kept.place), 0)
    assert 'rate_changed' not in codes(summary)
    assert run(cut(kept.block(), range(0, len(kept.place), 997)))[0] == summary


@pytest.mark.parametrize(('rate_hz', 'lost', 'late_s', 'count'), [
    (416.0, 0, 2e-4, 4160), (666.0, 0, 2e-4, 6660), (1000.0, 0.1, 0, 9000), (1000.0, 0.5, 0, 5000),
    (500.0, 0, 1e-3, 5000), (750.0, 0, 1e-3, 1000), (800.0, 0, 3e-4, 300), (833.0, 0, 1e-3, 8330),
    (900.0, 0, 1e-3, 9000), (952.0, 0, 3e-4, 3000), (1000.0, 0.05, 1e-3, 3000)])
@pytest.mark.parametrize('later_s', [0, 2e-4])
def test_late_stamps_in_whole_milliseconds_leave_the_rate_right(
        rate_hz, lost, late_s, count, later_s):
    messages, truth, rng = rest(rate_hz, count / (1 - lost) / rate_hz)
    n, since = len(messages.place), scenarios.START_NS % 10**6 / 1e9
    late = np.maximum.accumulate(messages.header + rng.exponential(late_s, n))
    received = np.maximum.accumulate(late + rng.exponential(later_s, n))
    header, receive = (np.floor((stamps + since) * 1e3 + 1e-3) / 1e3 - since
                       for stamps in (late, received))
    kept = lose(replace(messages, header=header, receive=receive), lost, rng)
    timeline = run(kept.block())[0].timeline
    assert timeline.sample_rate_hz == pytest.approx(truth.rate_hz, rel=max(2e-3, 2 / count))
    # Some of those that are late share their stamp with the one before.
    assert timeline.missing == pytest.approx(missed(kept) + timeline.duplicates, abs=10)


@pytest.mark.parametrize('lost', [0.05, 0.1, 0.15])
@pytest.mark.parametrize(('rate_hz', 'tick', 'count'), [
    (100.0, 1e-3, 1000), (208.0, 1e-3, 300), (400.0, 1e-3, 2000), (416.0, 1e-3, 300),
    (416.0, 1e-3, 4000), (562.5, 1e-3, 1000), (660.0, 1e-3, 1000), (741.0, 1e-3, 2000),
    (41.6, 1e-2, 300), (60.0, 1e-2, 1000), (100.0, 4e-3, 2000), (3200.0, 1.25e-4, 2000)])
def test_losses_of_a_sensor_in_ticks_are_not_those_of_one_as_fast_as_the_ticks(
        rate_hz, tick, count, lost):
    messages, truth, rng = rest(rate_hz, count / rate_hz)
    kept = lose(one_clock(in_ticks(messages, tick, 0.3 * tick)), lost, rng)
    summary, _ = run(kept.block())
    assert not unsure(summary.remarks)
    assert summary.timeline.sample_rate_hz == pytest.approx(truth.rate_hz, rel=max(
        5e-4, 3 / count))
    assert summary.timeline.missing == pytest.approx(missed(kept), abs=5)


@pytest.mark.parametrize(('rate_hz', 'lost'), [(833.0, 0.05), (833.0, 0.15), (952.0, 0.1)])
def test_losses_in_ticks_nearly_as_long_as_the_interval_are_bounded(rate_hz, lost):
    messages, truth, rng = rest(rate_hz, 3)
    kept = lose(one_clock(in_ticks(messages, 1e-3, 3e-4)), lost, rng)
    summary, _ = run(kept.block())
    hidden, rate = unsure(summary.remarks), summary.timeline.sample_rate_hz
    assert truth.rate_hz * (1 - hidden) < rate < 1.002 * truth.rate_hz


@pytest.mark.parametrize(('lost', 'more', 'clocks'), [
    (0.1, 0, 1), (0.6, 0, 1), ('1110', 0, 2), ('1110', 0.1, 2), ('1' * 9 + '0', 0.1, 2),
    ('1' * 20 + '000' + '1' * 21 + '000', 0, 1), ('1' * 9 + '00' + '1' * 10 + '00', 0.1, 1)])
def test_a_sensor_as_fast_as_its_ticks_stays_so_whatever_is_lost(lost, more, clocks):
    messages, truth, rng = rest(1000.0, 3)
    if clocks == 1:
        messages = one_clock(messages)
    kept = lose(lose(messages, lost, rng), more, rng)
    timeline = run(kept.block())[0].timeline
    assert timeline.sample_rate_hz == pytest.approx(truth.rate_hz, rel=1e-4)
    assert timeline.missing == missed(kept)


@pytest.mark.parametrize('lost', ['1110', '1' * 9 + '0'])
def test_losses_in_turn_and_at_random_may_be_those_of_a_slower_sensor_in_ticks(lost):
    messages, truth, rng = rest(1000.0, 3)
    kept = lose(lose(one_clock(messages), lost, rng), 0.05, rng)
    summary, _ = run(kept.block())
    # The bound includes a sensor as fast as the ticks.
    assert summary.timeline.sample_rate_hz < truth.rate_hz * lost.count('1') / len(lost)
    assert summary.timeline.sample_rate_hz > 0.999 * truth.rate_hz * (1 - unsure(summary.remarks))


@pytest.mark.parametrize(('first', 'count', 'copied'), [
    (0, 50, False), (0, 300, False), (1000, 50, False), (0, 300, True), (0, 1500, True)])
def test_a_header_clock_that_stands_still_for_a_while_leaves_the_rate_right(first, count, copied):
    messages, truth, _ = rest(duration_s=30)
    messages.header[first:first + count] = messages.header[first]
    summary, _ = run((one_clock(messages) if copied else messages).block())
    assert summary.timeline.sample_rate_hz == pytest.approx(truth.rate_hz, rel=1e-3)
    assert (summary.timeline.duplicates, summary.timeline.missing) == (count - 1, count - 1)
    assert not codes(summary)


@pytest.mark.parametrize(('share', 'where', 'axes'), [
    (0.2, 'start', 3), (0.3, 'middle', 3), slow(0.6, 'end', 3), (0.3, 'end', 1)])
def test_a_frozen_sensor_is_left_out_and_reported(share, where, axes):
    messages, truth, _ = gyro()
    messages.samples[:, axes:] = np.nan
    n = len(messages.place)
    lasts = int(share * n)
    first = {'start': 0, 'middle': (n - lasts) // 2, 'end': n - lasts}[where]
    messages.samples[first:first + lasts] = messages.samples[max(first - 1, 0)]
    result = characterized(messages)
    assert_right(result, truth, axes=axes)
    assert not scenarios.false_terms(result)
    assert 'motion' not in codes(result)
    assert result.timeline.rejected == pytest.approx(lasts, abs=1)
    assert said(result, 'frozen').values == {
        'messages': result.timeline.rejected,
        'since_s': pytest.approx(messages.header[first], abs=0.011)}


@pytest.mark.parametrize(('step', 'lost', 'axes'), [
    (5.0, 0.0, 6), (1.5, 0.2, 6), (3.0, 0.05, 6), (1.0, 0.0, 1), (3.0, 0.0, 1)])
def test_a_coarse_output_is_neither_frozen_nor_at_the_end_of_its_range(step, lost, axes):
    messages, _, rng = gyro()
    messages.samples += rng.uniform(-5, 5, 6) * SIGMA
    messages.samples = np.rint(messages.samples / (step * SIGMA)) * step * SIGMA
    messages.samples[:, axes:] = np.nan
    kept = lose(messages, lost, rng)
    result = characterized(kept)
    assert codes(result).isdisjoint(
        {'frozen', 'held_values', 'saturated', 'deadband', 'stood_still'})
    assert result.timeline.samples == len(kept.place)


@pytest.mark.parametrize('lost', [slow(0.3), 0.5, 0.6, slow('110'), '11000'])
def test_many_missing_samples_leave_the_noise_density_right(lost):
    messages, truth, rng = gyro()
    result = characterized(lose(messages, lost, rng))
    assert result.timeline.sample_rate_hz == pytest.approx(truth.rate_hz, rel=2e-3)
    off = lost in (0.6, '11000')
    assert said(result, 'many_missing').values['density_error_share'] == (0.25 if off else None)
    assert_right(result, truth, 0.25 if off else 0.04)


@pytest.mark.parametrize(('lost', 'duration_s', 'records', 'most'), [
    (0.2, 60, 3, 0.09),
    # Two standard errors of 600 axes.
    *(slow(lost, duration_s, 100, 0.068) for lost in (0.1, 0.4) for duration_s in (60, 300))])
def test_intervals_miss_the_noise_density_in_five_of_a_hundred(lost, duration_s, records, most):
    outside = []
    for seed in range(9000, 9000 + records):
        messages, truth, rng = rest(duration_s=duration_s, seed=seed)
        for axis in characterized(lose(messages, lost, rng)).axes.values():
            low, high = axis.coefficients['noise_density'].ci95
            outside.append(not low <= truth.density <= high)
    assert np.mean(outside) < most


@pytest.mark.parametrize('lost', [0.8, '10100'])
def test_stamps_that_hide_losses_say_how_far_the_noise_density_may_be_off(lost):
    messages, truth, rng = gyro()
    if isinstance(lost, str):
        # Else the other clock would tell.
        messages.receive = messages.header.copy()
    result = characterized(lose(messages, lost, rng))
    too_high = unsure(result.warnings, 'density_high_share')
    assert too_high > 0
    for axis in result.axes.values():
        density = axis.coefficients['noise_density']
        assert 0.95 < density.value / truth.density < 1 + too_high
        low, high = density.ci95
        assert low < truth.density < high


@pytest.mark.parametrize('batch', [1.0, 10 / 119])
def test_headers_in_whole_seconds_or_batches_are_no_witness_against_losses(batch):
    messages, _, _ = rest(119.0, 60)
    apart = 1e-9 * messages.place if batch < 1 else 0.0
    messages.header = np.floor(messages.header / batch) * batch + apart
    summary, _ = run(messages.pick(messages.place % 9 != 0).block())
    assert unsure(summary.remarks) == pytest.approx(1 / 9, abs=1e-3)


@pytest.mark.parametrize('offset', [0.3, 0.5])
@pytest.mark.parametrize(('apart', 'noisier'), [
    (APART / 2, 0.0), (APART / 2, 2.0), (0.2 * SIGMA * np.array([1, -1, -1, 1, 1, -1]), 0.0)])
def test_two_publishers_with_one_frame_id_are_reported(apart, noisier, offset):
    messages, _, rng = rest(100, 60)
    messages.header = (messages.place // 2 + offset * (messages.place % 2)) * 2 / 100
    second = messages.samples[1::2]
    second += apart + noisier * SIGMA * rng.normal(size=second.shape)
    assert 'several_publishers' in codes(run(one_clock(messages).block())[0])


def hum(cycles, axes, noise=1.0, wander=0.0):
    """Give noise and a vibration, so large on each axis."""
    return lambda white: noise * white + np.array(axes) * np.cos(
        2 * np.pi * cycles * np.arange(len(white)) + wander * np.cumsum(white[:, 0]))[:, None]


def coarse(sigma, *filtered):
    """Give filtered noise of `sigma` steps, anywhere between two of them."""
    return lambda white: 0.00106 * np.rint(
        sigma * lfilter(*filtered, white, axis=0) + white[0] / 3)


@pytest.mark.parametrize(('lost', 'output'), [
    *((lost, lambda white, up=up, down=down: lfilter(up, down, white, axis=0) + white[0])
      for lost in (0.0, 0.2) for up, down in (
          ([1, -3, 3, -1], [1]), ([1], [1, 0.9]), butter(2, 0.9, 'high'))),
    *((0.2, hum(cycles, [3] * 6)) for cycles in (0.02, 0.25, 1 / 3)),
    *((0.02, hum(cycles, [0, 3, 0, 0, 0, 3])) for cycles in (0.45, 0.498)),
    *((0.0, hum(0.31, [1, 0.5, 0.3, 1, 1, 2], 0.3, wander)) for wander in (0.0, 0.3)),
    *((0.0, coarse(sigma, [1, -back], [1])) for sigma in (0.2, 0.5) for back in (0.0, 0.7)),
])
def test_no_output_of_one_sensor_passes_for_two(lost, output):
    rng = np.random.default_rng(0)
    for seed in range(3):
        samples = output(np.random.default_rng(100 + seed).normal(size=(4096, 6)))
        assert not alternates(samples[rng.random(4096) >= lost])


@pytest.mark.parametrize(('every', 'size'), [(20, 8), (64, 1000)])
def test_an_outlier_in_every_so_many_samples_does_not_pass_for_a_second_sensor(every, size):
    messages, _, _ = rest(100, 60)
    messages.samples[::every] += size * SIGMA
    assert 'several_publishers' not in codes(run(messages.block())[0])


@pytest.mark.parametrize(('speed', 'back_s'), [
    (0.01, 0), (0.1, 0), (1.08, 0), (10.0, 0), (1000.0, 0), (10.0, 500.0), (1.0, 3600.0)])
def test_clocks_of_different_speed_are_reported(speed, back_s):
    messages, _, _ = rest()
    messages.header *= speed
    ratio = messages.header[-1] / messages.receive[-1]
    messages.header[len(messages.place) // 2:] -= back_s
    summary, _ = run(messages.block())
    assert ('clock_jumps' in codes(summary)) == (back_s > 0)
    assert [one.values for one in summary.remarks if one.code == 'clock_speed'] == (
        [{'ratio': pytest.approx(ratio, rel=5e-3)}] if speed != 1 else [])
    # Whoever chooses a clock knows that it is right, as that of a replay or a simulation.
    assert 'clock_speed' not in codes(run(messages.block(), clock='header')[0])


@pytest.mark.parametrize('rate_hz', [200.0, 2000.0])
@pytest.mark.parametrize('speed', [0.1, 0.5, 0.9, 1.1, 2.0, 10.0])
def test_clocks_of_different_speed_are_reported_of_short_recordings(speed, rate_hz):
    messages, _, _ = rest(rate_hz, 1800 / rate_hz)
    messages.header *= speed
    summary, _ = run(messages.block())
    assert said(summary, 'clock_speed').values == {'ratio': pytest.approx(speed, rel=0.01)}


def test_clocks_of_different_speed_are_reported_though_the_first_run_is_one_message():
    messages, _, _ = rest()
    messages.header *= 10
    first, others = cut(messages.block(), [1])
    stage = TimelineStage(TimelineOptions())
    stage.push(first)
    stage.break_run()
    stage.push(others)
    assert said(stage.summary(), 'clock_speed').values == {'ratio': pytest.approx(10, rel=5e-3)}


@pytest.mark.parametrize('duration_s', [3, 4, 6, 30])
@pytest.mark.parametrize('stalls', [[(0, 2)], [(0.7, 1.2), (2.5, 3)]])
def test_messages_that_waited_in_a_queue_make_no_clock_wrong(duration_s, stalls):
    messages, _, _ = rest(100, duration_s)
    for first, last in stalls:
        waited = (first < messages.receive) & (messages.receive < last)
        messages.receive[waited] = last + 1e-5 * messages.place[waited]
    messages.receive = np.maximum.accumulate(messages.receive)
    assert 'clock_speed' not in codes(run(messages.block())[0])


@pytest.mark.parametrize(('rate_hz', 'duration_s', 'batch_s', 'speed'), [
    (200, 3, 0.7, 1.0), (400, 5, 2.0, 1.0), *((1000, 60, 0.3, speed) for speed in (0.9, 1.0, 1.1)),
    *((4000, 30, 0.2, speed) for speed in (0.9, 1.0, 2.0))])
def test_batches_neither_hide_nor_feign_clocks_of_different_speed(
        rate_hz, duration_s, batch_s, speed):
    messages, _, _ = rest(rate_hz, duration_s)
    messages.header *= speed
    messages.receive = batch_s * np.ceil(messages.receive / batch_s) + 1e-6 * messages.place
    found = [one.values['ratio'] for one in run(messages.block())[0].remarks
             if one.code == 'clock_speed']
    assert found == ([] if speed == 1 else [pytest.approx(speed, rel=0.02)])


def test_messages_that_all_waited_in_a_queue_make_no_clock_wrong():
    messages, _, _ = rest(200, 5)
    messages.receive = 5 + 1e-4 * messages.place
    assert 'clock_speed' not in codes(run(messages.block())[0])


@pytest.mark.parametrize(('first', 'by_header_s', 'by_receive_s'), [
    (3000, 0, 3600), (1500, 0, 30), (2000, 0, -10), (2500, -10, -10), (1000, 3e8, 3e8),
    (2995, -30, 0), (2995, 0, 3600), (0, 0, 0)])
@pytest.mark.parametrize('queue_s', [0, 15])
def test_a_step_of_a_clock_or_what_waited_at_the_start_makes_no_clock_fast_or_slow(
        first, by_header_s, by_receive_s, queue_s):
    messages, _, _ = rest(100, 60)
    messages.receive = np.maximum(messages.receive, queue_s + 1e-6 * messages.place)
    messages.header[first:] += by_header_s
    messages.receive[first:] += by_receive_s
    assert 'clock_speed' not in codes(run(messages.block())[0])


def test_a_clock_that_begins_anew_in_a_short_recording_is_not_slow():
    messages, _, _ = rest(1000, 5)
    messages.header[2400:] -= messages.header[2400]
    assert 'clock_speed' not in codes(run(messages.block())[0])


def numbers(result, axes):
    return [axis.coefficients['noise_density'].value for name, axis in result.axes.items()
            if name.startswith(axes)]


@pytest.mark.parametrize('late', [slow(1000), 3500, 5500])
def test_an_axis_that_is_dead_first_has_no_numbers_and_costs_the_others_nothing(late):
    messages, truth, rng = gyro()
    messages.samples[:late, 0] = 0.0
    result = characterized(messages, rng)
    assert said(result, 'stood_still').values == {
        'start_s': 0.0, 'duration_s': pytest.approx(late / 100, abs=1)}
    assert numbers(result, 'gyro') == [None, *2 * [pytest.approx(truth.density, rel=0.03)]]
    assert not scenarios.false_terms(result)
    assert result.timeline.motion == ()


@pytest.mark.parametrize(('rate_hz', 'dead'), [
    (100.0, [(0, 0.2), (0.5, 0.7)]), (1000.0, [(0.4, 0.6)]), slow(1000.0, [(0.1, 0.9)])])
def test_an_axis_that_dies_and_wakes_again_is_no_motion(rate_hz, dead):
    messages, truth, _ = rest(rate_hz, 30_000 / rate_hz)
    for first, last in dead:
        part = slice(int(first * 30_000), int(last * 30_000))
        messages.samples[part, 3:] = messages.samples[part.start, 3:]
    result = characterized(messages)
    assert {name for name, axis in result.axes.items() if axis.stood_still} == {
        'accel_x', 'accel_y', 'accel_z'}
    assert numbers(result, 'accel') == [None] * 3
    assert numbers(result, 'gyro') == [pytest.approx(truth.density, rel=0.03)] * 3
    # Values that are held are no mean: at 1 kHz their edges look like knocks.
    assert sum(span.duration_s for span in result.timeline.motion) < 3.1 * 2 * len(dead)


@pytest.mark.parametrize('declared', [True, False])
@pytest.mark.parametrize(('first', 'last', 'used'), [
    (0, 6000, False), (5000, 15_000, True), (9000, 9100, True)])
def test_the_first_messages_say_which_axes_are_used(first, last, used, declared):
    messages, truth, rng = rest()
    gone = (messages.place >= first) & (messages.place < last)
    if declared:
        messages.absent[gone, 1] = True
    else:
        messages.samples[gone, 3:] = np.nan
    result = characterized(messages, rng)
    assert_right(result, truth, 0.05, axes=6 if used else 3)
    assert result.timeline.rejected == used * (last - first)
    assert result.timeline.motion == ()
    others = last - first if used else 15_000 - last
    if others > 150:
        assert said(result, 'field_absent').values == {'messages': others}


def test_blocks_and_saves_make_no_difference_where_axes_come_and_go():
    messages, _, rng = rest(duration_s=60)
    messages.absent[1000:3500, 1] = True
    messages.samples[4500:4650, 0] = np.nan
    messages.samples[rng.random(len(messages.place)) < 0.01, 4] = np.nan
    whole = characterized(messages).to_dict()
    for seed in range(2):
        assert characterized(messages, np.random.default_rng(seed)).to_dict() == whole


def test_a_rate_that_changes_too_little_to_be_cut_out_leaves_the_noise_density_right():
    messages, truth, _ = gyro(duration_s=300)
    time = np.cumsum(np.where(messages.place < 15_000, 1.0, 1 / 1.018)) / truth.rate_hz
    result = characterized(replace(messages, header=time, receive=time + 1e-3))
    assert_right(result, replace(truth, rate_hz=30_000 / time[-1]), 0.015)


@pytest.mark.parametrize('axes', [[2], [0, 1, 2], [*range(6)]])
def test_what_gives_one_value_for_minutes_and_then_noise_is_used_after_another_minute(axes):
    messages, _, _ = rest(100, 500)
    messages.samples[:10_000, axes] = messages.samples[0, axes]
    summary, even = run(messages.block())
    assert summary.motion.cut.total_s < 110
    assert sum(len(block) for block in even) > 37_000


def test_where_two_publishers_pass_for_motion_the_refusal_names_them():
    messages, _, _ = rest()
    # In turn at first, and then for two seconds each.
    second = np.where(messages.place < 4096, messages.place % 2, messages.place // 200 % 2) == 1
    messages.samples[second] += 100 * APART
    with refused(f'{scenarios.MOVES}; {scenarios.OR_TWO}'):
        characterized(messages)


@pytest.mark.parametrize(('rate_hz', 'share', 'outlier'), [
    (100.0, 0.003, 0.0), (2700.0, 0.0003, 0.0), (1000.0, 0.01, 30 * SIGMA)])
def test_outliers_cost_nothing_but_themselves_however_rare(rate_hz, share, outlier):
    messages, truth, rng = gyro(rate_hz, 60)
    hit = rng.random(len(messages.place)) < share
    hit[1000] = True
    messages.samples[hit] = outlier * rng.choice([-1, 1], (np.count_nonzero(hit), 6))
    result = characterized(messages)
    assert_right(result, truth, 0.04 if share < 0.01 else 0.03)
    # Among many, some are neighbours of each other.
    assert share == 0.01 or result.timeline.motion == ()
    many = pytest.approx(np.count_nonzero(hit), rel=0.05 if share == 0.01 else 0)
    assert result.timeline.rejected == many
    assert said(result, 'spikes').values == {'messages': many}


@pytest.mark.parametrize('at', [0, 1, 3583, 3584, 4095, 4096, 5997, 5999])
def test_a_single_wild_value_is_left_out_wherever_it_lies(at):
    messages, _, _ = rest(duration_s=60)
    messages.samples[at, 1] = 1.0
    summary, even = run(messages.block())
    assert summary.timeline.rejected == 1
    assert summary.timeline.motion == ()
    assert max(abs(block.samples[:, 1]).max() for block in even) < 6 * SIGMA


@pytest.mark.parametrize('ratio', [slow(1.05), 1.3, 2.0, 2.3])
def test_a_sensor_polled_faster_than_it_samples_has_its_own_rate(ratio):
    messages, truth, rng = gyro()
    poll_hz = ratio * truth.rate_hz
    polls = np.arange(1, int(messages.header[-1] * poll_hz)) / poll_hz
    newest = messages.pick(np.floor(polls * truth.rate_hz + 1e-6).astype(int))
    late = rng.exponential(0.3 / poll_hz, len(polls))
    result = characterized(replace(
        newest, header=polls, receive=np.maximum.accumulate(polls + late) + 1e-4))
    assert_right(result, truth, 0.02)
    assert result.timeline.sample_rate_hz == pytest.approx(truth.rate_hz, rel=1e-3)
    assert result.timeline.missing == 0
    assert said(result, 'held_values').values == {'share': pytest.approx(1 - 1 / ratio, abs=5e-3)}


@pytest.mark.parametrize('again', [0.05, 0.3])
def test_a_sample_repeated_in_place_of_a_new_one_leaves_the_rate_as_it_is(again):
    messages, truth, rng = gyro()
    rows = np.arange(len(messages.place))
    rows -= (rng.random(len(rows)) < again) & (rows > 0)
    summary, _ = run(replace(messages, samples=messages.samples[rows]).block())
    assert summary.timeline.sample_rate_hz == pytest.approx(truth.rate_hz, rel=1e-3)


def test_a_sensor_of_less_than_four_hertz_has_a_result():
    messages, truth, rng = gyro(2.0, 2000)
    result = characterized(lose(messages, 0.01, rng))
    assert_right(result, truth, 0.06)


def test_a_slow_turn_is_reported():
    messages, _, _ = gyro()
    turn = np.clip(np.minimum(messages.header - 60, 90 - messages.header) / 5, 0, 1)
    messages.samples[:, 2] += 0.01 * turn
    result = characterized(messages)
    turned = result.axes['gyro_z'].coefficients
    assert not any(turned[key].observable for key in scenarios.SLOW)
    assert turned['rate_random_walk'].upper95 > 0
    slow = said(result, 'slow_motion')
    assert (slow.axes, slow.values['count']) == (('gyro_z',), 1)
    assert [slow.values[name] for name in ('size', 'start_s', 'duration_s')] == [
        pytest.approx(0.011, abs=1e-3), pytest.approx(65, abs=5), pytest.approx(25, abs=5)]


@pytest.mark.parametrize('term', ['rate_random_walk', 'bias_instability'])
def test_drift_of_the_sensor_is_no_slow_turn(term):
    messages, _, rng = rest(duration_s=600)
    count = len(messages.place)
    drift = (np.cumsum(rng.normal(size=(count, 6)), axis=0) * 3e-4 if term == 'rate_random_walk'
             else np.fft.irfft(np.fft.rfft(rng.normal(size=(count, 6)), axis=0)
                               / np.sqrt(np.arange(count // 2 + 1) + 1)[:, None], axis=0))
    messages.samples += drift
    assert 'slow_motion' not in codes(run(messages.block())[0])


@pytest.mark.parametrize(('motion', 'tilt'), [('keep', 3.0), ('exclude', 0.5)])
def test_an_imu_without_noise_that_is_tilted_once_gives_a_result(motion, tilt):
    messages, _, _ = rest()
    messages.samples[:] = [0, 0, 0, 0, 0, 9.81]
    messages.samples[5000:] += [0, 0, 0, tilt, 0, -tilt / 3]
    result = characterized(messages, motion=motion)
    assert len(result.axes) == 6
    assert not result.axes['gyro_x'].coefficients['noise_density'].observable


@pytest.mark.parametrize('verdict', [
    *(partial(verdict, seed, axes_there=1) for seed in (
        401_589,        # changes of rate that crossed were sought about the same messages
        5_001_633,      # one of three dropped, header stamps late: a grid of half as many fits
        5_001_745,      # two of five lost from overlapping batches: the bound was too narrow
        5_000_926,      # batches with outages as long: all samples were at another rate, the same
        5_001_018)),    # one to six samples between outages: the shortest passed for rest
    *(partial(verdict, seed, 6000, 3, kinds=MORE_FAULTS) for seed in (
        97_000_384,     # .9 s of late stamps every 11 s passed for what is read from a FIFO
        99_000_103,     # messages that waited for a late one passed for ticks
        99_000_339,     # a vibration beside drops and late stamps passed for a second publisher
        99_000_576,     # one of four dropped beside ticks of the header in step with that
        99_001_192)),   # what interpolated samples lack of a vibration made N 2.5 times too high
], ids=lambda verdict: verdict.args[0])
def test_scenarios_that_left_a_number_silently_wrong_do_no_more(verdict):
    assert not verdict().violations


@pytest.mark.parametrize(('seeds', 'more', 'most'), [
    (range(40), {}, 0.01), slow(range(300), {}, 0.01),
    (range(30), {'kinds': MORE_FAULTS}, 0.01),
    slow(range(20_000), {'kinds': MORE_FAULTS, 'axes_there': 3}, 0.002)])
def test_random_faults_leave_no_number_silently_wrong(seeds, more, most):
    verdicts = [verdict(seed, 6000, **{'axes_there': 1, **more}) for seed in seeds]
    wrong = [one for one in verdicts if one.violations]
    assert len(wrong) <= most * len(verdicts), wrong
    assert sum(one.false_terms for one in verdicts) <= 0.03 * sum(one.axes for one in verdicts)
