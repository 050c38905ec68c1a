# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A fleet whose every number is known, and what its units are called."""

from dataclasses import replace

from exact_results import axis_result, build_result, UNSEEN, with_axes, with_coefficient
from imu_allan.fleet import population
from imu_allan.noise.terms import AXES
from imu_allan.wording import distinct_names, natural, unit_names
import numpy as np
import pytest

TRUTH = {'noise_density': (1e-4, 0.05, 0.001), 'bias_instability': (2e-5, 0.2, 0.04)}
"""Median, and the relative spread between units and of measuring, half that of an interval."""


def unit(rng, **factors):
    return build_result(axes={name: axis_result(name, {
        key: median * factors.get(name, 1.0) * float(
            np.exp(between * rng.normal() + error * rng.normal()))
        for key, (median, between, error) in TRUTH.items()}, mean=float(0.01 * rng.normal()))
        for name in AXES})


@pytest.fixture(scope='module')
def fleet():
    """Forty units, of which unit7 has a noisy gyro_y and unit23 a constant accel_x."""
    rng = np.random.default_rng(8)
    results = {f'unit{number}': unit(rng, **({'gyro_y': 1.6} if number == 7 else {}))
               for number in range(1, 41)}
    results['unit23'] = with_axes(results['unit23'], 'accel_x', curve=lambda axis: replace(
        axis.curve, adev=(0.0,) * len(axis.curve.tau_s)))
    return results


def six(lift=1.0):
    """Make six units that differ by 2 %, all gyroscope axes of unit2 noisier by a factor."""
    rng = np.random.default_rng(3)
    made = {f'unit{number}': unit(rng) for number in range(1, 7)}
    for name, result in made.items():
        for axis in AXES:
            density = result.axes[axis].coefficients['noise_density']
            value = 1e-4 * float(np.exp(0.02 * rng.normal())) * (
                lift if name == 'unit2' and axis.startswith('gyro') else 1.0)
            result.axes[axis].coefficients['noise_density'] = replace(
                density, value=value, ci95=(0.99 * value, 1.01 * value))
    return made


@pytest.fixture(scope='module')
def found(fleet):
    return population(fleet)


def traits_of(found):
    return {(trait.axis, trait.key): trait for trait in found.traits}


def outliers_of(found, axis=''):
    return [(one.unit, one.axis, one.key, one.fault) for one in found.outliers
            if one.axis.startswith(axis)]


def test_the_two_bad_units_of_forty_are_found_and_no_other(found):
    assert found.units[:3] == ('unit1', 'unit2', 'unit3')
    assert found.outlier_units == ['unit7', 'unit23']
    noisy, *_ = (outlier for outlier in found.outliers if outlier.unit == 'unit7')
    assert noisy.value / noisy.median == pytest.approx(1.6, rel=0.15)
    assert noisy.spreads > 5
    assert outliers_of(found) == [('unit7', 'gyro_y', 'noise_density', None),
                                  ('unit23', 'accel_x', None, 'constant')]


def test_a_unit_of_which_nothing_is_known_is_not_taken_for_good(fleet):
    unit = fleet['unit3']
    for name, axis in unit.axes.items():
        unit = with_axes(unit, name, coefficients={
            key: replace(found, **UNSEEN, upper95=None)
            for key, found in axis.coefficients.items()})
    assert outliers_of(population(fleet | {'unit3': unit}))[0] == (
        'unit3', 'gyro_x', None, 'without a coefficient')


def test_topics_of_one_recording_are_not_compared():
    topics = population({name: replace(unit, source=replace(unit.source, files='01ef', topic=name))
                         for name, unit in six().items()})
    assert (topics.one_model, topics.traits, topics.outliers, topics.unseen) == (False, (), (), ())


def test_the_spread_between_units_is_kept_apart_from_measuring(found):
    traits = traits_of(found)
    for axis in ('gyro_x', 'accel_z'):
        density = traits[axis, 'noise_density']
        assert density.median == pytest.approx(1e-4, rel=0.03)
        assert density.between == pytest.approx(5e-6, rel=0.3)
        assert density.measurement == pytest.approx(0.00102e-4, rel=0.1)
        assert density.units == density.observable == 40
        instability = traits[axis, 'bias_instability']
        assert instability.between_ci95[0] < 0.2 * 2e-5 < instability.between_ci95[1]
        percentiles = list(instability.percentiles.values())
        assert percentiles == sorted(percentiles)
        assert instability.tolerance > percentiles[-1]
    assert traits['gyro_x', 'mean'].unit == 'rad/s'
    assert not traits.keys() & {('accel_x', 'mean'), ('gyro_x', 'rate_random_walk')}


def test_the_mean_that_a_filter_left_is_no_units_zero_bias(fleet):
    nothing = {key: replace(found, **UNSEEN, upper95=None)
               for key, found in fleet['unit3'].axes['gyro_x'].coefficients.items()}
    # Far from the means of the others, and as if nothing were more certain.
    odd = {unit: with_axes(fleet[unit], 'gyro_x', coefficients=nothing, mean=1.0,
                           high_passed_hz=corner_hz)
           for unit, corner_hz in (('unit3', 0.16), ('unit4', None))}
    found = population(fleet | odd)
    assert traits_of(found)['gyro_x', 'mean'].observable == len(fleet) - len(odd)
    assert not odd.keys() & set(found.outlier_units)


def test_a_unit_whose_drift_does_not_show_has_no_certain_zero_bias(fleet):
    # All of them wander by what flicker makes of a mean; one is too quiet to show it.
    drift = 0.664 * 2e-5
    means = np.random.default_rng(1).normal(0, drift, len(fleet)).tolist()
    fleet = {name: with_axes(result, 'gyro_x', mean=mean)
             for (name, result), mean in zip(fleet.items(), means, strict=True)}
    fleet['unit2'] = with_coefficient(
        with_axes(fleet['unit2'], 'gyro_x', mean=2.5 * drift), 'gyro_x', 'bias_instability',
        **UNSEEN, upper95=3e-5)
    assert outliers_of(population(fleet), 'gyro_x') == []
    fleet['unit1'] = with_axes(fleet['unit1'], 'gyro_x', mean=20 * drift)
    assert outliers_of(population(fleet), 'gyro_x') == [('unit1', 'gyro_x', 'mean', None)]


def test_a_unit_is_judged_by_all_axes_of_a_sensor_together():
    assert population(six()).outlier_units == []
    found = population(six(1.095))
    assert found.outlier_units == ['unit2']
    assert outliers_of(found) == [
        ('unit2', f'gyro_{letter}', 'noise_density', None) for letter in 'xyz']
    assert {round(outlier.value / outlier.median, 1) for outlier in found.outliers} == {1.1}


def test_few_units_that_differ_much_have_no_limit_and_two_are_no_population(fleet):
    several = {name: with_coefficient(fleet[name], 'gyro_x', 'noise_density', value=value,
                                      ci95=(0.99 * value, 1.01 * value))
               for name, value in (('unit1', 1e-4), ('unit2', 3e-3), ('unit3', 0.1))}
    traits = traits_of(population(several))
    spread, usual = (traits[axis, 'noise_density'] for axis in ('gyro_x', 'gyro_y'))
    assert spread.tolerance is None
    assert usual.tolerance > usual.median
    found = population({name: fleet[name] for name in ('unit1', 'unit2')})
    assert found.units == ('unit1', 'unit2')
    assert not found.traits + found.outliers


@pytest.mark.parametrize(('paths', 'names'), [
    (['a.json', 'b.json'], ['a', 'b']), (['sn7/night.mcap', 'sn12/night.mcap'], [
        'sn7_night', 'sn12_night']),
    (['mon/result.json', 'tue/result.json'], ['mon', 'tue']),
    (['x/mon/result.json', 'y/mon/result.json'], ['x_mon', 'y_mon']),
    (['a/r.json', 'b/s.json', 'c/r.json'], ['a_r', 'b_s', 'c_r']),
    (['a.json', 'A.mcap', 'a.csv'], ['a', 'A-2', 'a-3']), (['night.mcap'], ['night'])])
def test_units_are_named_after_their_files_as_shortly_as_tells_them_apart(paths, names):
    assert unit_names(paths) == names


def test_a_folder_has_no_suffix_and_a_link_names_its_unit(tmp_path, monkeypatch):
    for name in 'imu_1.5', 'imu_1.6':
        (tmp_path / name).mkdir()
    monkeypatch.chdir(tmp_path / 'imu_1.5')
    assert unit_names(['.', '../imu_1.6']) == ['imu_1.5', 'imu_1.6']
    (tmp_path / 'SN1').symlink_to(tmp_path / 'imu_1.5')
    assert unit_names([tmp_path / 'SN1']) == ['SN1']


def test_units_may_be_named_after_the_folders_of_their_files():
    assert unit_names(['sn7/night.mcap', 'sn12/night.mcap'], by_folder=True) == ['sn7', 'sn12']
    assert unit_names(['sn7/a.mcap', 'sn7/b.mcap'], by_folder=True) == ['sn7', 'sn7-2']


def test_no_name_leads_out_of_the_folder_above_or_is_too_long_for_it(tmp_path):
    names = ['a' * 301, 'ä' * 301, '../../up', '\0\n', '..', '']
    for name in distinct_names(names):
        (tmp_path / name).mkdir()
    assert len(list(tmp_path.iterdir())) == len(names)


def test_units_stand_in_the_order_of_their_numbers():
    assert sorted(['unit10', 'Unit2', 'unit1', '3', 'a', 'unit10b2', 'unit10b12'], key=natural) \
        == ['3', 'a', 'unit1', 'Unit2', 'unit10', 'unit10b2', 'unit10b12']
