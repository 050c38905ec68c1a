# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated sensors of other programs."""

from html import escape
import json
from math import pi, sqrt

from imu_allan.sensor.units import STANDARD_GRAVITY
from imu_allan.writers.filters.chosen_numbers import (
    K,
    Key,
    N,
    Numbers,
    Sensor,
    SENSOR_NAMES,
    TIME,
)
from imu_allan.writers.filters.layout import (
    heading,
    joined,
    Pair,
    real,
    times,
    triples,
    UNITS,
    worst,
)

_DEGREE = pi / 180  # rad
_SDF: dict[Sensor, str] = {'gyro': 'angular_velocity', 'accel': 'linear_acceleration'}
_MATLAB: dict[Sensor, str] = {'gyro': 'gyroparams', 'accel': 'accelparams'}
_MATLAB_FIELDS: dict[Key, str] = {N: 'NoiseDensity', K: 'RandomWalk'}
_FLICKER_POLES = 2000
"""Flicker is right to 2 % for half as many samples, to 10 % for four times as many."""
_AIRSIM_TIMES = {'gyro': 500.0, 'accel': 800.0}
"""In seconds: ImuSimpleParams.hpp has these, which the file then states."""


def gazebo(numbers: Numbers) -> str:
    """
    SDF noise of a Gazebo IMU sensor, for each axis: N sqrt(f), and the driving density K.

    ``GaussianNoiseModel::ApplyImpl`` of gz-sensors (GaussianNoiseModel.cc) adds noise of standard
    deviation ``dynamic_bias_stddev sqrt(Tc/2 (1 - exp(-2 dt/Tc)))`` to the bias at a step: that is
    the density which drives the bias, ``sigma sqrt(2/Tc)``, not its standard deviation.
    ``stddev`` is that of a sample. Releases whose ``ApplyImpl`` knows no time step have no dynamic
    bias.
    """
    f = numbers.rate()
    lines = [*_xml_heading(numbers, f'stddev = N sqrt(f) at f = {f:g} Hz, the update_rate of the '
                           'sensor; dynamic_bias_stddev is the',
                           'driving density K = sigma sqrt(2/Tc), as gz-sensors uses it, not the '
                           'standard deviation of the bias.'), '<imu>']
    for sensor, tag in _SDF.items():
        lines.append(f'  <{tag}>')
        for name in numbers.axes(sensor):
            own = numbers.of_axis[name]
            if N not in own:
                continue
            lines += [f'    <{name[-1]}><noise type="gaussian">', '      <mean>0</mean>',
                      f'      <!-- N sqrt(f) {numbers.measured(name, N, times(sqrt(f)))} -->',
                      f'      <stddev>{real(own[N].value * sqrt(f))}</stddev>']
            if TIME in own:
                lines += [f'      <!-- K {numbers.measured(name, K)}; Tc '
                          f'{numbers.measured(name, TIME)} -->',
                          f'      <dynamic_bias_stddev>{real(own[K].value)}'
                          '</dynamic_bias_stddev>',
                          f'      <dynamic_bias_correlation_time>{real(own[TIME].value)}'
                          '</dynamic_bias_correlation_time>']
            lines.append(f'    </noise></{name[-1]}>')
        lines.append(f'  </{tag}>')
    return joined([*lines, '</imu>'])


def rotors(numbers: Numbers) -> str:
    """
    Parameters of the IMU plugin of RotorS and PX4's Gazebo classic: N, K driving, Tc.

    gazebo_imu_plugin.cpp adds ``N/sqrt(dt)`` and drives the bias by K with the correlation time.
    RotorS reads the gyroscope's K as ``gyroscopeBiasRandomWalk``, PX4 as ``gyroscopeRandomWalk``.
    """
    names: dict[Pair, tuple[str, ...]] = {
        ('gyro', N): ('gyroscopeNoiseDensity',),
        ('gyro', K): ('gyroscopeBiasRandomWalk', 'gyroscopeRandomWalk'),
        ('gyro', TIME): ('gyroscopeBiasCorrelationTime',),
        ('accel', N): ('accelerometerNoiseDensity',),
        ('accel', K): ('accelerometerRandomWalk',),
        ('accel', TIME): ('accelerometerBiasCorrelationTime',)}
    lines = [*_xml_heading(numbers, 'K is the driving density sigma sqrt(2/Tc). The ...TurnOnBias'
                           'Sigma are not seen in one recording.'), '<plugin>']
    for (sensor, key), tags in names.items():
        entry = worst(numbers, sensor, key, lambda value: value, '', UNITS[sensor, key])
        lines += [f'  <!-- {_comment(remark)} -->' for remark in entry.remarks]
        if entry.value is not None:
            lines += [f'  <{tag}>{real(entry.value)}</{tag}>' for tag in tags]
    return joined([*lines, '</plugin>'])


def pegasus(numbers: Numbers) -> str:
    """
    Write the dictionary for Pegasus Simulator's ``IMU``: N, K driving, Tc.

    ``IMU.update`` (pegasus/simulator/logic/sensors/imu.py) adds ``noise_density/sqrt(dt)`` and
    drives each bias by ``random_walk``. It takes the correlation time of the accelerometer for the
    gyroscope, too, and adds neither bias to what it gives out.
    """
    names: dict[Key, str] = {N: 'noise_density', K: 'random_walk', TIME: 'bias_correlation_time'}
    lines = [*heading(numbers),
             '# For IMU(config) of pegasus.simulator.logic.sensors. K is the driving density '
             'sigma sqrt(2/Tc). IMU.update takes the',
             '# correlation time of the accelerometer for both sensors: here both have the same. '
             'As published it works the biases',
             '# out and adds them to nothing: take the # before the two "+ self._..._bias[i]" out '
             'there.', 'imu_config = {', f"    'update_rate': {real(numbers.rate())},"]
    sensors: tuple[Sensor, ...] = ('gyro', 'accel')
    for sensor in sensors:
        lines.append(f"    '{SENSOR_NAMES[sensor]}': {{")
        for key, name in names.items():
            entry = worst(numbers, sensor, key, lambda value: value, '', UNITS[sensor, key])
            lines += [f'        # {remark}' for remark in entry.remarks]
            if entry.value is not None:
                lines.append(f"        '{name}': {real(entry.value)},")
        lines.append('    },')
    return joined([*lines, '}'])


def matlab(numbers: Numbers) -> str:
    """
    Write MATLAB's ``gyroparams`` and ``accelparams``: N, B and K, for each axis, single-sided.

    ``setupBandwidth`` of imuSensor (IMUSensorSimulator.m of the toolbox) takes f for a NoiseType
    of 'single-sided' and f/2 for 'double-sided', the default. ``setStdDevWhiteNoise`` multiplies
    NoiseDensity by the root of that, ``setStdDevRandWalk`` divides RandomWalk by it: N sqrt(f) and
    K/sqrt(f), as they should be, are those of 'single-sided'. ``setStdDevBiasInst`` takes B times
    ``sqrt(2/(f pCorrelationTime))``, which is B as it is, because ``setupBiasInstabilityDrift``
    sets that time to two samples: white noise that goes through the filter of
    BiasInstabilityCoefficients. That is
    ``fractalcoef`` (R2023b; N. J. Kasdin, Proc. IEEE 83(5), 1995): of n poles it makes flicker of
    level B out of it for as long as n samples, and of one, the default, white noise of 2 B a
    sample, without any flicker.
    """
    lines = [*heading(numbers, '%'), "% NoiseType is 'single-sided': imuSensor then makes N "
             "sqrt(f) of NoiseDensity. 'double-sided', its default,",
             '% makes N sqrt(f/2) of it.']
    levels = {sensor: _flicker(numbers, sensor) for sensor in _MATLAB}
    if any(map(any, levels.values())):
        lines += [f'% BiasInstability is B, flicker, by a filter of {_FLICKER_POLES} poles: right '
                  f'to 10 % for {4 * _FLICKER_POLES / numbers.rate():.3g} s; more poles reach',
                  '% further and take more time. fractalcoef, which makes it, needs MATLAB R2023b '
                  'or later; the default of one pole makes no flicker.']
    for sensor, function in _MATLAB.items():
        lines += ['', f'{sensor} = {function};', f"{sensor}.NoiseType = 'single-sided';"]
        for key, field in _MATLAB_FIELDS.items():
            lines += triples(numbers, {(sensor, key): f'{sensor}.{field}'},
                             line='{name} = [{value}];', sign='%')
        lines += ['', '% B of x, y, z, bias instability; 0 where it is not observable',
                  *(f'% {name} {coefficient}' for name, axis in numbers.axes(sensor).items()
                    if (coefficient := axis.coefficients['bias_instability']).upper95
                    or coefficient.observable),
                  f'{sensor}.BiasInstability = [{", ".join(real(b) for b in levels[sensor])}];']
        if any(levels[sensor]):
            lines.append(f'{sensor}.BiasInstabilityCoefficients = '
                         f'fractalcoef({_FLICKER_POLES}, 1);')
    lines += ['', f"imu = imuSensor('accel-gyro', 'SampleRate', {real(numbers.rate())}, "
              "'Gyroscope', gyro, 'Accelerometer', accel);"]
    return joined(lines)


def _flicker(numbers: Numbers, sensor: str) -> list[float]:
    found = []
    for letter in 'xyz':
        axis = numbers.result.axes.get(f'{sensor}_{letter}')
        value = axis.coefficients['bias_instability'].value if axis else None
        found.append(value or 0.0)
    return found


def airsim(numbers: Numbers) -> str:
    """
    Write AirSim's ``Imu`` settings: deg/sqrt(h), deg/h, mg/sqrt(Hz), ug.

    ImuSimpleParams.hpp converts them so; ImuSimple.hpp walks the bias by ``stability/sqrt(tau)``
    per root second: the stability is K sqrt(tau), at AirSim's own tau.
    """
    settings: dict[str, object] = {'SensorType': 2, 'Enabled': True}
    names: tuple[tuple[Pair, str, float], ...] = (
        (('gyro', N), 'AngularRandomWalk', _DEGREE / 60),
        (('accel', N), 'VelocityRandomWalk', STANDARD_GRAVITY * 1e-3),
        (('gyro', K), 'GyroBiasStability', _DEGREE / 3600 / sqrt(_AIRSIM_TIMES['gyro'])),
        (('accel', K), 'AccelBiasStability',
         STANDARD_GRAVITY * 1e-6 / sqrt(_AIRSIM_TIMES['accel'])))
    remarks = [*numbers.provenance(), 'Imu goes below Vehicles, NAME, Sensors of settings.json.']
    for (sensor, key), name, unit in names:
        entry = worst(numbers, sensor, key, times(1 / unit), '',
                      UNITS[sensor, key])
        if entry.value is None:
            remarks.append(f'{name}: this result has no value for it')
        else:
            settings[name] = float(real(entry.value))
            remarks += [f'{name}: {remark}' for remark in entry.remarks[1:]]
    settings['GyroBiasStabilityTau'] = _AIRSIM_TIMES['gyro']
    settings['AccelBiasStabilityTau'] = _AIRSIM_TIMES['accel']
    text = json.dumps({'imu_allan': remarks, 'Imu': settings}, indent=2, ensure_ascii=False)
    return text + '\n'


def _xml_heading(numbers: Numbers, *more: str) -> list[str]:
    return ['<!--', *(_comment(line) for line in (*numbers.provenance(), *more)), '-->']


def _comment(text: str) -> str:
    """`text` so that it cannot end a comment."""
    return escape(text, quote=False).replace('--', '- -')
