# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from dataclasses import replace

from changed import UNSEEN, with_axes, with_coefficient
from imu_allan.fleet.population import population
import numpy as np
import pytest


def test_the_two_bad_units_of_forty_are_found_and_no_other(fleet):
    found = population(fleet)
    assert found.units[:3] == ('unit1', 'unit2', 'unit3')
    assert found.outlier_units == ['unit7', 'unit23']
    noisy, *_ = (outlier for outlier in found.outliers if outlier.unit == 'unit7')
    assert (noisy.axis, noisy.key, noisy.fault) == ('gyro_y', 'noise_density', None)
    assert noisy.value / noisy.median == pytest.approx(1.6, rel=0.15)
    assert noisy.spreads > 5
    dead, = (outlier for outlier in found.outliers if outlier.unit == 'unit23')
    assert (dead.axis, dead.key, dead.fault) == ('accel_x', None, 'constant')


def test_the_spread_between_units_is_kept_apart_from_measuring(fleet):
    traits = {(trait.axis, trait.key): trait for trait in population(fleet).traits}
    for axis in ('gyro_x', 'accel_z'):
        density = traits[axis, 'noise_density']
        assert density.median == pytest.approx(1e-4, rel=0.03)
        assert density.between == pytest.approx(5e-6, rel=0.3)
        assert density.measurement == pytest.approx(0.002e-4, rel=0.1)
        assert density.units == density.observable == 40
        instability = traits[axis, 'bias_instability']
        assert instability.between_ci95[0] < 0.2 * 2e-5 < instability.between_ci95[1]
        percentiles = list(instability.percentiles.values())
        assert percentiles == sorted(percentiles)
        assert instability.tolerance > percentiles[-1]
    assert traits['gyro_x', 'mean'].unit == 'rad/s'
    assert ('accel_x', 'mean') not in traits
    assert ('gyro_x', 'rate_random_walk') not in traits


def test_the_mean_that_a_filter_left_is_no_units_zero_bias(fleet):
    nothing = {key: replace(found, **UNSEEN, upper95=None)
               for key, found in fleet['unit3'].axes['gyro_x'].coefficients.items()}
    # Far from the means of the others, and as if nothing were more certain.
    odd = {unit: with_axes(fleet[unit], 'gyro_x', coefficients=nothing, mean=1.0,
                           high_passed_hz=corner_hz)
           for unit, corner_hz in (('unit3', 0.16), ('unit4', None))}
    found = population({**fleet, **odd})
    traits = {(trait.axis, trait.key): trait for trait in found.traits}
    assert traits['gyro_x', 'mean'].observable == len(fleet) - len(odd)
    assert not odd.keys() & set(found.outlier_units)


def test_a_unit_whose_drift_does_not_show_has_no_certain_zero_bias(fleet):
    # All of them wander by what flicker makes of a mean; one is too quiet to show it.
    drift = 0.664 * 2e-5
    means = np.random.default_rng(1).normal(0, drift, len(fleet)).tolist()
    for name, mean in zip(fleet, means, strict=True):
        fleet[name] = with_axes(fleet[name], 'gyro_x', mean=mean)
    fleet['unit2'] = with_coefficient(
        with_axes(fleet['unit2'], 'gyro_x', mean=2.5 * drift), 'gyro_x', 'bias_instability',
        **UNSEEN, upper95=3e-5)
    found = population(fleet)
    assert [outlier for outlier in found.outliers if outlier.axis == 'gyro_x'] == []
    fleet['unit1'] = with_axes(fleet['unit1'], 'gyro_x', mean=20 * drift)
    assert [(outlier.unit, outlier.key) for outlier in population(fleet).outliers
            if outlier.axis == 'gyro_x'] == [('unit1', 'mean')]


def test_a_unit_is_judged_by_all_axes_of_a_sensor_together(six):
    assert population(six()).outlier_units == []
    found = population(six(1.095))
    assert found.outlier_units == ['unit2']
    assert [(outlier.axis, outlier.key) for outlier in found.outliers] == [
        (f'gyro_{letter}', 'noise_density') for letter in 'xyz']
    assert {round(outlier.value / outlier.median, 1) for outlier in found.outliers} == {1.1}


def test_few_units_that_differ_much_have_no_limit_and_two_are_no_population(fleet):
    several = {name: with_coefficient(fleet[name], 'gyro_x', 'noise_density', value=value,
                                      ci95=(0.99 * value, 1.01 * value))
               for name, value in (('unit1', 1e-4), ('unit2', 3e-3), ('unit3', 0.1))}
    traits = {(trait.axis, trait.key): trait for trait in population(several).traits}
    assert traits['gyro_x', 'noise_density'].tolerance is None
    assert traits['gyro_y', 'noise_density'].tolerance > traits['gyro_y', 'noise_density'].median
    found = population({name: fleet[name] for name in ('unit1', 'unit2')})
    assert found.units == ('unit1', 'unit2')
    assert not found.traits
    assert not found.outliers
