# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.posterior import search, shapes
from imu_allan.noise.posterior.answer import quantiles
from imu_allan.noise.posterior.change import change_of
from imu_allan.noise.posterior.evidence import climb, evenly, sample
from imu_allan.noise.posterior.likelihood import batches, losses, SLOTS
from imu_allan.noise.posterior.posterior import posteriors
from imu_allan.noise.posterior.prepared import prepared
from imu_allan.noise.posterior.report import reported
from imu_allan.noise.record.bins import bins_of
from imu_allan.noise.record.estimator import Estimator
from imu_allan.noise.simulate import simulate
from imu_allan.noise.trends.regressors import RecordSpectrum
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import butter, lfilter, sosfilt

RATE = 100.0
MODEL = {'noise_density': 1e-3, 'bias_instability': 4e-4}


def records(*samples, rate=RATE):
    """Spectra of records of one length."""
    estimator = Estimator(len(samples))
    estimator.update(np.stack(samples, axis=1))
    finished = estimator.finished()
    sections = finished.periodogram.sections()
    bins = bins_of(sections, 1 / rate)
    return [RecordSpectrum(sections, bins, axis, 1 / rate) for axis in range(len(samples))]


def fits(*samples, rate=RATE):
    of = records(*samples, rate=rate)
    return [reported(one, 1 / rate)
            for one in posteriors([record.groups() for record in of], 1 / rate, of)]


@pytest.fixture(scope='module')
def spectra():
    of = records(*(simulate(MODEL, 90_000, RATE, seed) for seed in range(2)))
    return prepared([record.groups() for record in of], 1 / RATE)


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


def test_gradients_are_those_of_the_loss(spectra):
    of, starts = spectra
    rows = every_structure(of, starts)
    for part in batches(rows):
        own = rows.take(part)
        _, gradient, _ = losses(of, own, own.x)
        for slot in range(SLOTS):
            step = np.zeros(SLOTS)
            step[slot] = 1e-5
            up, down = (losses(of, own, own.x + sign * step)[0] for sign in (1, -1))
            expected = np.where(own.has[:, slot], (up - down) / 2e-5, 0.0)
            # The derivative of a trend that follows is left out, as its gain is at a maximum.
            np.testing.assert_allclose(gradient[:, slot], expected, rtol=0.02, atol=0.05)


def test_information_is_symmetric_and_positive(spectra):
    of, starts = spectra
    rows = every_structure(of, starts)
    for part in batches(rows):
        _, _, information = losses(of, rows.take(part), rows.take(part).x)
        np.testing.assert_allclose(information, information.transpose(0, 2, 1))
        assert np.linalg.eigvalsh(information).min() > 0


def test_evidence_of_white_noise_is_its_integral(spectra):
    of, starts = spectra
    own = search.Proposals(of, 0)
    own.add([1], starts[0].x)
    rows = climb(of, own.rows(), 30, tolerance=1e-9)
    [draws] = sample(of, rows, np.array([512]))

    def likelihood(white):
        x = rows.x.copy()
        x[:, 1] = white
        return float(np.exp(rows.loss[0] - losses(of, rows, x)[0][0]))

    at = float(rows.x[0, 1])
    integral = np.log(quad(likelihood, at - 0.05, at + 0.05, points=[at])[0]) - rows.loss[0]
    assert rows.evidence[0] - rows.prior[0] == pytest.approx(integral, abs=0.01)
    assert draws.evidence - rows.prior[0] == pytest.approx(integral, abs=0.01)


def test_draws_are_the_same_every_time(spectra):
    of, starts = spectra
    rows = climb(of, search.best_of(of, climb(of, every_structure(of, starts), 20), 1e3, 9), 1)
    one, other = (sample(of, rows, np.full(len(rows), 64)) for _ in range(2))
    for a, b in zip(one, other, strict=True):
        np.testing.assert_array_equal(a.x, b.x)
        np.testing.assert_array_equal(a.share, b.share)


@pytest.mark.parametrize('factor', [2.0**-7, 8.0])
def test_another_rate_and_scale_change_the_coefficients_by_what_their_units_say(factor):
    samples = simulate(MODEL | {'rate_random_walk': 1e-4}, 60_000, RATE, 4)
    [one] = fits(samples)
    [other] = fits(3 * samples, rate=RATE * factor)
    powers = {'quantization_noise': -1.0, 'noise_density': -0.5, 'bias_instability': 0.0,
              'rate_random_walk': 0.5}
    for key, power in powers.items():
        a, b = one.estimates[key], other.estimates[key]
        assert a.presence == pytest.approx(b.presence, abs=1e-6)
        assert a.observable == b.observable
        np.testing.assert_allclose([b.value, b.low, b.high, b.upper], 3 * factor**power
                                   * np.array([a.value, a.low, a.high, a.upper]), rtol=1e-5)


def test_axes_have_the_same_posterior_together_as_alone():
    samples = [simulate(MODEL, 30_000, RATE, seed) for seed in range(3)]
    together, alone = fits(*samples), [fits(own)[0] for own in samples]
    for one, other in zip(together, alone, strict=True):
        for key in MODEL:
            assert one.estimates[key].value == pytest.approx(other.estimates[key].value, rel=1e-9)


def test_a_low_pass_leaves_the_level_of_its_pass_band_and_the_flicker():
    filtered = sosfilt(butter(2, 0.2, output='sos'), simulate(MODEL, 360_000, RATE, 2))
    [found] = fits(filtered)
    density, flicker = (found.estimates[key] for key in MODEL)
    assert density.value == pytest.approx(MODEL['noise_density'], rel=0.02)
    assert flicker.observable
    assert flicker.value == pytest.approx(MODEL['bias_instability'], rel=0.2)
    assert found.window_s is not None


def test_behind_a_slow_filter_of_white_noise_no_slow_term_is_made_up():
    rng = np.random.default_rng(31)
    slow = butter(2, 0.2, fs=RATE, output='sos')
    found = fits(*(1e-3 * RATE**0.5 * sosfilt(slow, rng.standard_normal(370_000))[10_000:]
                   for _ in range(3)))
    for fit in found:
        assert fit.estimates['noise_density'].value == pytest.approx(1e-3, rel=0.15)
        assert not fit.estimates['bias_instability'].observable
        assert not fit.estimates['rate_random_walk'].observable


def test_a_shape_is_one_line_of_the_table():
    # A seventh low-pass: the mean of two samples, of no other width.
    pair = shapes.Shape('mean_of_two', 0.05,
                        lambda nu, c: np.cos(np.pi * nu)**2 + 0 * c,
                        lambda _: shapes.Grid(0.0, 1.0, 0.25))
    nu, band = np.geomspace(1e-4, 0.49, 80), shapes.Band(1e-4, 1e-3)
    seen = shapes.Response(nu, np.ones(80), np.full(80, 64.0), np.zeros(80))
    tables = shapes.table_of((*shapes.LOW_PASSES, pair), nu, band, seen)
    assert len(tables.first) == len(shapes.LOW_PASSES) + 1
    assert tables.count[-1] == 5


def test_levels_that_change_make_the_density_uncertain_and_steady_ones_do_not():
    rng = np.random.default_rng(1)
    steady = change_of(rng.normal(0, 0.01, 12), np.full(12, 0.01))
    moving = change_of(rng.normal(0, 0.2, 12), np.full(12, 0.01))
    assert steady.typical == 0
    assert 0.1 < moving.typical < 0.4
    assert np.std(np.log(moving.factors(512))) > 5 * np.std(np.log(steady.factors(512)))


def test_points_fill_the_cube_evenly():
    points = evenly(512, 5)
    np.testing.assert_allclose(points.mean(axis=0), 0.5, atol=0.01)
    np.testing.assert_allclose(np.cov(points.T), np.eye(5) / 12, atol=0.006)


def test_quantiles_follow_the_weights():
    values = np.array([1.0, 2.0, 3.0])
    assert quantiles(values, np.array([1.0, 98.0, 1.0]), (0.1, 0.5, 0.9)) == pytest.approx(
        (1.17, 2.0, 2.83), abs=0.2)


def test_a_nuisance_at_the_end_of_its_range_is_no_model(spectra):
    of, starts = spectra
    rows = every_structure(of, starts)
    at_end = rows.x.copy()
    at_end[:, search.LOW] = of.tables.low_pass.first[2]
    kept = search.best_of(of, replace(rows, x=at_end), 1e9, 99)
    assert not kept.has[:, search.LOW].any()


def of_records(*samples, rate=RATE):
    """Return what is reported of records, from the samples on."""
    estimator = Estimator(len(samples))
    estimator.update(np.stack(samples, axis=1))
    return [one and one.fit for one in fit_axes(estimator.finished(), 1 / rate)]


def test_lines_gaps_between_axes_and_an_axis_that_stands_still_do_no_harm():
    clean = simulate(MODEL, 90_000, RATE, 1)
    humming = simulate(MODEL, 90_000, RATE, 2) + 3e-3 * np.sin(
        2 * np.pi * 12.3 * np.arange(90_000) / RATE)
    one, still, other = of_records(clean, np.zeros(90_000), humming)
    assert still is None
    for found in (one, other):
        assert found.estimates['noise_density'].value == pytest.approx(1e-3, rel=0.01)
        assert found.acceptable


def test_a_strong_settling_is_no_noise_and_leaves_the_coefficients():
    time = np.arange(360_000) / 50.0
    [found] = of_records(simulate(MODEL, 360_000, 50.0, 3) + 0.04 * np.exp(-time / 600), rate=50.0)
    warming = found.trend.warm_up
    assert found.trend.second_warm_up is None
    assert warming.ci95[0] < 0.04 < warming.ci95[1]
    assert warming.time_constant_ci95[0] < 600 < warming.time_constant_ci95[1]
    assert not found.estimates['rate_random_walk'].observable
    assert found.estimates['bias_instability'].value == pytest.approx(4e-4, rel=0.3)


def test_a_random_walk_that_is_a_single_bump_is_not_reported():
    time = np.arange(360_000) / 50.0
    bump = 2e-3 * np.exp(-0.5 * ((time - 3600) / 600)**2)
    [found] = of_records(simulate(MODEL, 360_000, 50.0, 3) + bump, rate=50.0)
    assert not found.estimates['rate_random_walk'].observable


def test_a_process_is_reported_with_its_time():
    rng = np.random.default_rng(5)
    decay = np.exp(-1 / (20.0 * 60.0))
    process = lfilter([1], [1, -decay], rng.normal(0, 8e-4 * np.sqrt(1 - decay**2), 216_000))
    [found] = of_records(simulate(MODEL, 216_000, 20.0, 5) + process, rate=20.0)
    low, high = found.gauss_markov.correlation_time_ci95
    assert low < 60 < high
    assert not found.estimates['rate_random_walk'].observable
