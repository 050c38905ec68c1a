# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A record as it comes in, and the spectrum that is kept of it."""

from functools import cache
from itertools import pairwise

from characterized import B, ends, K, N, one_axis, shown, taken_in
from hypothesis import given, settings, strategies as st
from imu_allan.characterization.axis import characterize
from imu_allan.noise.allan_deviation import octaves
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.posterior.maximum import maximise
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.record.part_of_record import Part
from imu_allan.noise.record.periodogram import SERIES, SHORTEST
from imu_allan.noise.record.segments import BLOCK, SHORTEST_SEGMENT
from imu_allan.noise.record.signal_over_time import COLUMNS
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from scipy.fft import dct
from whole_lines import refused

SENSOR = {N: 1e-3, B: 3e-4, K: 5e-5}
RECORD = np.stack([simulate(SENSOR, 30_000, 100, seed) for seed in range(2)], axis=1)
POWERS = {'quantization_noise': -1, N: -0.5, B: 0, K: 0.5, 'rate_ramp': 1}
"""Of the sample rate, in the units of the coefficients."""
ROWS = np.random.default_rng(1).normal([[5.0], [-3.0]], 1.0, (2, 9000))
LOUDER = {N: 1e-3, B: 1e-3, K: 1e-4}


def same_state(one, other, rtol=0.0):
    a, b = one.to_state(), other.to_state()
    assert a.keys() == b.keys()
    for key in a:
        if rtol and a[key].dtype.kind != 'U':
            np.testing.assert_allclose(a[key], b[key], rtol=rtol, err_msg=key)
        else:
            np.testing.assert_array_equal(a[key], b[key], err_msg=key)


@cache
def first_axis():
    return characterize(RECORD[:, 0], 100)


@settings(max_examples=25, deadline=None)
@given(st.lists(st.integers(0, len(RECORD)), max_size=30),
       st.lists(st.integers(1, len(RECORD) - 1), max_size=3, unique=True),
       st.integers(0, len(RECORD)))
def test_batches_of_any_size_and_a_saved_state_give_the_same_bits(cuts, gaps, saved):
    whole, split = Estimator(2), Estimator(2)
    for begin, end in pairwise(sorted({0, *gaps, len(RECORD)})):
        whole.update(RECORD[begin:end])
        if end in gaps:
            whole.skip(3)
    for begin, end in pairwise(sorted({0, *cuts, *gaps, saved, len(RECORD)})):
        split.update(RECORD[begin:end])
        if end in gaps:
            split.skip(3)
        if end == saved:
            state = split.to_state()
            # Going on leaves the state as it is.
            Estimator.from_state(state).update(RECORD[::-1])
            split = Estimator.from_state(state)
    same_state(whole, split)


@pytest.mark.parametrize('missing', [-1, 1.5])
def test_only_a_whole_number_of_samples_can_be_missing(missing):
    with refused(f'missing must be a whole number, 0 or above, not {missing}'):
        Estimator().skip(missing)


@pytest.mark.parametrize(('scale', 'faster'), [(3.0, 2.0**-7), (1e-6, 1.0), (7e5, 8.0)])
def test_another_unit_and_rate_change_every_number_by_what_its_own_unit_says(scale, faster):
    plain, other = first_axis(), characterize(scale * RECORD[:, 0], 100 * faster)
    np.testing.assert_allclose(other.curve.tau_s, np.array(plain.curve.tau_s) / faster)
    np.testing.assert_allclose(other.curve.adev, scale * np.array(plain.curve.adev), rtol=1e-9)
    for key, power in POWERS.items():
        one, found = plain.coefficients[key], other.coefficients[key]
        assert found.observable == one.observable
        np.testing.assert_allclose([found.value or 0.0, *ends(found)], scale * faster**power
                                   * np.array([one.value or 0.0, *ends(one)]), rtol=1e-3)


def test_a_constant_changes_only_the_mean_and_reversed_time_not_even_a_short_curve():
    plain, raised = first_axis(), characterize(RECORD[:, 0] + 9.81, 100)
    np.testing.assert_allclose(raised.curve.adev, plain.curve.adev, rtol=1e-7)
    assert raised.mean - plain.mean == pytest.approx(9.81)
    short, reversed_ = (octaves(shown(RECORD[:8000, 0][::step])).avar for step in (1, -1))
    np.testing.assert_allclose(reversed_, short, rtol=1e-9)


def test_memory_does_not_grow_with_the_record():
    estimator, sizes = Estimator(6), []
    rows = np.random.default_rng(0).normal(size=(SHORTEST_SEGMENT, 6))
    # A block of means of 4096 samples fills within 1024 of these.
    for _ in range(1200):
        estimator.update(rows)
        sizes.append(sum(array.nbytes for array in estimator.to_state().values()))
    assert max(sizes) < 2_200_000
    assert max(sizes[1050:]) <= max(sizes[:1050])


def test_a_record_of_nothing_but_short_runs_has_coefficients():
    estimator, rng = Estimator(), np.random.default_rng(4)
    for _ in range(3000):
        estimator.update(1e-3 * rng.standard_normal(20))
        estimator.start_run()
    density = one_axis(estimator, 20.0)[0].coefficients[N]
    assert density.value == pytest.approx(1e-3 / 20**.5, rel=0.03)


def test_many_runs_are_no_more_bands_to_fit_than_one_and_show_the_same_noise():
    rows = simulate({N: 1e-3, B: 3e-4}, 200_000, 25.0, seed=3)
    one, many, rng = Estimator(), Estimator(), np.random.default_rng(3)
    one.update(rows)
    for run in np.split(rows, np.sort(rng.choice(len(rows), 150, replace=False))):
        many.update(run)
        many.start_run()
    [single], [split] = (fit_axes(own.finished(), 1 / 25.0) for own in (one, many))
    assert len(split.groups.frequency) < 1.1 * len(single.groups.frequency)
    for key, truth in ((N, 1e-3), (B, 3e-4)):
        assert split.fit.estimates[key].low < truth < split.fit.estimates[key].high
    assert not split.fit.estimates[K].observable


def test_some_of_the_axes_go_on_alone_as_if_they_had_always_been():
    rows = np.random.default_rng(0).normal(size=(60_000, 5)) + 3.0
    together, alone = Estimator(5), Estimator(2)
    for part in np.array_split(rows[:40_000], 7):
        together.update(part)
        alone.update(part[:, [1, 4]])
    taken = together.select([1, 4])
    for part in np.array_split(rows[40_000:], 3):
        taken.update(part[:, [1, 4]])
        alone.update(part[:, [1, 4]])
    same_state(taken.finished(), alone.finished(), rtol=1e-12)
    assert (together.axes, together.samples) == (5, 40_000)


def test_interpolated_samples_are_no_values_of_the_sensor_however_they_arrive():
    rng = np.random.default_rng(4)
    samples = np.round(rng.normal(size=(3 * SHORTEST_SEGMENT + 77, 2)))
    rows = np.flatnonzero(rng.random(len(samples)) < 0.2)
    samples[rows] = 0.3
    samples[rows[5]] = 99.0
    whole, bits = taken_in(samples, rows), Estimator(2)
    cuts = [0, *np.sort(rng.integers(0, len(samples), 40)).tolist(), len(samples)]
    for first, last in pairwise(cuts):
        low, high = np.searchsorted(rows, [first, last])
        bits.update(samples[first:last], rows[low:high] - first)
        bits = Estimator.from_state(bits.to_state()).copy()
    own = np.delete(samples, rows, axis=0)
    for one in (whole.finished(), bits.finished()):
        assert (one.samples, one.measured) == (len(samples), len(own))
        assert np.array_equal(one.reference + one.census.lowest, own.min(axis=0))
        assert np.array_equal(one.reference + one.census.highest, own.max(axis=0))
        assert np.array_equal(one.census.zeros, np.count_nonzero(own == 0, axis=0))
        assert one.census.step.tolist() == [1.0, 1.0]
    same_state(whole, bits)
    nothing = shown(np.ones(5), range(5))
    assert (nothing.measured, nothing.census.highest[0]) == (0, -np.inf)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, ROWS.shape[1]))
def test_columns_hold_the_mean_and_extremes_of_their_samples(length):
    rows = ROWS[:, :length]
    finished = shown(rows.T)
    columns, level = finished.signal.columns(), finished.reference[:, None]
    parts = np.split(rows, np.arange(columns.width, length, columns.width), axis=1)
    assert len(columns.counts) == len(parts) <= COLUMNS
    assert columns.counts.tolist() == [part.shape[1] for part in parts]
    for found, of in ((columns.low, np.min), (columns.high, np.max), (columns.mean, np.mean)):
        np.testing.assert_allclose(found + level, np.transpose([of(part, axis=1)
                                                                for part in parts]), rtol=1e-12)


@pytest.mark.parametrize('samples', [16, 1000, SERIES, SERIES + 1, 300_001, 2_500_000])
def test_all_degrees_of_freedom_are_used_once_and_the_band_has_no_hole(samples):
    sections = shown(np.random.default_rng(0).normal(size=samples)).periodogram.sections()
    used = sum(section.blocks * (section.last - section.first) for section in sections)
    # What the rest of less than a shortest block leaves out, and every block's own mean.
    assert samples - SHORTEST - samples / 500 < used < samples
    fastest = 1 / (2 * samples)
    for step in sorted({section.step for section in sections}, reverse=True):
        section = max((p for p in sections if p.step == step), key=lambda p: p.length)
        assert section.first / (2 * section.length * step) == pytest.approx(
            fastest, abs=0.51 / (section.length * step))
        fastest = section.last / (2 * section.length * step)
    assert fastest == pytest.approx(0.5, abs=1 / BLOCK if samples > SERIES else 1 / samples)


@pytest.mark.parametrize(('samples', 'expected'), [
    (1000, {(1, 1000)}), (SERIES, {(1, SERIES)}),
    (600_000, {(128, 4688), (16, BLOCK), (1, BLOCK), (1, BLOCK // 8)})])
def test_every_stage_holds_the_transforms_of_its_means(samples, expected):
    rows = np.random.default_rng(2).normal(size=(2, samples)) + np.array([[0.0], [3.0]])
    sections = shown(rows.T).periodogram.sections()
    assert {(section.step, section.length) for section in sections} >= expected
    assert len(sections) == 1 or samples > SERIES
    for section in sections:
        means = rows[:, :samples // section.step * section.step].reshape(
            2, -1, section.step).mean(axis=2)
        part = slice(section.first, section.last)
        if section.coefficients is not None:
            # The last mean is of the half of a cell that there is.
            rest = rows[:, means.shape[1] * section.step:]
            if rest.size:
                means = np.column_stack((means, rest.mean(axis=1)))
            exact = dct(means, norm='ortho')[:, part]
            np.testing.assert_allclose(section.coefficients[:, part], exact, atol=1e-10)
            np.testing.assert_allclose(section.power[:, part], exact**2, atol=1e-8)
        elif section.length == BLOCK:
            assert section.blocks == means.shape[1] // BLOCK
            blocks = means[:, :section.blocks * BLOCK].reshape(2, -1, BLOCK)
            exact = (dct(blocks, norm='ortho')**2).mean(axis=1)[:, part]
            np.testing.assert_allclose(section.power[:, part], exact, rtol=1e-9)


def test_any_part_of_a_record_gives_the_coefficients_of_the_whole():
    finished = shown(simulate(LOUDER, 600_000, 100, 4)).periodogram
    used = finished.segments.used
    assert used <= 16
    for first, last in ((0, used), (0, used // 2), (used // 2, used), (3, 5)):
        groups = Part(finished, 0.01, first, last).groups(0)
        assert (np.diff(groups.frequency) > 0).all()
        _, _, flicker, _ = np.sqrt(maximise(groups, detrend=True).theta)
        assert flicker == pytest.approx(LOUDER[B], rel=0.35)
    # Bands of lines are left out.
    groups = Part(finished, 0.01, 0, 4).groups(0, lines_hz=[0.12])
    assert not ((groups.frequency > 0.106) & (groups.frequency < 0.135)).any()
    assert ((groups.frequency > 0.09) & (groups.frequency < 0.105)).any()
