# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Filters and smoothers that a lidar corrects."""

from math import sqrt
from typing import Any

from imu_allan.writers.filters.chosen_numbers import K, N, Numbers, Sensor
from imu_allan.writers.filters.layout import (
    document,
    heading,
    indented,
    joined,
    Pair,
    pairs,
    real,
    SAMPLE_UNITS,
    times,
    topic_of,
    with_topic,
    worst,
)

_SQUARED: dict[Pair, str] = {pair: f'({unit})^2' for pair, unit in SAMPLE_UNITS.items()}
_LIO_SAM: dict[Pair, str] = {('accel', N): 'imuAccNoise', ('gyro', N): 'imuGyrNoise',
                             ('accel', K): 'imuAccBiasN', ('gyro', K): 'imuGyrBiasN'}
_GLIM: dict[Sensor, tuple[str, str]] = {'accel': ('imu_acc_noise', 'm/s^2'),
                                        'gyro': ('imu_gyro_noise', 'rad/s')}


def lio_sam(numbers: Numbers) -> str:
    """
    LIO-SAM's ``params.yaml`` (ROS 2): N and K, continuous.

    imuPreintegration.cpp squares the noises into GTSAM's continuous covariances and scales the
    biases by ``sqrt(deltaTij)``.
    """
    return document(numbers, _LIO_SAM, opens=['/**:', '  ros__parameters:'], indent=4,
                    ends=with_topic(numbers, 'imuTopic'))


def lio_sam_ros1(numbers: Numbers) -> str:
    """
    LIO-SAM's ``params.yaml`` of ROS 1: N and K, continuous, under ``lio_sam/``.

    utility.h reads ``lio_sam/imuAccNoise`` and so on from the parameter server.
    """
    return document(numbers, _LIO_SAM, opens=['lio_sam:'], indent=2,
                    ends=with_topic(numbers, 'imuTopic'))


_IN_G = ('The program scales what it measures at rest to 9.81 m/s^2: the same numbers for a '
         'driver', 'that gives accelerations in g, such as that of Livox.')


def fast_lio(numbers: Numbers) -> str:
    """
    FAST-LIO's ``mapping`` section: variances per sample, N^2 f and K^2 f.

    ``esekf::predict`` (esekfom.hpp) adds ``dt^2 Q`` at each step.
    """
    f = numbers.rate()
    return document(
        numbers, {('accel', N): 'acc_cov', ('gyro', N): 'gyr_cov', ('accel', K): 'b_acc_cov',
                  ('gyro', K): 'b_gyr_cov'},
        notes=[f'Variances per sample at f = {f:g} Hz: N^2 f and K^2 f.', *_IN_G,
               'The ports to ROS 2 want mapping: under /**: ros__parameters:'],
        opens=['mapping:'], indent=2, **_variances(f)) + _common(numbers, 2)


def _variances(rate_hz: float) -> dict[str, Any]:
    """Return how `pairs` writes N^2 f and K^2 f."""
    return {'scale': lambda value: value**2 * rate_hz, 'scaling': '^2 f', 'units': _SQUARED}


def _common(numbers: Numbers, indent: int) -> str:
    topic = topic_of(numbers)
    return f'\ncommon:\n{"":{indent}}imu_topic: {topic}\n' if topic else ''


def point_lio(numbers: Numbers) -> str:
    """
    Point-LIO's ``mapping`` section: variances per sample, N^2 f and K^2 f.

    ``process_noise_cov_input`` (Estimator.cpp) puts them on the diagonal of Q, which a step
    multiplies by ``dt^2``: that of a sample with ``prop_at_freq_of_imu``, the default, else that
    of a lidar point. ``acc_cov_output`` and ``gyr_cov_output`` are the motion model.
    """
    f = numbers.rate()
    lines = [*heading(numbers), f'# Variances per sample at f = {f:g} Hz: N^2 f and K^2 f, for '
             'prop_at_freq_of_imu: true, the default.',
             '# acc_cov_output and gyr_cov_output describe the motion, not the sensor: leave them.'
             ' acc_norm is 9.81', '# for accelerations in m/s^2, 1 for a driver that gives g;'
             ' the numbers are the same for both.', 'mapping:']
    parts: tuple[dict[Pair, str], ...] = (
        {('accel', N): 'acc_cov_input', ('gyro', N): 'gyr_cov_input'},
        {('accel', N): 'imu_meas_acc_cov', ('gyro', N): 'imu_meas_omg_cov'},
        {('accel', K): 'b_acc_cov', ('gyro', K): 'b_gyr_cov'})
    for names in parts:
        lines += indented(pairs(numbers, names, **_variances(f)), 4)
    lines += ['', '    # [s], the sample interval', f'    imu_time_inte: {real(1 / f)}']
    return joined(lines) + _common(numbers, 4)


def fast_livo2(numbers: Numbers) -> str:
    """
    FAST-LIVO2's ``imu`` section: variances per sample, N^2 f.

    ``ImuProcess::UndistortPcl`` (IMU_Processing.cpp) adds ``cov dt^2`` at each step. Its
    ``b_acc_cov`` and ``b_gyr_cov`` are never read from the file.
    """
    f = numbers.rate()
    return document(
        numbers, {('accel', N): 'acc_cov', ('gyro', N): 'gyr_cov'},
        notes=[f'Variances per sample at f = {f:g} Hz: N^2 f. The program has its bias variances '
               'in its', 'source and reads none: b_acc_cov and b_gyr_cov have no effect and are '
               'not written.', *_IN_G],
        opens=['imu:', '  imu_en: true'], indent=2, **_variances(f)) + _common(numbers, 2)


def glim(numbers: Numbers) -> str:
    """
    Write GLIM's ``config_sensors.json``: N for each sensor, one bias step for both per frame.

    ``IMUIntegration`` (imu_integration.cpp) squares ``imu_acc_noise`` and ``imu_gyro_noise`` into
    GTSAM's continuous covariances. ``OdometryEstimationIMU::insert_frame``
    (odometry_estimation_imu.cpp) ties the biases of two frames by ``Sigma(6, imu_bias_noise)``
    whatever the time between them: K times the root of that time, of the sensor for which that is
    larger.
    """
    frame = numbers.aiding_s or 0.1
    lines = [*heading(numbers, '//'), '// Part of config_sensors.json, which allows comments: put '
             'these in place of its own.', '{', '  "sensors": {']
    entries: list[str] = []
    for sensor, (name, unit) in _GLIM.items():
        entry = worst(numbers, sensor, N, lambda v: v, '', f'{unit}/sqrt(Hz)')
        lines += [f'    // {remark}' for remark in entry.remarks]
        if entry.value is not None:
            lines.append(f'    "{name}": {real(entry.value)},')
    for sensor, (_, unit) in _GLIM.items():
        found = numbers.worst(sensor, K)
        if found is not None:
            entries.append(f'{found[0]} {real(found[1].value * sqrt(frame))} {unit}, '
                           f'{numbers.measured(found[0], K, times(sqrt(frame)))}')
    steps = [one[1].value * sqrt(frame) for one in (numbers.worst('accel', K),
                                                    numbers.worst('gyro', K)) if one is not None]
    lines += [f'    // K sqrt(T), T = {frame:g} s between lidar frames; one value for both '
              'sensors, the larger:', f'    // {", ".join(entries) or "no value"}',
              f'    "imu_bias_noise": {real(max(steps))}' if steps else '    // imu_bias_noise',
              '  }', '}']
    return joined(lines)
