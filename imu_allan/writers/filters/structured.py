# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Consumers whose files are more than keys and formulas: JSON, XML, programs and matrices.

The docstring of each function states where in the consumer's source the meaning was read.
"""

import json
from math import sqrt
import re

from imu_allan.errors import ImuAllanError
from imu_allan.sensor.units import convert
from imu_allan.tuning.state_space import state_space as space_of_axis, StateSpace
from imu_allan.writers.curves import axes_of
from imu_allan.writers.filters.chosen_numbers import Key, Numbers, Sensor, SENSORS, times
from imu_allan.writers.filters.template import (
    each,
    expanded,
    heading,
    joined,
    provenance,
    quoted_in_xml,
    real,
    UNITS,
    worst,
)

_PARTS = ('transition', 'observation', 'process', 'measurement', 'cross', 'initial')
"""Parts of a state space, as the files name them."""


def basalt(numbers: Numbers) -> str:
    """
    Write Basalt's ``calibration.json``: N and K for each axis, continuous.

    ``Calibration::dicrete_time_accel_noise_std`` (calibration.hpp) multiplies by the root of
    ``imu_update_rate``, and ``IntegratedImuMeasurement::integrate`` (preintegration.h) adds dt^2
    times the square at each sample: N^2 dt. ``ImuBlock::linearizeImu`` (imu_block.hpp) weighs the
    difference of two biases by ``1/(K sqrt(dt))``, dt the time between the frames. JSON has no
    comments, so remarks are stored under a key that cereal ignores.
    """
    values: dict[str, object] = {'imu_update_rate': float(real(numbers.rate()))}
    remarks = provenance(numbers)
    names: dict[tuple[Sensor, Key], str] = {
        ('accel', 'N'): 'accel_noise_std', ('gyro', 'N'): 'gyro_noise_std',
        ('accel', 'K'): 'accel_bias_std', ('gyro', 'K'): 'gyro_bias_std'}
    for (sensor, key), name in names.items():
        found, said = each(numbers, sensor, key)
        remarks += [f'{name}: {remark}' for remark in said]
        if found is not None:
            values[name] = [float(real(value)) for value in found]
            remarks.append(f'{name}: {key} of x, y, z [{UNITS[sensor, key]}], continuous')
    text = json.dumps({'value0': values, 'imu_allan': remarks}, indent=4, ensure_ascii=False)
    return text + '\n'


def glim(numbers: Numbers) -> str:
    """
    Write GLIM's ``config_sensors.json``: N for each sensor, one bias step for both per frame.

    ``IMUIntegration`` (imu_integration.cpp) squares ``imu_acc_noise`` and ``imu_gyro_noise`` into
    GTSAM's continuous covariances. ``OdometryEstimationIMU::insert_frame``
    (odometry_estimation_imu.cpp) constrains the bias change between two frames by ``Sigma(6,
    imu_bias_noise)``, regardless of the time between them. The value is therefore K times the root
    of that time, the larger of both sensors.
    """
    frame = numbers.aiding_s or 0.1
    densities = expanded(numbers, """    "imu_acc_noise": {accel N},
    "imu_gyro_noise": {gyro N},""")
    steps, said = [], []
    for sensor in SENSORS:
        if (found := numbers.worst(sensor, 'K')) is not None:
            name, step = found[0], found[1].value * sqrt(frame)
            steps.append(step)
            measured = numbers.measured(name, 'K', times(sqrt(frame)))
            said.append(f'{name} {real(step)} {UNITS[sensor, "sigma"]}, {measured}')
    text = joined([
        *heading(numbers, '//'), '// Part of config_sensors.json, which allows comments: put '
        'these in place of its own.', '{', '  "sensors": {', str(densities),
        f'    // K sqrt(T), T = {frame:g} s between lidar frames; one value for both sensors, the '
        'larger:', f'    // {", ".join(said) or "no value"}',
        f'    "imu_bias_noise": {real(max(steps))}' if steps else '    // imu_bias_noise',
        '  }', '}'])
    # JSON has no comma after the last value, whichever that is.
    return re.sub(r',(?=\n(?: *//.*\n)* *\})', '', text)


def gazebo(numbers: Numbers) -> str:
    """
    Write the SDF noise of a Gazebo IMU sensor for each axis: N sqrt(f), and K.

    ``GaussianNoiseModel::ApplyImpl`` of gz-sensors (GaussianNoiseModel.cc) adds noise of standard
    deviation ``dynamic_bias_stddev sqrt(Tc/2 (1 - exp(-2 dt/Tc)))`` to the bias at each step. This
    parameter is thus the driving density K, ``sigma sqrt(2/Tc)``, not the standard deviation of
    the bias. ``stddev`` refers to a sample. Releases whose ``ApplyImpl`` has no time step have no
    dynamic bias.
    """
    f = numbers.rate()
    lines = ['<!--', *map(quoted_in_xml, provenance(numbers)),
             f'stddev = N sqrt(f) at f = {f:g} Hz, the update_rate of the sensor; '
             'dynamic_bias_stddev is the', 'driving density K = sigma sqrt(2/Tc), as gz-sensors '
             'uses it, not the standard deviation of the bias.', '-->', '<imu>']
    tags: dict[Sensor, str] = {'gyro': 'angular_velocity', 'accel': 'linear_acceleration'}
    for sensor, tag in tags.items():
        lines.append(f'  <{tag}>')
        for name in axes_of(numbers.result.axes, sensor):
            noise = expanded(numbers, f"""    <{name[-1]}><noise type="gaussian">
      <mean>0</mean>
      <stddev>{{{name} N sqrt(f)}}</stddev>""")
            bias = expanded(numbers, f"""\
      <dynamic_bias_stddev>{{{name} K}}</dynamic_bias_stddev>
      <dynamic_bias_correlation_time>{{{name} Tc}}</dynamic_bias_correlation_time>""")
            if noise is not None:
                lines += [noise, bias or f'      <!-- dynamic_bias: {numbers.no_value} -->',
                          f'    </noise></{name[-1]}>']
        lines.append(f'  </{tag}>')
    return joined([*lines, '</imu>'])


def airsim(numbers: Numbers) -> str:
    """
    Write AirSim's ``Imu`` settings: deg/sqrt(h), deg/h, mg/sqrt(Hz), ug.

    ImuSimpleParams.hpp converts from these units. ImuSimple.hpp applies a random walk of
    ``stability/sqrt(tau)`` per root second to the bias. So the stability is K sqrt(tau), with
    AirSim's own tau.
    """
    settings: dict[str, object] = {'SensorType': 2, 'Enabled': True}
    # Seconds, from ImuSimpleParams.hpp; the file states them explicitly.
    gyro_tau, accel_tau = 500.0, 800.0
    names: dict[tuple[Sensor, Key], tuple[str, str, float]] = {
        ('gyro', 'N'): ('AngularRandomWalk', 'deg/sqrt(h)', 1.0),
        ('accel', 'N'): ('VelocityRandomWalk', 'mg/sqrt(Hz)', 1.0),
        ('gyro', 'K'): ('GyroBiasStability', 'deg/h/sqrt(s)', sqrt(gyro_tau)),
        ('accel', 'K'): ('AccelBiasStability', 'ug/sqrt(s)', sqrt(accel_tau))}
    remarks = [*provenance(numbers), 'Imu goes below Vehicles, NAME, Sensors of settings.json.']
    for (sensor, key), (name, unit, factor) in names.items():
        scale = times(factor * convert(1.0, UNITS[sensor, key], unit))
        value, said = worst(numbers, sensor, key, scale)
        if value is None:
            remarks.append(f'{name}: {numbers.no_value}')
        else:
            settings[name] = float(real(value))
            remarks += [f'{name}: {remark}' for remark in said]
    settings |= {'GyroBiasStabilityTau': gyro_tau, 'AccelBiasStabilityTau': accel_tau}
    return json.dumps({'imu_allan': remarks, 'Imu': settings}, indent=2, ensure_ascii=False) + '\n'


def matlab(numbers: Numbers) -> str:
    """
    Write MATLAB's ``gyroparams`` and ``accelparams``: N, B and K, for each axis, single-sided.

    ``setupBandwidth`` of imuSensor (IMUSensorSimulator.m of the toolbox) uses f for the NoiseType
    'single-sided', and f/2 for 'double-sided', the default. ``setStdDevWhiteNoise`` multiplies
    NoiseDensity by the root of that, and ``setStdDevRandWalk`` divides RandomWalk by it. The
    correct values, N sqrt(f) and K/sqrt(f), are thus those of 'single-sided'.

    ``setStdDevBiasInst`` multiplies B by ``sqrt(2/(f pCorrelationTime))``. That factor is 1,
    because ``setupBiasInstabilityDrift`` sets the time to two samples. The resulting white noise
    passes the filter of BiasInstabilityCoefficients. With n poles of ``fractalcoef`` (R2023b; N.
    J. Kasdin, Proc. IEEE 83(5), 1995), it becomes flicker of level B over times up to n samples.
    With one pole, the default, it is white noise of 2 B per sample, without flicker.
    """
    # Flicker is accurate to 2 % over half as many samples, and to 10 % over four times as many.
    poles = 2000
    lines = [*heading(numbers, '%'), "% NoiseType is 'single-sided': imuSensor then makes N "
             "sqrt(f) of NoiseDensity. 'double-sided', its default,",
             '% makes N sqrt(f/2) of it.']
    flicker = {name: axis.coefficients['bias_instability']
               for name, axis in numbers.result.axes.items()}
    if any(found.value for found in flicker.values()):
        lines += [f'% BiasInstability is B, flicker, by a filter of {poles} poles: right '
                  f'to 10 % for {4 * poles / numbers.rate():.3g} s; more poles reach',
                  '% further and take more time. fractalcoef, which makes it, needs MATLAB R2023b '
                  'or later; the default of one pole makes no flicker.']
    for sensor in ('gyro', 'accel'):
        own = {f'{sensor}_{letter}': flicker.get(f'{sensor}_{letter}') for letter in 'xyz'}
        levels = [found.value or 0.0 if found else 0.0 for found in own.values()]
        densities = expanded(numbers, f"""
{sensor} = {sensor}params;
{sensor}.NoiseType = 'single-sided';

{sensor}.NoiseDensity = [{{{sensor} N of x, y, z}}];

{sensor}.RandomWalk = [{{{sensor} K of x, y, z}}];
""")
        lines += [str(densities),
                  '% B of x, y, z, bias instability; 0 where it is not observable',
                  *(f'% {name} {found}' for name, found in own.items()
                    if found and (found.upper95 or found.observable)),
                  f'{sensor}.BiasInstability = [{", ".join(map(real, levels))}];']
        if any(levels):
            lines.append(f'{sensor}.BiasInstabilityCoefficients = fractalcoef({poles}, 1);')
    lines += ['', f"imu = imuSensor('accel-gyro', 'SampleRate', {real(numbers.rate())}, "
              "'Gyroscope', gyro, 'Accelerometer', accel);"]
    return joined(lines)


def plain(numbers: Numbers) -> str:
    """Write N, B and K of each axis as measured, and N and K for a filter, as YAML in SI units."""
    lines = [*heading(numbers),
             '# SI units: noise_density rad/s/sqrt(Hz) and m/s^2/sqrt(Hz), bias_instability rad/s '
             'and m/s^2, rate_random_walk',
             '# rad/s^2/sqrt(Hz) and m/s^3/sqrt(Hz). Measured with 95 % intervals; filter_... are '
             'for a filter, as said above.']
    for name, axis in numbers.result.axes.items():
        own = numbers.of_axis[name]
        if not own:
            continue
        lines += ['', f'{name}:']
        for key in ('noise_density', 'bias_instability', 'rate_random_walk'):
            found = axis.coefficients[key]
            if found.value is not None:
                ends = '' if found.ci95 is None else (
                    f', low95: {real(found.ci95[0])}, high95: {real(found.ci95[1])}')
                lines.append(f'  {key}: {{value: {real(found.value)}{ends}}}')
            elif found.upper95 is not None:
                lines.append(f'  {key}: {{below95: {real(found.upper95)}}}')
            else:
                lines.append(f'  # {key}: {numbers.no_value}')
        for letter, number in own.items():
            word = {'N': 'filter_noise_density', 'K': 'filter_random_walk'}.get(letter)
            if word is not None:
                bound = '   # the upper bound' if number.bound else ''
                lines.append(f'  {word}: {real(number.value)}{bound}')
    return joined(lines)


def state_space(numbers: Numbers) -> str:
    """
    Write the drift model of every axis as a state space of the mean rate over a step, as JSON.

    ``x' = transition x + w``, ``y = observation x + v``, ``process`` = E[w w'], ``measurement`` =
    E[v v], ``cross`` = E[w v], ``initial`` = covariance of x; SI units. All digits are written: a
    process with a correlation time of an hour keeps a share of 0.99997 in a step of 0.1 s.
    """
    spaces = _spaces(numbers)
    step = next(iter(spaces.values())).step_s
    document = {'imu_allan': provenance(numbers), 'step_s': step,
                'axes': {name: {part: getattr(space, part).tolist() for part in _PARTS}
                         for name, space in spaces.items()}}
    return json.dumps(document, indent=2) + '\n'


def state_space_cpp(numbers: Numbers) -> str:
    """Write the same as a C++ header of constants, with one namespace per axis."""
    spaces = _spaces(numbers)
    lines = ['#pragma once', *heading(numbers, '//'), '//',
             "// x' = transition x + w, y = observation x + v, y the mean rate over one step;",
             "// process = E[w w'], measurement = E[v v], cross = E[w v], initial = covariance "
             'of x.', '', '#include <array>', '', 'namespace imu_allan {', '',
             'template <int Rows, int Columns>',
             'using Matrix = std::array<std::array<double, Columns>, Rows>;']
    for name, space in spaces.items():
        lines += ['', f'namespace {name} {{', f'constexpr int states = {len(space.transition)};',
                  f'constexpr double step_s = {space.step_s!r};']
        for part in _PARTS:
            rows = getattr(space, part).tolist()
            cells = ', '.join(f'{{{{{", ".join(map(repr, row))}}}}}' for row in rows)
            lines.append(f'constexpr Matrix<{len(rows)}, {len(rows[0])}> {part}{{{{{cells}}}}};')
        lines.append(f'}}  // namespace {name}')
    return joined([*lines, '', '}  // namespace imu_allan'])


def _spaces(numbers: Numbers) -> dict[str, StateSpace]:
    if numbers.options.conservative or numbers.options.inflate:
        raise ImuAllanError(f'{numbers.name} is the drift model as measured: neither '
                            '--conservative nor --inflate applies; scale its matrices yourself')
    models = {name: axis.drift_model for name, axis in numbers.result.axes.items()
              if axis.drift_model is not None}
    # Without a request, use the shortest step for which the models of all axes are valid.
    step = numbers.options.aiding_s or max(
        [numbers.aiding_s or 0.0, *(model.from_s for model in models.values())])
    spaces = {}
    for name in models:
        try:
            spaces[name] = space_of_axis(numbers.result.axes[name], step)
        except ImuAllanError as error:
            raise ImuAllanError(f'{name}: {error}') from error
    if not spaces:
        why = ('a datasheet has no drift model; plain has its numbers' if numbers.of_datasheet
               else 'this result has no drift model; analyze the recording again')
        raise ImuAllanError(f'no configuration for {numbers.name}: {why}')
    return spaces


WRITERS = {write.__name__: write for write in (
    basalt, glim, gazebo, airsim, matlab, plain, state_space, state_space_cpp)}
"""Writers by consumer name; the other consumers have templates."""
