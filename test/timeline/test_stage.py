# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from hypothesis import example, given, settings, strategies as st
from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.result import Span, Timeline, Total
from imu_allan.state import restored, state_of
from imu_allan.timeline import TimelineOptions, TimelineStage
from imu_messages import codes, cut, rows_by_place, run, said, START_NS, still
import numpy as np
import pytest
from whole_lines import refused


def faulty(seed):
    """Give messages with every fault at once: drops, repeats, swaps, NaN, a gap, a knock."""
    rng, count = np.random.default_rng(seed), 12_000
    block = still(count, seed=seed, late=rng.exponential(0.1, count))
    block.samples[rng.integers(0, count, 5), rng.integers(0, 6, 5)] = np.nan
    block.samples[count // 3:count // 3 + 5] += 0.5
    rows = np.sort(np.concatenate([np.arange(count), rng.integers(0, count, 20)]))
    rows = rows[(rng.random(len(rows)) > 0.01) & ((rows < count // 2) | (rows > count // 2 + 70))]
    for place in rng.integers(1, len(rows), 5):
        rows[[place - 1, place]] = rows[[place, place - 1]]
    return block.part(rows)


def test_clean_messages_come_out_as_they_went_in():
    block = still(10_000)
    summary, even = run(block)
    places, rows = rows_by_place(even)
    assert np.array_equal(places, np.arange(10_000))
    assert np.array_equal(rows, block.samples)
    assert [b.new_run for b in even] == [True] + [False] * (len(even) - 1)
    assert summary.timeline == Timeline(100.0, 10_000, 100.0)
    assert (summary.clock, summary.frame_id, summary.start_time, summary.remarks) == (
        'header', 'imu_link', '2023-11-14T22:13:20Z', ())


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 20), edges=st.lists(st.integers(0, 12_100), max_size=20),
       saved=st.integers(0, 12_000), looked_at=st.integers(1, 12_000))
@example(seed=10, edges=[], saved=0, looked_at=390)
def test_splits_saves_and_looks_make_no_difference(seed, edges, saved, looked_at):
    block = faulty(seed)
    summary, even = run(block)
    stage, blocks, came = TimelineStage(), [], 0
    for part in cut(block, [*edges, saved, looked_at]):
        blocks += stage.push(part)
        came += len(part)
        if came == saved:
            state = state_of(stage)
            assert all(array.dtype != object for array in state.values())
            stage = restored(TimelineStage, state)
        if came == looked_at:
            copy = stage.copy()
            so_far = blocks + copy.flush()
            expected_summary, expected = run(block.part(slice(came)))
            assert stage.summary() == copy.summary() == expected_summary
            assert np.array_equal(rows_by_place(so_far)[1], rows_by_place(expected)[1])
    blocks += stage.flush()
    assert stage.summary() == summary
    for one, other in zip(blocks, even, strict=True):
        assert np.array_equal(one.samples, other.samples)
        assert np.array_equal(one.interpolated, other.interpolated)
        assert (one.first_index, one.new_run) == (other.first_index, other.new_run)


@pytest.mark.parametrize('tolerance', [0, 5])
def test_gaps_up_to_the_tolerance_are_interpolated_and_longer_ones_listed(tolerance):
    block = still(5000)
    gaps = {1000: 1, 2000: 5, 3000: 6, 4000: 21}
    rows = np.delete(np.arange(5000),
                     np.concatenate([np.arange(at, at + n) for at, n in gaps.items()]))
    summary, even = run(block.part(rows), gap_tolerance=tolerance)
    longer = {at: n for at, n in gaps.items() if n > tolerance}
    assert summary.timeline.missing == 33
    assert summary.counts.interpolated == 33 - sum(longer.values())
    assert [(gap.start_s, gap.duration_s) for gap in summary.timeline.gaps] == [
        pytest.approx((at / 100, n / 100), abs=1e-6) for at, n in longer.items()]
    places, rows = rows_by_place(even)
    if tolerance:
        around = np.concatenate([block.samples[1992:2000], block.samples[2005:2013]])
        assert rows[2000:2005] == pytest.approx(np.tile(around.mean(axis=0), (5, 1)), rel=1e-12)
    assert np.array_equal(places, np.setdiff1d(
        np.arange(5000), np.concatenate([[-1], *(np.arange(at, at + n)
                                                 for at, n in longer.items())])))
    assert sum(one.new_run for one in even) == 1
    assert summary.timeline.duration_s == pytest.approx(50.0)


@pytest.mark.parametrize('tolerance', [-1, 0.5, None])
def test_a_gap_is_tolerated_by_a_whole_number_of_samples(tolerance):
    with refused(f'gap_tolerance must be a whole number, 0 or above, not {tolerance}'):
        TimelineOptions(gap_tolerance=tolerance)


@pytest.mark.parametrize('unknown', [[], [4]])
def test_repeated_and_backward_messages_are_counted_and_left_out(unknown):
    block = still(20_000)
    block.samples[:, unknown] = np.nan
    twice = np.sort(np.concatenate([np.arange(20_000), np.arange(500, 20_000, 400)]))
    summary, even = run(block.part(twice))
    assert summary.timeline.duplicates == summary.counts.header.repeats == 49
    assert np.array_equal(rows_by_place(even)[1], block.samples, equal_nan=True)
    swapped, late = np.arange(20_000), np.arange(700, 20_000, 800)
    swapped[late], swapped[late + 1] = late + 1, late
    summary, _ = run(block.part(swapped))
    assert summary.timeline.out_of_order == summary.counts.header.backward == len(late)
    assert summary.timeline.missing == summary.counts.interpolated == len(late)


@pytest.mark.parametrize('value', [np.nan, 1e300, 'absent'])
def test_unusable_values_are_rejected_and_interpolated(value):
    block = still(10_000)
    rows, axes = np.array([100, 5000, 5001, 9000]), np.array([0, 3, 5, 2])
    if value == 'absent':
        block.absent[rows, axes // 3] = True
    else:
        block.samples[rows, axes] = value
    summary, even = run(block)
    assert (summary.timeline.rejected, summary.timeline.missing) == (4, 0)
    assert summary.counts.interpolated == 4
    assert np.isfinite(rows_by_place(even)[1]).all()
    assert summary.present == (True,) * 6


def test_messages_without_any_field_are_refused_until_there_is_one():
    block, stage = still(20_000), TimelineStage()
    block.absent[:10_000] = True
    for part in cut(block, [9000]):
        with refused('the messages carry neither angular velocity nor linear acceleration '
                     '(covariance[0] is -1 or every value is NaN): choose another topic'):
            stage.push(part)
    stage.flush()
    timeline = stage.summary().timeline
    assert (timeline.samples, timeline.rejected) == (10_000, 10_000)


@pytest.mark.parametrize('value', [np.nan, 'absent'])
def test_messages_without_any_field_at_first_do_not_decide_about_those_after_them(value):
    block = still(2000)
    if value == 'absent':
        block.samples[:1500], block.absent[:1500] = 0.0, True
    else:
        block.samples[:1500] = value
    # A driver sets no time either before it measures.
    block.header_ns[:1500] = 0
    summary, even = run(block)
    assert np.array_equal(rows_by_place(even)[1], block.samples[1500:])
    assert (summary.timeline.samples, summary.timeline.rejected) == (500, 1500)
    assert (summary.clock, summary.remarks) == ('header', ())


@pytest.mark.parametrize('empty', [4001, 4026, 4060, 4090])
def test_the_pace_of_late_stamps_is_that_of_a_whole_window_after_messages_without_any_field(empty):
    random = np.random.default_rng(empty)
    block = still(empty + 20_000, 1000.0, late=np.abs(random.normal(0, 0.4, empty + 20_000)))
    block.samples[:empty] = np.nan
    lost = random.random(len(block)) < 0.01
    summary, _ = run(block.part(~lost))
    assert summary.timeline.sample_rate_hz == pytest.approx(1000.0, rel=1e-3)
    assert summary.timeline.samples == np.count_nonzero(~lost[empty:])
    assert summary.timeline.missing == pytest.approx(np.count_nonzero(lost[empty:]), abs=20)


@pytest.mark.parametrize('value', [np.nan, 'absent'])
def test_messages_without_any_field_later_are_a_gap_and_no_sensor_that_stood_still(value):
    block = still(9000)
    if value == 'absent':
        block.samples[6000:6500], block.absent[6000:6500] = 0.0, True
    else:
        block.samples[6000:6500] = value
    summary, _ = run(block)
    assert (summary.timeline.samples, summary.timeline.rejected) == (8500, 500)
    assert [one.code for one in summary.remarks] == ['field_absent']


def test_an_accelerometer_in_every_second_message_makes_no_second_publisher():
    block = still(6001)
    block.absent[::2, 1] = True
    block.samples[::2, 3:] = 0.0
    summary, _ = run(block)
    assert 'several_publishers' not in {one.code for one in summary.remarks}
    assert said(summary, 'field_absent').values == {'messages': 3001}


def test_of_interleaved_publishers_the_first_is_followed_and_the_other_counted():
    one, other = still(2000), still(2000, seed=1, frame_id='base_link')
    blocks = []
    for at in range(2000):
        blocks += [one.part([at]), other.part([at])]
    summary, even = run(blocks)
    assert np.array_equal(rows_by_place(even)[1], one.samples)
    assert (summary.timeline.samples, summary.timeline.rejected) == (2000, 2000)
    assert said(summary, 'several_frames').values == {
        'frame_id': 'imu_link', 'others': ['base_link'], 'rejected': [2000]}


@pytest.mark.parametrize(('step_s', 'of_both'), [(3600, 0), (-3600, 0), (3600, 1)])
def test_a_step_of_one_clock_begins_a_new_run_and_one_of_both_is_a_gap(step_s, of_both):
    block = still(12_000)
    block.header_ns[7000:] += step_s * 10**9
    block.receive_ns[7000:] += step_s * 10**9 * of_both
    summary, even = run(block)
    assert ('clock_jumps' in codes(summary)) == (not of_both)
    assert summary.counts.clock_jumps == 1 - of_both
    gap = Span(pytest.approx(70.0, abs=1e-3), pytest.approx(3600.0, abs=1e-3))
    assert summary.timeline == Timeline(
        pytest.approx(100.0, rel=1e-6), 12_000, pytest.approx(120.0 + 3600 * of_both, abs=0.1),
        missing=360_000 * of_both, gaps=(gap,) * of_both)
    assert [one.first_index for one in even if one.new_run] == [0, 7000][:2 - of_both]


def test_a_step_of_some_seconds_of_a_slow_sensor_is_no_gap():
    block = still(1200, 20.0)
    block.header_ns[500:] += 6 * 10**9
    summary, _ = run(block)
    assert [one.values for one in summary.remarks] == [{'clock': 'header', 'count': 1}]
    assert (summary.timeline.missing, summary.timeline.gaps) == (0, ())


def test_where_samples_are_counted_a_sensor_freezes_by_their_number():
    block = still(6000)
    block.samples[4200:] = block.samples[4200]
    summary, _ = run(block, rate_hz=50.0, force_rate=True)
    assert said(summary, 'frozen').values['since_s'] == pytest.approx(84.0, abs=0.03)


def test_a_single_stamp_far_back_is_left_out_and_one_far_ahead_is_a_run_of_its_own():
    block = still(12_000)
    block.header_ns[[3000, 9000]] = START_NS + 10**17, 0
    summary, even = run(block)
    assert summary.timeline.out_of_order == summary.timeline.missing == 1
    assert [one.first_index for one in even if one.new_run] == [0, 3000, 3001]
    assert summary.timeline.duration_s == pytest.approx(120)
    assert summary.counts.clock_jumps == 2


def micro_for_nanoseconds(stamps):
    return stamps // 10**9 * 10**9 + stamps % 10**9 // 1000


@pytest.mark.parametrize(('spoil', 'flaw'), [
    (lambda stamps: stamps * 0, 'zero'),
    (lambda stamps: stamps * 0 + 5, 'constant'),
    (lambda stamps: stamps // 10**9 * 10**9, 'in whole seconds'),
    (lambda stamps: stamps // 10**8 * 10**8, 'coarse'),
    (lambda stamps: np.tile([stamps[5], stamps[1]], len(stamps) // 2), 'out of order'),
    (lambda stamps: stamps - 10**8 * (np.arange(len(stamps)) % 100 == 0), 'out of order'),
    (lambda stamps: stamps // 1000, 'too fast')])
def test_unusable_header_stamps_make_receive_stamps_the_clock(spoil, flaw):
    block = still(10_000)
    summary, even = run(replace(block, header_ns=spoil(block.header_ns)))
    assert summary.clock == 'receive'
    assert said(summary, 'receive_clock').values == {'flaw': flaw}
    assert summary.timeline.sample_rate_hz == pytest.approx(100, rel=1e-6)
    assert summary.timeline.missing == 0
    assert np.array_equal(rows_by_place(even)[1], block.samples)
    assert summary.start_time.startswith('2023-11-14T22:13:20')


def test_times_that_advance_as_those_of_no_imu_are_refused():
    block = still(10_000, 400)
    times = micro_for_nanoseconds(block.header_ns)
    assert run(replace(block, header_ns=times))[0].clock == 'receive'
    with refused('the header stamps advance by 2.5e-06 s from message to message, as those of no '
                 'IMU do: choose the other clock (analyze --clock)'):
        run(replace(block, header_ns=times), clock='header')
    with refused('the times advance by 2.5e-06 s from sample to sample, as those of no IMU do: '
                 'mend them or their unit (analyze --columns, --stamp)'):
        run(replace(block, header_ns=times, receive_ns=times))
    times = 10**18 + np.arange(len(block)) * 5000 * 10**9
    with refused('the times advance by 5000 s from sample to sample, as those of no IMU do: '
                 'mend them or their unit (analyze --columns, --stamp)'):
        run(replace(block, header_ns=times, receive_ns=times))


def test_a_table_whose_times_are_out_of_order_is_refused():
    block = still(10_000)
    block.header_ns[::100] -= 10**8
    with refused('the times of the samples are out of order: mend them, or state the sample rate '
                 '(analyze --rate)'):
        run(replace(block, receive_ns=block.header_ns))


def test_a_table_whose_times_begin_anew_has_no_other_clock():
    summary, _ = run(replace(block, receive_ns=block.header_ns)
                     for block in (still(5000), still(5000, seed=1)))
    assert [remark.values for remark in summary.remarks] == [{'clock': 'time', 'count': 1}]


def test_header_stamps_that_stop_hand_over_to_receive_stamps():
    block = still(20_000)
    block.header_ns[12_000:] = block.header_ns[12_000]
    summary, even = run(block)
    assert 'clock_changed' in codes(summary)
    assert summary.clock == 'receive'
    assert summary.timeline.samples + summary.timeline.duplicates == 20_000
    assert summary.timeline.duplicates < 410
    assert summary.timeline.duration_s == pytest.approx(200.0, abs=0.1)
    assert sum(one.new_run for one in even) == 2


def test_the_user_chooses_the_clock():
    block = still(10_000)
    receive = block.receive_ns[0] + (block.receive_ns - block.receive_ns[0]) * 2
    summary, _ = run(replace(block, receive_ns=receive), clock='receive')
    assert summary.clock == 'receive'
    assert summary.timeline.sample_rate_hz == pytest.approx(50.0)
    with refused('header stamps are zero: choose the other clock (analyze --clock) or state the '
                 'sample rate (analyze --rate)'):
        run(replace(block, header_ns=block.header_ns * 0), clock='header')


def test_without_any_usable_stamps_a_stated_rate_counts_samples():
    block = still(10_000)
    block = replace(block, header_ns=block.header_ns * 0, receive_ns=block.receive_ns * 0)
    with refused('the times of the samples are zero: mend them, or state the sample rate '
                 '(analyze --rate)'):
        run(block)
    with refused('header stamps are zero and receive stamps constant: state the sample rate '
                 '(analyze --rate)'):
        run(replace(block, receive_ns=block.receive_ns + 5))
    summary, even = run(block, rate_hz=250.0)
    assert (summary.clock, summary.measured_rate_hz) == (None, None)
    assert summary.timeline == Timeline(250.0, 10_000, pytest.approx(40.0))
    assert 'counted_samples' in codes(summary)
    assert np.array_equal(rows_by_place(even)[1], block.samples)


def test_a_stated_rate_far_from_the_measured_one_is_refused():
    block, stage = still(5000), TimelineStage(TimelineOptions(rate_hz=200.0))
    for _ in range(2):
        with refused('the stated rate is 200 Hz, but the header stamps advance at 100 Hz. Leave '
                     'out the rate, choose the other clock (analyze --clock), or count samples at '
                     'the stated rate (analyze --clock none)'):
            stage.push(block)
    summary, _ = run(block, rate_hz=101.0)
    assert (summary.timeline.sample_rate_hz, summary.measured_rate_hz) == (101.0, 100.0)


def test_without_a_clock_samples_are_counted_whatever_their_stamps():
    block = still(12_000)
    # Every fifth step is twice as long, the clock jumps, and from then on it stands still.
    stamps = block.header_ns + 10_000_000 * (np.arange(12_000) // 5)
    stamps[6000:] += 3600 * 10**9
    stamps[9000:] = stamps[9000]
    summary, even = run(replace(block, header_ns=stamps), rate_hz=200.0, force_rate=True)
    assert summary.timeline == Timeline(200.0, 12_000, pytest.approx(60.0))
    assert (summary.clock, summary.start_time, codes(summary)) == (None, None, {'counted_samples'})
    assert np.array_equal(rows_by_place(even)[1], block.samples)


# The first window decides on all but the last 64 of its 4,096 messages.
@pytest.mark.parametrize('twice', [1000, 4096 - 64 - 1, 4096 - 64])
def test_a_message_delivered_twice_is_one_sample_also_between_two_windows(twice):
    block = still(12_000)
    stage = TimelineStage(TimelineOptions(clock='receive'))
    stage.push(block.part(np.sort(np.append(np.arange(12_000), twice))))
    timeline = stage.summary().timeline
    assert (timeline.samples, timeline.duplicates) == (12_000, 1)


def test_of_refused_stamps_nothing_is_reported():
    block, place = still(5000), np.arange(5000)
    # A FIFO is read every ten samples.
    batches = START_NS + place // 10 * 100_000_000 + place % 10 * 3000
    stage = TimelineStage(TimelineOptions(clock='header', rate_hz=200.0))
    with refused('the stated rate is 200 Hz, but the header stamps advance at 100 Hz. Leave out '
                 'the rate, choose the other clock (analyze --clock), or count samples at the '
                 'stated rate (analyze --clock none)'):
        stage.push(replace(block, header_ns=batches))
    assert not stage.summary().remarks


@pytest.mark.parametrize('other_hz', [110.0, 50.0])
def test_a_rate_change_half_way_is_reported_and_the_other_rate_left_out(other_hz):
    first, then = still(30_000), still(20_000, other_hz, seed=1)
    shift = int(first.header_ns[-1] - START_NS + 1e9 / other_hz)
    then = replace(then, header_ns=then.header_ns + shift, receive_ns=then.receive_ns + shift)
    summary, even = run([first, then])
    assert summary.timeline.sample_rate_hz == pytest.approx(100.0, rel=1e-3)
    change = said(summary, 'rate_changed').values
    assert (change['from_hz'], change['to_hz']) == pytest.approx((100, other_hz), rel=1e-3)
    assert change['at_s'] == pytest.approx(300, abs=3)
    assert change['left_out'] == summary.timeline.rejected == pytest.approx(20_000, abs=300)
    assert len(rows_by_place(even)[0]) == pytest.approx(30_000, abs=300)


def test_a_break_begins_a_new_run_at_the_next_sample():
    one, other = still(6000), still(6000, seed=1)
    stage = TimelineStage()
    blocks = stage.push(one)
    stage = restored(TimelineStage, state_of(stage))
    blocks += stage.break_run()
    pause = 180_000_000_000
    blocks += stage.push(replace(other, header_ns=other.header_ns + pause,
                                 receive_ns=other.receive_ns + pause))
    blocks += stage.flush()
    places, rows = rows_by_place(blocks)
    assert np.array_equal(places, np.arange(12_000))
    assert np.array_equal(rows, np.concatenate([one.samples, other.samples]))
    assert [b.first_index for b in blocks if b.new_run] == [0, 6000]
    summary = stage.summary()
    assert summary.timeline.sample_rate_hz == pytest.approx(100.0)
    (gap,) = summary.timeline.gaps
    assert (gap.start_s, gap.duration_s) == pytest.approx((60.0, 120.0), abs=0.02)


def test_gravity_far_from_its_value_is_reported():
    block = still(2000)
    block.samples[:, 3:] += [1.0, 0, 0.1]
    assert run(block)[0].remarks == ()
    block.samples[:, 3:] += [-1.0, 0, 5 - 9.91]
    assert said(run(block)[0], 'gravity').values == {'mean': pytest.approx(5, abs=1e-2)}
    # A gyroscope whose driver fills the rest of the message with zeros.
    block.samples[:, 3:] = 0.0
    assert not [one for one in run(block)[0].remarks if one.code == 'gravity']


def test_a_stream_of_gaps_lists_a_bounded_number_of_them():
    rows = np.arange(40_000)
    summary, _ = run(still(40_000).part(rows % 20 < 10), motion='keep')
    assert (summary.counts.gaps, summary.counts.gaps_ns) == (1999, 199_900_000_000)
    assert summary.counts.longest_gap_ns == pytest.approx(1e8)
    assert len(summary.timeline.gaps) == 1000
    assert summary.timeline.all_gaps == Total(1999, pytest.approx(199.9))
    assert summary.timeline.missing == 19_990


@pytest.mark.parametrize('count', [0, 1, 2, 50])
def test_short_streams_give_all_their_samples(count):
    block = still(count)
    summary, even = run(block)
    assert sum(map(len, even)) == summary.timeline.samples == count
    if count:
        assert summary.timeline.sample_rate_hz == (pytest.approx(100.0) if count > 1 else None)


def test_state_stays_small_once_the_baseline_is_settled():
    stage, sizes = TimelineStage(), []
    for part in cut(still(200_000, 1000.0), range(0, 200_000, 500)):
        stage.push(part)
        sizes.append(sum(array.nbytes for array in state_of(stage).values())
                     if len(sizes) in (120, 399) else 0)
    assert sizes[399] < 700_000 < sizes[120]


@settings(max_examples=60, deadline=None)
@given(data=st.data(), rate_hz=st.floats(5.0, 5000.0), jitter=st.sampled_from([0.0, 0.02, 0.1]))
def test_lost_samples_are_counted_exactly_at_any_rate(data, rate_hz, jitter):
    count = data.draw(st.integers(300, 5000))
    rng = np.random.default_rng(data.draw(st.integers(0, 1000)))
    block = still(count, rate_hz, late=rng.uniform(0, jitter, count))
    lost = set()
    for _ in range(data.draw(st.integers(0, 12))):
        at = data.draw(st.integers(30, count - 30))
        lost |= set(range(at, min(at + data.draw(st.integers(1, 9)), count - 20)))
    assert_counted(block, lost, rate_hz)


def assert_counted(block, lost, rate_hz):
    places = np.arange(len(block.header_ns))
    summary, even = run(block.part(np.setdiff1d(places, list(lost))), motion='keep')
    assert summary.timeline.missing == len(lost)
    assert summary.timeline.samples == len(places) - len(lost)
    assert sum(len(one.interpolated) for one in even) == summary.counts.interpolated
    assert sum(map(len, even)) == summary.timeline.samples + summary.counts.interpolated
    assert summary.timeline.sample_rate_hz == pytest.approx(rate_hz, rel=2e-3)
    assert 'rate_changed' not in codes(summary)


@pytest.mark.parametrize('lost', [
    [30, 32, 34, 36, 38, 40, 56, 128], [39, 40, 65, 85, 109, 110, 113, 175, 205, 252]])
def test_few_losses_that_are_nearly_even_by_chance_are_no_ticks(lost):
    assert_counted(still(300, 5.0), lost, 5.0)


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_garbage_is_refused_or_survived_and_never_yields_nan(data):
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    count = data.draw(st.integers(1, 9000))

    def stamps():
        places = np.arange(count)
        return data.draw(st.sampled_from([
            lambda: START_NS + places * 10_000_000, lambda: START_NS - places * 10_000_000,
            lambda: rng.integers(0, 10**12, count),
            lambda: rng.choice(np.array([0, 2**63 - 1, -2**63, 1, 10**18]), count),
            lambda: rng.integers(-2**63, 2**63 - 1, count),
            lambda: np.repeat(rng.integers(0, 10**12, count), 50)[:count],
            lambda: START_NS + np.cumsum(rng.integers(-10**7, 3 * 10**7, count)),
            lambda: START_NS + places // 30 * 300_000_000]))()

    samples = rng.normal(size=(count, 6)) * 10.0 ** rng.integers(-300, 300)
    spoilt = rng.random((count, 6)) < data.draw(st.sampled_from([0.0, 0.001, 0.3]))
    samples[spoilt] = rng.choice([np.nan, np.inf, -np.inf, 0.0], np.count_nonzero(spoilt))
    absent = rng.random((count, 2)) < data.draw(st.sampled_from([0.0, 0.01, 0.6, 1.0]))
    block = ImuBlock(stamps(), stamps(), samples, absent, 'imu_link')
    clock = data.draw(st.sampled_from(['auto', 'header', 'receive']))
    rate_hz = data.draw(st.sampled_from([None, 100.0]))
    try:
        summary, even = run(cut(block, rng.integers(0, count, 3)), clock=clock, rate_hz=rate_hz)
    except ImuAllanError:
        return
    timeline = summary.timeline
    assert summary.messages == count == (timeline.samples + timeline.duplicates
                                         + timeline.out_of_order + timeline.rejected)
    assert np.all(np.diff(rows_by_place(even)[0]) >= 1)
    for one in even:
        there = np.isfinite(one.samples)
        assert np.array_equal(there.all(axis=0), there.any(axis=0))
        assert there[0].any()
        assert not np.any(there[0] & ~np.array(summary.present))
    plain = [timeline.duration_s, timeline.sample_rate_hz or 1.0,
             *(gap.start_s for gap in timeline.gaps), *(gap.duration_s for gap in timeline.gaps)]
    assert np.isfinite(plain).all()
    assert min(plain) >= 0


def test_ten_stamps_in_ticks_have_a_rate():
    stamps = START_NS + 1_000_000 * np.cumsum([0, 3, 2, 2, 3, 2, 3, 2, 2, 3])
    block = still(10)
    summary, _ = run(replace(block, header_ns=stamps, receive_ns=stamps))
    assert summary.timeline.sample_rate_hz == pytest.approx(9 / 0.022)
