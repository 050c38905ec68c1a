# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The likelihood of a spectrum, its maximum and its evidence, alone and over records."""

from collections import defaultdict

from characterized import B, joint_fits, K, N, shown, together
from imu_allan.noise import spectrum
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.joint_fit import joint_fit
from imu_allan.noise.posterior import search
from imu_allan.noise.posterior.draws import sample
from imu_allan.noise.posterior.evidence import maximise_rows
from imu_allan.noise.posterior.likelihood import batches, losses, SLOTS
from imu_allan.noise.posterior.maximum import maximise, non_negative
from imu_allan.noise.posterior.prepared_spectra import prepared
from imu_allan.noise.posterior.regression import regress, regressors
from imu_allan.noise.record.bins import bins_of
from imu_allan.noise.record.groups import FLICKER, grouped, RANDOM_WALK, WHITE
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import nnls
from scipy.signal import butter, lfilter

RATE = 100.0
QUIET = {N: 1e-3, B: 4e-4}
MODEL = {N: 1e-3, B: 8e-4, K: 2e-4}


def bins_of_record(samples, dt):
    return bins_of(shown(samples).periodogram.sections(), dt)


@pytest.mark.parametrize('known', ['mean', 'mean and ramp'])
def test_likelihood_is_that_of_the_samples_without_what_is_known_of_their_mean(known):
    dt, place = 0.1, np.arange(48)
    record = simulate({N: 1.0, K: 1.0}, len(place), 1 / dt, 5)
    groups = grouped(bins_of_record(record, dt), 0)
    # Of a random walk from zero, averaged over each interval.
    walk = dt * (np.minimum.outer(place, place) + 0.5 - np.eye(len(place)) / 6)
    columns = np.vander(place, len(known.split(' and ')))
    free = np.linalg.svd(columns)[0][:, columns.shape[1]:]

    def exact(density, walking):
        covariance = free.T @ (density / dt * np.eye(len(place)) + walking * walk) @ free
        rest = free.T @ record
        return 0.5 * (np.linalg.slogdet(covariance)[1] + rest @ np.linalg.solve(covariance, rest))

    def found(density, walking):
        theta = np.array([0.0, density, 0.0, walking])
        weight = groups.dof / (groups.design @ theta)
        gain = regress(regressors([groups]), 1, weight[None])[0][0] if 'ramp' in known else 0.0
        return maximise(groups, fixed=dict(enumerate(theta))).loss - gain

    for other in ((2.0, 0.3), (0.1, 5.0), (1.0, 1e-6)):
        assert found(*other) - found(1.0, 1.0) == pytest.approx(exact(*other) - exact(1.0, 1.0),
                                                                rel=1e-6)


def test_columns_are_the_spectra_of_the_means_of_every_stage():
    dt = 0.5
    sections = shown(simulate({N: 1.0}, 100_000, 1 / dt)).periodogram.sections()
    bins = bins_of(sections, dt)
    assert {section.step for section in sections} == {1, 16}
    for number, section in enumerate(sections):
        here = bins.section == number
        step, nu = section.step * dt, bins.index[here] / (2 * section.length)
        np.testing.assert_allclose(bins.frequency[here], nu / step)
        for column, expected in (
                (WHITE, spectrum.white(nu, step)), (RANDOM_WALK, spectrum.random_walk(nu, step)),
                (FLICKER, spectrum.flicker(nu, step)
                 * spectrum.flicker_dct_factor(bins.index[here]))):
            np.testing.assert_allclose(bins.design[here, column], expected, rtol=1e-12)
        # A ramp has a mean in the whole-record part, whose signs are known; in blocks a square.
        ramp = spectrum.ramp_dct(section.length, step)[bins.index[here] - 1]
        whole = section.coefficients is not None
        np.testing.assert_allclose(bins.ramp[here], ramp**2 if whole else -ramp**2)
        np.testing.assert_array_equal(bins.dof[here], section.blocks)
        assert (bins.whole[here] == whole).all()


def test_maximum_is_found_and_stays_and_no_coefficient_is_negative():
    record = simulate({N: 1e-3, B: 1e-3, K: 2e-4}, 144_000, 20.0, 3)
    groups = grouped(bins_of_record(record, 0.05), 0)
    best = maximise(groups)
    assert np.all(best.theta >= 0)

    def loss(theta):
        expected = groups.design @ theta
        return 0.5 * groups.dof @ (np.log(expected) + groups.power / expected)

    assert loss(best.theta) == pytest.approx(best.loss)
    for column in (WHITE, RANDOM_WALK):
        for factor in (0.98, 1.02):
            other = best.theta.copy()
            other[column] *= factor
            assert loss(other) > best.loss
    # From so far away whole steps lead astray.
    afar = maximise(groups, start=np.array([1e-3, 0.0, 0.0, 0.0]))
    assert afar.loss == pytest.approx(best.loss, abs=1e-6)
    behind = maximise(groups, tolerance=-np.inf)
    # A loss of 1e-6 is a thousandth of a standard error.
    np.testing.assert_allclose(behind.theta, best.theta, rtol=1e-3, atol=1e-15)
    assert best.loss - 1e-6 < behind.loss <= best.loss


def test_small_non_negative_least_squares_agrees_with_scipy():
    rng = np.random.default_rng(1)
    problems = [(rng.standard_normal((12, 4)) * 10.0 ** rng.integers(-6, 7, 4),
                 rng.standard_normal(12)) for _ in range(200)]
    # Columns that cannot be distinguished share what they explain.
    same = np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [3.0, 3.0, 1.0]])
    problems += [(same, np.array([sign, 2 * sign, last])) for sign, last in (
        (1.0, 3.0), (1.0, 9.0), (-1.0, -3.0), (1.0, -9.0))]
    for a, b in problems:
        part = non_negative(a.T @ a, a.T @ b)
        assert (part >= 0).all()
        np.testing.assert_allclose(a @ part, a @ nnls(a, b)[0], atol=1e-6)


def fits_of(*samples):
    return fit_axes(shown(np.transpose(samples)), 1 / RATE)


@pytest.fixture(scope='module')
def spectra():
    fits = fits_of(*(simulate(QUIET, 90_000, RATE, seed) for seed in range(2)))
    return prepared([fit.groups for fit in fits], 1 / RATE)


def test_gradients_are_those_of_the_loss_and_information_is_positive(spectra):
    of, starts = spectra
    # Rows with each shape, somewhere near where they belong.
    x = starts[0].x.copy()
    x[search.LOW] = of.tables.low_pass.first[2] + 2.0
    x[search.HIGH] = of.tables.high_pass.first[0] + 1.0
    x[search.TIME] = of.tables.terms[1].first[0] + 2.1
    x[search.ALPHA] = 0.93
    free, process = (search.LAW, search.ALPHA), (search.PROCESS, search.TIME)
    rows = search.rows_of(of, 0, [search.Model(slots, x, low_pass=2) for slots in (
        [1], range(4), [1, *free], [1, 2, *process], [1, 2, search.LOW], [1, 2, search.HIGH],
        [*range(5), *process, search.LOW])])
    for part in batches(rows):
        own = rows.take(part)
        _, gradient, information = losses(of, own, own.x)
        np.testing.assert_allclose(information, information.transpose(0, 2, 1))
        assert np.linalg.eigvalsh(information).min() > 0
        for slot in range(SLOTS):
            step = np.zeros(SLOTS)
            step[slot] = 1e-5
            up, down = (losses(of, own, own.x + sign * step)[0] for sign in (1, -1))
            expected = np.where(own.present[:, slot], (up - down) / 2e-5, 0.0)
            # The derivative of a trend that follows is left out, as its gain is at a maximum.
            np.testing.assert_allclose(gradient[:, slot], expected, rtol=0.02, atol=0.05)


def test_evidence_of_white_noise_is_its_integral(spectra):
    of, starts = spectra
    own = search.rows_of(of, 0, [search.Model([1], starts[0].x)])
    rows = maximise_rows(of, own, 30, tolerance=1e-9)
    [draws] = sample(of, rows, np.array([512]))

    def likelihood(white):
        x = rows.x.copy()
        x[:, 1] = white
        return float(np.exp(rows.loss[0] - losses(of, rows, x)[0][0]))

    at = float(rows.x[0, 1])
    integral = np.log(quad(likelihood, at - 0.05, at + 0.05, points=[at])[0]) - rows.loss[0]
    assert rows.evidence[0] - rows.prior[0] == pytest.approx(integral, abs=0.01)
    assert draws.evidence - rows.prior[0] == pytest.approx(integral, abs=0.01)


@pytest.mark.parametrize('corner', [0.002, 0.1])
def test_detection_limits_of_slow_terms_are_those_in_front_of_a_low_pass(corner):
    plain = simulate(QUIET, 400_000, RATE, 3)
    filtered = lfilter(*butter(3, 2 * corner), plain)[10_000:]
    groups = [grouped(bins_of_record(samples, 1 / RATE), 0)
              for samples in (plain[10_000:], filtered)]
    in_front, behind = (prepared([one], 1 / RATE)[0].limit[0] for one in groups)
    slow = [search.B, search.K]
    np.testing.assert_allclose(behind[slow] / in_front[slow], 1, rtol=0.35)


def test_axes_have_the_same_posterior_together_as_alone():
    samples = [simulate(QUIET, 30_000, RATE, seed) for seed in range(3)]
    for fit, own in zip(fits_of(*samples), samples, strict=True):
        [alone] = fits_of(own)
        for key in QUIET:
            assert fit.fit.estimates[key].value == pytest.approx(
                alone.fit.estimates[key].value, rel=1e-9)


def estimates(records):
    return together(records, RATE)[0].coefficients


@pytest.fixture(scope='module')
def records():
    return [simulate(MODEL, 60_000, RATE, seed) for seed in range(3)]


def test_every_record_has_its_own_mean_and_its_own_ramp(records):
    time = np.arange(60_000) / RATE
    moved = [samples + offset + slope * time for samples, (offset, slope) in zip(
        records, ((3.0, 1e-5), (-7.0, -4e-5), (0.0, 2e-5)), strict=True)]
    still, sloping = estimates(records), estimates(moved)
    for key, truth in MODEL.items():
        assert sloping[key].value == pytest.approx(still[key].value, rel=0.02)
        low, high = still[key].ci95
        assert 0.7 * low < truth < 1.3 * high


def test_a_record_too_short_or_in_which_the_axis_stood_still_is_left_out(records):
    expected = estimates(records[1:])
    died = records[0].copy()
    died[len(died) // 3:] = 0.5
    assert estimates([died, *records[1:]]) == expected
    short = estimates([*records[1:], records[0][:50]])
    assert short[N].value == pytest.approx(expected[N].value, rel=1e-9)
    still = [shown(np.full(500, value)) for value in (1.0, 2.0)]
    assert joint_fits(still, 0.01) == [None]


def test_a_warm_up_in_every_record_is_no_random_walk():
    time = np.arange(72_000) / 20
    found, _ = together([
        simulate({N: 1e-3, B: 3e-4}, len(time), 20.0, 40 + part)
        + (-1)**part * 3e-3 * np.exp(-time / 400) for part in range(4)], 20.0)
    assert not found.coefficients[K].observable


def test_many_records_are_no_more_bands_to_fit_than_a_few():
    fits = [fit for seed in range(40) for fit in fit_axes(
        shown(simulate(MODEL, 20_000 + 300 * seed, RATE, seed)), 1 / RATE)]
    few, many = (joint_fit(fits[:count], 1 / RATE) for count in (4, 40))
    assert len(many.groups.frequency) < 1.5 * len(few.groups.frequency)
    for key, truth in MODEL.items():
        found, before = many.fit.estimates[key], few.fit.estimates[key]
        assert found.low < truth < found.high
        assert found.high / found.low < before.high / before.low


@pytest.mark.slow
def test_the_joint_coefficients_reach_their_bound_and_their_intervals_hold():
    """Four records of 10 min, 150 times: errors against those of 40 min at once."""
    values, whole, covered = (defaultdict(list) for _ in range(3))
    for run in range(150):
        found, once = (joint_fits([shown(record) for record in records], 1 / RATE)[0].fit.estimates
                       for records in ([simulate(MODEL, 60_000, RATE, 1000 + 5 * run + part)
                                        for part in range(4)],
                                       [simulate(MODEL, 240_000, RATE, 1004 + 5 * run)]))
        for key in (N, B):
            values[key].append(found[key].value / MODEL[key] - 1)
            whole[key].append(once[key].value / MODEL[key] - 1)
            covered[key].append(found[key].low <= MODEL[key] <= found[key].high)
    for key in (N, B):
        # Two spreads of 150 each are known to 8 %.
        assert np.std(values[key]) / np.std(whole[key]) < 1.25
        assert sum(covered[key]) > 0.88 * 150
