# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from collections.abc import Callable
from dataclasses import replace

from imu_allan.fleet.population import population
from imu_allan.result import Result, Saturation, Span
import numpy as np
import pytest


def test_the_two_bad_units_of_forty_are_found_and_no_other(fleet: dict[str, Result]) -> None:
    found = population(fleet)
    assert found.odd_units == ['unit7', 'unit23']
    noisy, *_ = (oddity for oddity in found.oddities if oddity.unit == 'unit7')
    assert (noisy.axis, noisy.key, noisy.fault) == ('gyro_y', 'noise_density', None)
    assert noisy.value / noisy.median == pytest.approx(1.6, rel=0.15)
    assert noisy.spreads > 5
    dead, = (oddity for oddity in found.oddities if oddity.unit == 'unit23')
    assert (dead.axis, dead.key, dead.fault) == ('accel_x', None, 'constant')


def test_the_spread_between_units_is_kept_apart_from_measuring(fleet: dict[str, Result]) -> None:
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


def test_the_mean_that_a_filter_left_is_no_units_zero_bias(fleet: dict[str, Result]) -> None:
    def without(unit: Result, corner_hz: float | None) -> Result:
        axis = unit.axes['gyro_x']
        nothing = {key: replace(found, observable=False, value=None, ci95=None, upper95=None)
                   for key, found in axis.coefficients.items()}
        # Far from the means of the others, and as if nothing were more certain.
        axis = replace(axis, coefficients=nothing, mean=1.0, high_passed_hz=corner_hz)
        return replace(unit, axes={**unit.axes, 'gyro_x': axis})

    odd = {unit: without(fleet[unit], corner_hz)
           for unit, corner_hz in (('unit3', 0.16), ('unit4', None))}
    found = population({**fleet, **odd})
    traits = {(trait.axis, trait.key): trait for trait in found.traits}
    assert traits['gyro_x', 'mean'].observable == len(fleet) - len(odd)
    assert not odd.keys() & set(found.odd_units)


def test_units_that_are_cut_off_or_stood_still_do_not_belong(fleet: dict[str, Result]) -> None:
    def with_fault(unit: str, **fault: Saturation | Span) -> Result:
        return replace(fleet[unit], axes={
            **fleet[unit].axes, 'gyro_x': replace(fleet[unit].axes['gyro_x'], **fault)})

    found = population({**fleet, 'unit3': with_fault('unit3', saturated=Saturation(0.01, 0.2)),
                        'unit4': with_fault('unit4', stood_still=Span(60.0, 300.0))})
    assert {(oddity.unit, oddity.axis, oddity.fault) for oddity in found.oddities
            if oddity.fault is not None} == {
        ('unit3', 'gyro_x', 'saturated'), ('unit4', 'gyro_x', 'dead'),
        ('unit23', 'accel_x', 'constant')}


def test_units_stand_in_natural_order(fleet: dict[str, Result]) -> None:
    assert population(fleet).units[:3] == ('unit1', 'unit2', 'unit3')


def test_an_axis_that_one_unit_lacks_is_missing_there(fleet: dict[str, Result]) -> None:
    bad = fleet['unit9']
    fleet['unit9'] = replace(bad, axes={k: a for k, a in bad.axes.items() if k != 'gyro_z'})
    assert ('unit9', 'gyro_z', 'missing') in {
        (oddity.unit, oddity.axis, oddity.fault) for oddity in population(fleet).oddities}


def test_an_axis_that_no_unit_has_is_missing_in_none(fleet: dict[str, Result]) -> None:
    gyros = {name: replace(result, axes={k: a for k, a in result.axes.items() if 'gyro' in k})
             for name, result in fleet.items()}
    assert population(gyros).odd_units == ['unit7']


def test_two_units_are_no_population(fleet: dict[str, Result]) -> None:
    found = population({name: fleet[name] for name in ('unit1', 'unit2')})
    assert found.units == ('unit1', 'unit2')
    assert not found.traits
    assert not found.oddities


def test_a_unit_whose_drift_does_not_show_has_no_certain_zero_bias(
        fleet: dict[str, Result]) -> None:
    # All of them wander by what flicker makes of a mean; six are too quiet to show it.
    drift = 0.664 * 2e-5
    means = np.random.default_rng(1).normal(0, drift, len(fleet))
    for number, (name, result) in enumerate(fleet.items()):
        axis = replace(result.axes['gyro_x'], mean=float(means[number]))
        if number % 7 == 0:
            quiet = replace(axis.coefficients['bias_instability'], observable=False, value=None,
                            ci95=None, upper95=3e-5)
            axis = replace(axis, coefficients={**axis.coefficients, 'bias_instability': quiet})
        fleet[name] = replace(result, axes={**result.axes, 'gyro_x': axis})
    found = population(fleet)
    assert [oddity for oddity in found.oddities if oddity.axis == 'gyro_x'] == []
    bad = replace(fleet['unit1'].axes['gyro_x'], mean=20 * drift)
    fleet['unit1'] = replace(fleet['unit1'], axes={**fleet['unit1'].axes, 'gyro_x': bad})
    assert [(oddity.unit, oddity.key) for oddity in population(fleet).oddities
            if oddity.axis == 'gyro_x'] == [('unit1', 'mean')]


def test_a_unit_is_judged_by_all_axes_of_a_sensor_together(
        six: Callable[..., dict[str, Result]]) -> None:
    assert population(six()).odd_units == []
    found = population(six(1.095))
    assert found.odd_units == ['unit2']
    assert [(oddity.axis, oddity.key) for oddity in found.oddities] == [
        (f'gyro_{letter}', 'noise_density') for letter in 'xyz']
    assert {round(oddity.value / oddity.median, 1) for oddity in found.oddities} == {1.1}


def test_few_units_that_differ_much_have_no_limit(fleet: dict[str, Result]) -> None:
    several = {name: fleet[name] for name in ('unit1', 'unit2', 'unit3')}
    for factor, result in zip((1.0, 30.0, 1000.0), list(several.values()), strict=True):
        axis = result.axes['gyro_x']
        density = axis.coefficients['noise_density']
        value = factor * 1e-4
        several[f'unit{[1.0, 30.0, 1000.0].index(factor) + 1}'] = replace(result, axes={
            **result.axes, 'gyro_x': replace(axis, coefficients={
                **axis.coefficients, 'noise_density': replace(
                    density, value=value, ci95=(0.99 * value, 1.01 * value))})})
    traits = {(trait.axis, trait.key): trait for trait in population(several).traits}
    assert traits['gyro_x', 'noise_density'].tolerance is None
    assert traits['gyro_y', 'noise_density'].tolerance > traits['gyro_y', 'noise_density'].median
