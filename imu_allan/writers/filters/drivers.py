# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What drivers put into the covariances of Imu messages, for filters that take them from there.

There is no bias state behind these but FusionCore's: the noise density as measured, per sample.
"""

from collections.abc import Callable, Mapping
from math import sqrt

from imu_allan.writers.filters.chosen_numbers import K, N, Numbers, Scale, Sensor
from imu_allan.writers.filters.layout import (
    each,
    heading,
    indented,
    joined,
    Pair,
    pairs,
    real,
    SAMPLE_UNITS,
    times,
    triples,
)

_NAMES: dict[Sensor, str] = {'accel': 'linear_acceleration', 'gyro': 'angular_velocity'}
_MICROSTRAIN: dict[Sensor, str] = {'accel': 'imu_linear_cov', 'gyro': 'imu_angular_cov'}
_REALSENSE: dict[Sensor, str] = {'accel': 'linear_accel_cov', 'gyro': 'angular_velocity_cov'}

Rows = Callable[..., list[str]]


def robot_localization(numbers: Numbers) -> str:
    """
    Covariances of the Imu message, which robot_localization takes from the driver: N^2 f.

    REP-145 names the driver's parameters ``linear_acceleration_stddev`` and
    ``angular_velocity_stddev`` (N sqrt(f)); the 3 x 3 arrays are the message's own fields.
    """
    lines = [*heading(numbers),
             '# robot_localization takes the covariances from the Imu messages: these are '
             'parameters for the driver.',
             f'# Per sample at {_rates(numbers)}: N sqrt(f) and N^2 f. A filter that runs slower '
             'and averages has less.', '/**:', '  ros__parameters:']
    body = _deviations(numbers, {sensor: f'{name}_stddev' for sensor, name in _NAMES.items()})
    for sensor, name in _NAMES.items():
        body += _matrix(numbers, sensor, f'{name}_covariance')
    return joined([*lines, *indented(body, 4)])


def _rates(numbers: Numbers) -> str:
    """Say the rate, or those of sensors with a topic each."""
    rates = {sensor: numbers.rate_of(sensor) for sensor in _NAMES}
    if len(set(rates.values())) == 1:
        return f'f = {rates["gyro"]:g} Hz'
    return 'f = ' + ', '.join(f'{rate:g} Hz ({sensor})' for sensor, rate in rates.items())


def _variance_at(rate_hz: float) -> Scale:
    return lambda value: value**2 * rate_hz


def _deviations(numbers: Numbers, names: Mapping[Sensor, str], rows: Rows = pairs) -> list[str]:
    """Give N sqrt(f), each sensor at the rate of its own messages."""
    return [line for sensor, name in names.items() for line in rows(
        numbers, {(sensor, N): name}, times(sqrt(numbers.rate_of(sensor))), 'sqrt(f)',
        SAMPLE_UNITS)]


def _matrix(numbers: Numbers, sensor: Sensor, name: str) -> list[str]:
    f = numbers.rate_of(sensor)
    values, remarks = each(numbers, sensor, N, _variance_at(f))
    lines = ['', f'# N^2 f of x, y, z on the diagonal [({SAMPLE_UNITS[sensor, N]})^2]']
    lines += [f'# {name}: {remark}' for remark in remarks]
    if values is None:
        return lines
    cells = [real(values[i] if i == j else 0.0) for i in range(3) for j in range(3)]
    return [*lines, f'{name}: [{", ".join(cells)}]']


def fusioncore(numbers: Numbers) -> str:
    """
    Parameters of FusionCore: N sqrt(f), which it squares, and K^2/f, which it adds at each step.

    ``imu_noise_matrix`` (fusioncore/sensors/imu.hpp) squares ``imu.gyro_noise`` and
    ``imu.accel_noise`` into R. ``UKF::predict`` (ukf.cpp) adds ``ukf.q_gyro_bias`` and
    ``ukf.q_accel_bias``, which are variances, once a prediction whatever its length.
    """
    f = numbers.rate()
    lines = [*heading(numbers),
             f'# Per prediction at f = {f:g} Hz, the rate of the IMU: N sqrt(f), which FusionCore '
             'squares, and the variance K^2/f,', '# which it adds as it is.', 'fusioncore:',
             '  ros__parameters:']
    variances: dict[Pair, str] = {('gyro', K): '(rad/s)^2', ('accel', K): '(m/s^2)^2'}
    body = pairs(numbers, {('gyro', N): 'imu.gyro_noise', ('accel', N): 'imu.accel_noise'},
                 times(sqrt(f)), 'sqrt(f)', SAMPLE_UNITS)
    body += pairs(numbers, {('gyro', K): 'ukf.q_gyro_bias', ('accel', K): 'ukf.q_accel_bias'},
                  lambda value: value**2 / f, '^2/f', variances)
    return joined([*lines, *indented(body, 4)])


def autoware(numbers: Numbers) -> str:
    """
    Autoware's ``imu_corrector.param.yaml``: N sqrt(f) and the mean at rest, for each axis.

    imu_corrector_core.cpp subtracts the offsets and squares the standard deviations into the
    covariances of the message.
    """
    root = sqrt(numbers.rate_of('gyro'))
    lines = [*heading(numbers), f'# Standard deviations per sample at {_rates(numbers)}; offsets '
             'are the means at rest, which hold until the', '# next start. Earth rate (up to '
             '7.29e-05 rad/s) is in them. The defaults, 0.03 rad/s and 10000 m/s^2, have room for '
             'motion;', '# these are the sensor alone.', '/**:', '  ros__parameters:']
    body = []
    for letter in 'xyz':
        name = f'gyro_{letter}'
        own = numbers.of_axis.get(name, {})
        axis = numbers.result.axes.get(name)
        if N in own:
            body.append(f'# {numbers.measured(name, N, times(root))}')
            body.append(f'angular_velocity_stddev_{letter}{letter}: '
                        f'{real(own[N].value * root)}')
        else:
            body.append(f'# angular_velocity_stddev_{letter}{letter}: this result has no value '
                        'for it')
        if N in own and axis is not None and axis.mean is not None:
            body.append(f'angular_velocity_offset_{letter}: {real(axis.mean)}')
    body += _deviations(numbers, {'accel': 'acceleration_stddev'})
    return joined([*lines, *indented(body, 4)])


def drivers(numbers: Numbers) -> str:
    """
    Parameters of common drivers: N^2 f or N sqrt(f), each under the driver's own names.

    microstrain_inertial: publishers.cpp copies ``imu_linear_cov`` and ``imu_angular_cov``.
    vectornav: the node ``vn_sensor_msgs``, not ``vectornav``, has the covariances, and
    ``VnSensorMsgs::fill_covariance_from_param`` (vn_sensor_msgs.cc) copies nine numbers.
    realsense2: ``BaseRealSenseNode::ImuMessage_AddDefaultValues`` (base_realsense_node.cpp) puts
    one number on the diagonal, on the node that rs_launch.py calls ``camera``.
    xsens_mti: ``ImuPublisher`` (imupublisher.h) squares three numbers, on the node that
    xsens_mti_node.launch.py calls ``xsens_mti_node``.
    mavros: ``IMUPlugin::setup_covariance`` (plugins/imu.cpp) squares one.
    """
    lines = [*heading(numbers), f'# Per sample at {_rates(numbers)}. Take the lines of your '
             'driver.']
    body = ['', '# microstrain_inertial_driver', 'microstrain_inertial_driver:',
            '  ros__parameters:']
    for sensor, name in _MICROSTRAIN.items():
        body += indented(_matrix(numbers, sensor, name), 4)
    body += ['', '# vectornav, whose node vn_sensor_msgs makes the Imu messages',
             'vn_sensor_msgs:', '  ros__parameters:']
    for sensor, name in _NAMES.items():
        body += indented(_matrix(numbers, sensor, f'{name}_covariance'), 4)
    body += ['', '# realsense2_camera: one variance for a sensor; camera is the camera_name of '
             'its launch file', '/**/camera:', '  ros__parameters:']
    squared: dict[Pair, str] = {pair: f'({unit})^2' for pair, unit in SAMPLE_UNITS.items()}
    for sensor, name in _REALSENSE.items():
        f = numbers.rate_of(sensor)
        body += indented(pairs(numbers, {(sensor, N): name}, _variance_at(f), '^2 f', squared), 4)
    body += ['', '# xsens_mti_ros2_driver: standard deviations of x, y, z; the node as its launch '
             'file names it', 'xsens_mti_node:', '  ros__parameters:']
    body += indented(_deviations(numbers, {sensor: f'{name}_stddev' for sensor, name
                                           in _NAMES.items()}, triples), 4)
    body += ['', '# mavros, plugin imu', '/**/imu:', '  ros__parameters:']
    body += indented(_deviations(numbers, {sensor: f'{name}_stdev' for sensor, name
                                           in _NAMES.items()}), 4)
    return joined([*lines, *body])
