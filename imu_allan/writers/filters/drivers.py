# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What drivers put into the covariances of Imu messages, for filters that take them from there.

There is no bias state behind these: the noise density as measured, per sample.
"""

from math import sqrt

from imu_allan.writers.filters.chosen_numbers import N, Numbers, Sensor
from imu_allan.writers.filters.layout import (
    each,
    FilterConfig,
    heading,
    indented,
    joined,
    Pair,
    pairs,
    real,
    SAMPLE_UNITS,
    triples,
)

_NAMES: dict[Sensor, str] = {'accel': 'linear_acceleration', 'gyro': 'angular_velocity'}
_MICROSTRAIN: dict[Sensor, str] = {'accel': 'imu_linear_cov', 'gyro': 'imu_angular_cov'}


def robot_localization(numbers: Numbers) -> FilterConfig:
    """
    Covariances of the Imu message, which robot_localization takes from the driver: N^2 f.

    REP-145 names the driver's parameters ``linear_acceleration_stddev`` and
    ``angular_velocity_stddev`` (N sqrt(f)); the 3 x 3 arrays are the message's own fields.
    """
    f = numbers.rate()
    lines = [*heading(numbers),
             '# robot_localization takes the covariances from the Imu messages: these are '
             'parameters for the driver.',
             f'# Per sample at f = {f:g} Hz: N sqrt(f) and N^2 f. A filter that runs slower and '
             'averages has less.', '/**:', '  ros__parameters:']
    names: dict[Pair, str] = {(sensor, N): f'{name}_stddev' for sensor, name in _NAMES.items()}
    body = pairs(numbers, names, lambda value: value * sqrt(f), 'sqrt(f)', SAMPLE_UNITS)
    for sensor, name in _NAMES.items():
        body += _matrix(numbers, sensor, f'{name}_covariance')
    return FilterConfig('imu_covariance.yaml', joined([*lines, *indented(body, 4)]))


def _matrix(numbers: Numbers, sensor: Sensor, name: str) -> list[str]:
    f = numbers.rate()
    values, remarks = each(numbers, sensor, N, lambda value: value**2 * f)
    lines = ['', f'# N^2 f of x, y, z on the diagonal [({SAMPLE_UNITS[sensor, N]})^2]']
    if values is None:
        return [*lines, *(f'# {name}: {remark}' for remark in remarks)]
    cells = [real(values[i] if i == j else 0.0) for i in range(3) for j in range(3)]
    return [*lines, f'{name}: [{", ".join(cells)}]']


def autoware(numbers: Numbers) -> FilterConfig:
    """
    Autoware's ``imu_corrector.param.yaml``: N sqrt(f) and the mean at rest, for each axis.

    imu_corrector_core.cpp subtracts the offsets and squares the standard deviations into the
    covariances of the message.
    """
    f = numbers.rate()
    lines = [*heading(numbers), f'# Standard deviations per sample at f = {f:g} Hz; offsets are '
             'the means at rest, which hold until the', '# next start. Earth rate (up to '
             '7.29e-05 rad/s) is in them. The defaults, 0.03 rad/s and 10000 m/s^2, have room for '
             'motion;', '# these are the sensor alone.', '/**:', '  ros__parameters:']
    body = []
    for letter in 'xyz':
        name = f'gyro_{letter}'
        own = numbers.of_axis.get(name, {})
        axis = numbers.result.axes.get(name)
        if N in own:
            body.append(f'angular_velocity_stddev_{letter}{letter}: '
                        f'{real(own[N].value * sqrt(f))}')
        else:
            body.append(f'# angular_velocity_stddev_{letter}{letter}: this result has no value '
                        'for it')
        if N in own and axis is not None and axis.mean is not None:
            body.append(f'angular_velocity_offset_{letter}: {real(axis.mean)}')
    body += pairs(numbers, {('accel', N): 'acceleration_stddev'}, lambda value: value * sqrt(f),
                  'sqrt(f)', SAMPLE_UNITS)
    return FilterConfig('imu_corrector.param.yaml', joined([*lines, *indented(body, 4)]))


def drivers(numbers: Numbers) -> FilterConfig:
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
    f = numbers.rate()
    lines = [*heading(numbers), f'# Per sample at f = {f:g} Hz. Take the lines of your driver.']
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
    body += indented(pairs(numbers, {('accel', N): 'linear_accel_cov',
                                     ('gyro', N): 'angular_velocity_cov'},
                           lambda value: value**2 * f, '^2 f', squared), 4)
    body += ['', '# xsens_mti_ros2_driver: standard deviations of x, y, z; the node as its launch '
             'file names it', 'xsens_mti_node:', '  ros__parameters:']
    root = sqrt(f)
    stddev: dict[Pair, str] = {(sensor, N): f'{name}_stddev' for sensor, name in _NAMES.items()}
    body += indented(triples(numbers, stddev, lambda value: value * root, 'sqrt(f)',
                             SAMPLE_UNITS), 4)
    body += ['', '# mavros, plugin imu', '/**/imu:', '  ros__parameters:']
    stdev: dict[Pair, str] = {(sensor, N): f'{name}_stdev' for sensor, name in _NAMES.items()}
    body += indented(pairs(numbers, stdev, lambda value: value * root, 'sqrt(f)',
                           SAMPLE_UNITS), 4)
    return FilterConfig('imu_drivers.yaml', joined([*lines, *body]))
