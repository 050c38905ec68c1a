# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from characterized import shown
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.posterior import search, shapes
from imu_allan.noise.posterior.change import change_of
from imu_allan.noise.posterior.estimates import quantiles
from imu_allan.noise.posterior.evidence import evenly, maximise_rows, sample
from imu_allan.noise.posterior.likelihood import batches, losses, SLOTS
from imu_allan.noise.posterior.prepared import prepared
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import butter, sosfilt

RATE = 100.0
MODEL = {'noise_density': 1e-3, 'bias_instability': 4e-4}


def estimates(*samples, rate=RATE):
    """Return what is reported of the coefficients of axes that are fitted together."""
    return [fit.fit.estimates for fit in fit_axes(shown(np.transpose(samples)), 1 / rate)]


@pytest.fixture(scope='module')
def spectra():
    fits = fit_axes(shown(np.transpose([simulate(MODEL, 90_000, RATE, seed)
                                        for seed in range(2)])), 1 / RATE)
    return prepared([fit.groups for fit in fits], 1 / RATE)


def every_structure(spectra, starts):
    """Rows with each shape, somewhere near where they belong."""
    own = search.Proposals(spectra, 0)
    x = starts[0].x.copy()
    low, high = spectra.tables.low_pass, spectra.tables.high_pass
    x[search.LOW] = low.first[2] + 2.0
    x[search.HIGH] = high.first[0] + 1.0
    x[search.TIME] = spectra.tables.terms[1].first[0] + 2.1
    x[search.ALPHA] = 0.93
    free, process = (search.LAW, search.ALPHA), (search.PROCESS, search.TIME)
    for slots in ([1], range(4), [1, *free], [1, 2, *process], [1, 2, search.LOW],
                  [1, 2, search.HIGH], [*range(5), *process, search.LOW]):
        own.add(slots, x, family=2)
    return own.rows()


def test_gradients_are_those_of_the_loss_and_information_is_positive(spectra):
    of, starts = spectra
    rows = every_structure(of, starts)
    for part in batches(rows):
        own = rows.take(part)
        _, gradient, information = losses(of, own, own.x)
        np.testing.assert_allclose(information, information.transpose(0, 2, 1))
        assert np.linalg.eigvalsh(information).min() > 0
        for slot in range(SLOTS):
            step = np.zeros(SLOTS)
            step[slot] = 1e-5
            up, down = (losses(of, own, own.x + sign * step)[0] for sign in (1, -1))
            expected = np.where(own.has[:, slot], (up - down) / 2e-5, 0.0)
            # The derivative of a trend that follows is left out, as its gain is at a maximum.
            np.testing.assert_allclose(gradient[:, slot], expected, rtol=0.02, atol=0.05)


def test_evidence_of_white_noise_is_its_integral(spectra):
    of, starts = spectra
    own = search.Proposals(of, 0)
    own.add([1], starts[0].x)
    rows = maximise_rows(of, own.rows(), 30, tolerance=1e-9)
    [draws] = sample(of, rows, np.array([512]))

    def likelihood(white):
        x = rows.x.copy()
        x[:, 1] = white
        return float(np.exp(rows.loss[0] - losses(of, rows, x)[0][0]))

    at = float(rows.x[0, 1])
    integral = np.log(quad(likelihood, at - 0.05, at + 0.05, points=[at])[0]) - rows.loss[0]
    assert rows.evidence[0] - rows.prior[0] == pytest.approx(integral, abs=0.01)
    assert draws.evidence - rows.prior[0] == pytest.approx(integral, abs=0.01)


def test_points_fill_the_cube_evenly_and_quantiles_follow_the_weights():
    points = evenly(512, 5)
    np.testing.assert_allclose(points.mean(axis=0), 0.5, atol=0.01)
    np.testing.assert_allclose(np.cov(points.T), np.eye(5) / 12, atol=0.006)
    assert quantiles(np.array([1.0, 2.0, 3.0]), np.array([1.0, 98.0, 1.0]), (
        0.1, 0.5, 0.9)) == pytest.approx((1.17, 2.0, 2.83), abs=0.2)


def test_levels_that_change_make_the_density_uncertain_and_steady_ones_do_not():
    rng = np.random.default_rng(1)
    steady, moving = (change_of(rng.normal(0, spread, 12), np.full(12, 0.01))
                      for spread in (0.01, 0.2))
    assert steady.typical == 0
    assert 0.1 < moving.typical < 0.4
    assert np.std(np.log(moving.factors(512))) > 5 * np.std(np.log(steady.factors(512)))


def test_a_nuisance_at_the_end_of_its_range_is_no_model(spectra):
    of, starts = spectra
    rows = every_structure(of, starts)
    at_end = rows.x.copy()
    at_end[:, search.LOW] = of.tables.low_pass.first[2]
    kept = search.best_of(of, replace(rows, x=at_end), 1e9, 99)
    assert not kept.has[:, search.LOW].any()


def test_axes_have_the_same_posterior_together_as_alone():
    samples = [simulate(MODEL, 30_000, RATE, seed) for seed in range(3)]
    for one, own in zip(estimates(*samples), samples, strict=True):
        [other] = estimates(own)
        for key in MODEL:
            assert one[key].value == pytest.approx(other[key].value, rel=1e-9)


def test_behind_a_slow_filter_of_white_noise_no_slow_term_is_made_up():
    rng = np.random.default_rng(31)
    slow = butter(2, 0.2, fs=RATE, output='sos')
    for found in estimates(*(1e-3 * RATE**0.5 * sosfilt(slow, noise)[10_000:]
                             for noise in rng.standard_normal((3, 370_000)))):
        assert found['noise_density'].value == pytest.approx(1e-3, rel=0.15)
        assert not found['bias_instability'].observable
        assert not found['rate_random_walk'].observable


def test_a_shape_is_one_line_of_the_table():
    # A further low-pass: the mean of two samples, of no other width.
    pair = shapes.Shape('mean_of_two', 0.05, lambda nu, c: np.cos(np.pi * nu)**2 + 0 * c,
                        lambda _: shapes.Grid(0.0, 1.0, 0.25))
    nu, band = np.geomspace(1e-4, 0.49, 80), shapes.Band(1e-4, 1e-3)
    seen = shapes.Response(nu, np.ones(80), np.full(80, 64.0), np.zeros(80))
    tables = shapes.table_of((*shapes.LOW_PASSES, pair), nu, band, seen)
    assert len(tables.first) == len(shapes.LOW_PASSES) + 1
    assert tables.count[-1] == 5


def test_a_random_walk_that_is_a_single_bump_is_not_reported():
    time = np.arange(360_000) / 50.0
    bump = 2e-3 * np.exp(-0.5 * ((time - 3600) / 600)**2)
    [found] = estimates(simulate(MODEL, 360_000, 50.0, 3) + bump, rate=50.0)
    assert not found['rate_random_walk'].observable
