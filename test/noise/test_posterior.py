# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from characterized import shown
from imu_allan.noise.axis_fit import fit_axes
from imu_allan.noise.posterior import search
from imu_allan.noise.posterior.evidence import maximise_rows, sample
from imu_allan.noise.posterior.likelihood import batches, losses, SLOTS
from imu_allan.noise.posterior.prepared import prepared
from imu_allan.noise.simulate import simulate
import numpy as np
import pytest
from scipy.integrate import quad

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


def test_axes_have_the_same_posterior_together_as_alone():
    samples = [simulate(MODEL, 30_000, RATE, seed) for seed in range(3)]
    for one, own in zip(estimates(*samples), samples, strict=True):
        [other] = estimates(own)
        for key in MODEL:
            assert one[key].value == pytest.approx(other[key].value, rel=1e-9)
