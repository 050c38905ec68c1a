# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What to put into a filter's configuration.

Every consumer has its own names, its own file format and its own idea of what the numbers mean:
continuous or per sample, standard deviation or variance. The functions here know them; each says
in its docstring where in the consumer's source the meaning was read. Throughout, N is the noise
density and K the rate random walk of the result, f the sample rate.

A consumer that takes one value for a sensor gets that of the worst axis, the others stand beside
it in a comment. Where the data cannot show a coefficient the 95 % upper bound stands in and the
comment says so: a filter needs some number, and this one is not too small.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
import json
from math import sqrt
import os
from pathlib import Path

from imu_allan.errors import ImuAllanError, printable
from imu_allan.result import AxisResult, Result
from imu_allan.writers.atomic import write_atomically

N = 'noise_density'
K = 'rate_random_walk'
_LETTERS = {N: 'N', K: 'K'}
_TERMS = {('gyro', N): 'angle random walk', ('gyro', K): 'gyro bias random walk',
          ('accel', N): 'velocity random walk', ('accel', K): 'accelerometer bias random walk'}
_UNITS = {('gyro', N): 'rad/s/sqrt(Hz)', ('gyro', K): 'rad/s^2/sqrt(Hz)',
          ('accel', N): 'm/s^2/sqrt(Hz)', ('accel', K): 'm/s^3/sqrt(Hz)'}
_SAMPLE_UNITS = {('gyro', N): 'rad/s', ('gyro', K): 'rad/s^2',
                 ('accel', N): 'm/s^2', ('accel', K): 'm/s^3'}
_SENSORS = ('accel', 'gyro')


@dataclass(frozen=True)
class FilterConfig:
    """
    A configuration file for one consumer.

    Attributes
    ----------
    name : str
        Suggested file name, different for every consumer.
    text : str

    """

    name: str
    text: str


@dataclass(frozen=True)
class _Entry:
    """A number for a configuration, or why there is none, with what to say about it."""

    value: float | None
    remarks: tuple[str, ...]


Scale = Callable[[float], float]


def export(result: Result, consumer: str, rate_hz: float | None = None) -> FilterConfig:
    """
    Write the configuration of a filter.

    Parameters
    ----------
    result : Result
        Where the numbers come from.
    consumer : str
        One of `CONSUMERS`.
    rate_hz : float, optional
        Rate at which the consumer takes samples or predicts, for those whose numbers depend on
        it: by default the sample rate of the result, for an autopilot the usual prediction rate.

    Returns
    -------
    FilterConfig

    Raises
    ------
    ImuAllanError
        If `consumer` is not known, or needs a rate and the result has none.

    """
    if consumer not in CONSUMERS:
        raise ImuAllanError(f'no configuration is known for {consumer!r}; '
                            f'known are {", ".join(CONSUMERS)}')
    return CONSUMERS[consumer](result, rate_hz)


def save_exports(result: Result, folder: str | os.PathLike[str],
                 consumers: Iterable[str]) -> list[Path]:
    """
    Write the configurations of several filters into one folder.

    Returns
    -------
    list of Path
        The files written.

    Raises
    ------
    ImuAllanError
        If a consumer is not known or needs a rate that the result does not have, or a file cannot
        be written.

    """
    configs = [export(result, consumer) for consumer in consumers]
    for config in configs:
        write_atomically(Path(folder) / config.name, config.text.encode())
    return [Path(folder) / config.name for config in configs]


def kalibr(result: Result, rate_hz: float | None = None) -> FilterConfig:
    """
    Kalibr's ``imu.yaml``: N and K, continuous; `rate_hz` replaces ``update_rate``.

    ``ImuParameters`` of Kalibr's ConfigReader.py divides the noise density by ``sqrt(dt)`` itself,
    takes the random walk as it is, and refuses values that are not above zero.
    """
    lines = _heading(result, 'Kalibr')
    lines += _pairs(result, {('accel', N): 'accelerometer_noise_density',
                             ('accel', K): 'accelerometer_random_walk',
                             ('gyro', N): 'gyroscope_noise_density',
                             ('gyro', K): 'gyroscope_random_walk'})
    lines += ['', *_topic_and_rate(result, rate_hz, 'rostopic', 'update_rate', 'kalibr')]
    return FilterConfig('imu.yaml', _joined(lines))


def openvins(result: Result, rate_hz: float | None = None) -> FilterConfig:
    """
    Write OpenVINS' ``kalibr_imu_chain.yaml``: N and K, continuous, as for Kalibr.

    ``Propagator::predict_and_compute`` scales by ``sqrt(dt)`` (N by its inverse) itself. The file
    is read by OpenCV's FileStorage; the geometry in it is the identity that OpenVINS ships.
    """
    lines = ['%YAML:1.0', *_heading(result, 'OpenVINS'), '', 'imu0:']
    identity = ('[1.0, 0.0, 0.0]', '[0.0, 1.0, 0.0]', '[0.0, 0.0, 1.0]')
    body = ['# Geometry: no more than the identity, put in what your calibration found.', 'T_i_b:',
            *(f'  - [{", ".join("1.0" if i == j else "0.0" for j in range(4))}]'
              for i in range(4))]
    body += _pairs(result, {('accel', N): 'accelerometer_noise_density',
                            ('accel', K): 'accelerometer_random_walk',
                            ('gyro', N): 'gyroscope_noise_density',
                            ('gyro', K): 'gyroscope_random_walk'})
    body += ['', *_topic_and_rate(result, rate_hz, 'rostopic', 'update_rate', 'openvins'),
             'time_offset: 0.0', 'model: "kalibr"']
    for key in ('Tw', 'R_IMUtoGYRO', 'Ta', 'R_IMUtoACC'):
        body += [f'{key}:', *(f'  - {row}' for row in identity)]
    body += ['Tg:', *['  - [0.0, 0.0, 0.0]'] * 3]
    lines += [f'  {line}' if line else '' for line in body]
    return FilterConfig('kalibr_imu_chain.yaml', _joined(lines))


def orb_slam3(result: Result, rate_hz: float | None = None) -> FilterConfig:
    """
    ORB-SLAM3's ``IMU.*`` settings: N and K, continuous.

    ``Settings::readIMU`` reads them as reals through OpenCV's FileStorage; ``Tracking`` multiplies
    the noises by ``sqrt(f)`` and divides the walks by it.
    """
    lines = ['%YAML:1.0', *_heading(result, 'ORB-SLAM3'),
             '# Part of a settings file: put these lines in place of its IMU noise section.']
    lines += _pairs(result, {('gyro', N): 'IMU.NoiseGyro', ('accel', N): 'IMU.NoiseAcc',
                             ('gyro', K): 'IMU.GyroWalk', ('accel', K): 'IMU.AccWalk'})
    lines += ['', '# [Hz], a real number in settings of File.version 1.0; '
              'older versions want a whole number',
              f'IMU.Frequency: {_number(_rate(result, rate_hz, "orb_slam3"))}']
    return FilterConfig('orb_slam3_imu.yaml', _joined(lines))


def vins_fusion(result: Result, rate_hz: float | None = None) -> FilterConfig:
    """
    VINS-Fusion (and VINS-Mono): standard deviations per sample, N sqrt(f) and K sqrt(f).

    ``IntegrationBase::midPointIntegration`` (integration_base.h) adds ``(dt value)^2`` at each
    step.
    """
    f = _rate(result, rate_hz, 'vins_fusion')
    root = sqrt(f)
    lines = ['%YAML:1.0', *_heading(result, 'VINS-Fusion'),
             '# Part of a settings file: put these lines in place of its imu parameters.',
             f'# Per sample at f = {f:g} Hz: N sqrt(f) and K sqrt(f). The midpoint step counts '
             'each sample twice by',
             '# half, as if the halves were independent; strictly that wants acc_n and gyr_n '
             'sqrt(2) times as large.']
    lines += _pairs(result, {('accel', N): 'acc_n', ('accel', K): 'acc_w',
                             ('gyro', N): 'gyr_n', ('gyro', K): 'gyr_w'},
                    lambda value: value * root, 'sqrt(f)', _SAMPLE_UNITS)
    topic = result.source.topic
    if topic:
        lines += ['', f'imu_topic: {_quoted(topic)}']
    return FilterConfig('vins_fusion_imu.yaml', _joined(lines))


def lio_sam(result: Result, rate_hz: float | None = None) -> FilterConfig:
    """
    LIO-SAM's ``params.yaml`` (ROS 2): N and K, continuous.

    imuPreintegration.cpp squares the noises into GTSAM's continuous covariances and scales the
    biases by ``sqrt(deltaTij)``.
    """
    del rate_hz
    lines = [*_heading(result, 'LIO-SAM'), '/**:', '  ros__parameters:']
    body = _pairs(result, {('accel', N): 'imuAccNoise', ('gyro', N): 'imuGyrNoise',
                           ('accel', K): 'imuAccBiasN', ('gyro', K): 'imuGyrBiasN'})
    if result.source.topic:
        body += ['', f'imuTopic: {_quoted(result.source.topic)}']
    lines += [f'    {line}' if line else '' for line in body]
    return FilterConfig('lio_sam_imu.yaml', _joined(lines))


def fast_lio(result: Result, rate_hz: float | None = None) -> FilterConfig:
    """
    FAST-LIO's ``mapping`` section: variances per sample, N^2 f and K^2 f.

    ``esekf::predict`` (esekfom.hpp) adds ``dt^2 Q`` at each step.
    """
    f = _rate(result, rate_hz, 'fast_lio')
    lines = [*_heading(result, 'FAST-LIO'),
             f'# Variances per sample at f = {f:g} Hz: N^2 f and K^2 f.',
             '# The ports to ROS 2 want mapping: under /**: ros__parameters:', 'mapping:']
    units = {key: f'({unit})^2' for key, unit in _SAMPLE_UNITS.items()}
    body = _pairs(result, {('accel', N): 'acc_cov', ('gyro', N): 'gyr_cov',
                           ('accel', K): 'b_acc_cov', ('gyro', K): 'b_gyr_cov'},
                  lambda value: value**2 * f, '^2 f', units)
    lines += [f'  {line}' if line else '' for line in body]
    if result.source.topic:
        lines += ['', 'common:', f'  imu_topic: {_quoted(result.source.topic)}']
    return FilterConfig('fast_lio_imu.yaml', _joined(lines))


def gtsam(result: Result, rate_hz: float | None = None) -> FilterConfig:
    """
    Write GTSAM's preintegration covariances: N^2 I and K^2 I, continuous.

    PreintegrationParams.h and PreintegrationCombinedParams.h name them so. GTSAM reads no file of
    its own; the keys are the names of the fields, each a 3 x 3 matrix.
    """
    del rate_hz
    lines = [*_heading(result, 'GTSAM'),
             '# Continuous covariances N^2 I and K^2 I. For each key, with p of type '
             'PreintegrationCombinedParams:',
             '#   p->accelerometerCovariance = matrix;   (C++)   '
             'p.setAccelerometerCovariance(matrix)   (Python)']
    units = {key: f'({unit})^2' for key, unit in _UNITS.items()}
    names = {('accel', N): 'accelerometerCovariance', ('gyro', N): 'gyroscopeCovariance',
             ('accel', K): 'biasAccCovariance', ('gyro', K): 'biasOmegaCovariance'}

    def matrix(value: float) -> list[str]:
        return [f'  - [{", ".join(_number(value if i == j else 0.0) for j in range(3))}]'
                for i in range(3)]

    for (sensor, key), name in names.items():
        entry = _worst(result, sensor, key, lambda value: value**2, '^2', units[sensor, key])
        lines += ['', *(f'# {remark}' for remark in entry.remarks)]
        lines += [f'# {name}:'] if entry.value is None else [f'{name}:', *matrix(entry.value)]
    return FilterConfig('gtsam_imu.yaml', _joined(lines))


def basalt(result: Result, rate_hz: float | None = None) -> FilterConfig:
    """
    Basalt's ``calibration.json``: N and K for each axis, continuous.

    ``Calibration::dicrete_time_accel_noise_std`` (calibration.hpp) multiplies by the root of
    ``imu_update_rate``. JSON knows no comments: they stand under a key that cereal passes over.
    """
    values: dict[str, object] = {'imu_update_rate': _rate(result, rate_hz, 'basalt')}
    remarks = _provenance(result, 'Basalt')
    names = {('accel', N): 'accel_noise_std', ('gyro', N): 'gyro_noise_std',
             ('accel', K): 'accel_bias_std', ('gyro', K): 'gyro_bias_std'}
    for (sensor, key), name in names.items():
        entries = [_of_axis(axis, key) for axis in _axes(result, sensor).values()]
        numbers = [value for value, _ in entries if value]
        if len(numbers) < 3:
            remarks.append(f'{name}: the result does not have all three axes')
            continue
        values[name] = numbers
        remarks.append(f'{name}: {_LETTERS[key]} of x, y, z [{_UNITS[sensor, key]}], continuous')
        bounds = [letter for letter, (_, bound) in zip('xyz', entries, strict=True) if bound]
        if bounds:
            remarks.append(f'{name}: not observable on {", ".join(bounds)}, '
                           'there the 95 % upper bound')
    text = json.dumps({'value0': values, 'imu_allan': remarks}, indent=4, ensure_ascii=False)
    return FilterConfig('basalt_imu.json', text + '\n')


def msckf_vio(result: Result, rate_hz: float | None = None) -> FilterConfig:
    """
    MSCKF-VIO's ``noise`` parameters: N and K, continuous.

    msckf_vio.cpp squares them on loading (loadParameters) and multiplies by ``dt`` in
    ``processModel``.
    """
    del rate_hz
    lines = [*_heading(result, 'MSCKF-VIO'),
             '# In the launch file: <rosparam command="load" file="msckf_vio_noise.yaml"/> inside '
             'the node, and no',
             '# <param name="noise/..."> of the same names after it.', 'noise:']
    body = _pairs(result, {('gyro', N): 'gyro', ('accel', N): 'acc',
                           ('gyro', K): 'gyro_bias', ('accel', K): 'acc_bias'})
    lines += [f'  {line}' if line else '' for line in body]
    return FilterConfig('msckf_vio_noise.yaml', _joined(lines))


def robot_localization(result: Result, rate_hz: float | None = None) -> FilterConfig:
    """
    Covariances of the Imu message, which robot_localization takes from the driver: N^2 f.

    REP-145 names the driver's parameters ``linear_acceleration_stddev`` and
    ``angular_velocity_stddev`` (N sqrt(f)); the 3 x 3 arrays are the message's own fields.
    """
    f = _rate(result, rate_hz, 'robot_localization')
    lines = [*_heading(result, 'robot_localization'),
             '# robot_localization takes the covariances from the Imu messages: these are '
             'parameters for the driver.',
             f'# Per sample at f = {f:g} Hz: N sqrt(f) and N^2 f. A filter that runs slower and '
             'averages has less.', '/**:', '  ros__parameters:']
    names = {'accel': 'linear_acceleration', 'gyro': 'angular_velocity'}
    root = sqrt(f)
    body = _pairs(result, {(sensor, N): f'{names[sensor]}_stddev' for sensor in _SENSORS},
                  lambda value: value * root, 'sqrt(f)', _SAMPLE_UNITS)
    for sensor, name in names.items():
        values = [_of_axis(axis, N)[0] for axis in _axes(result, sensor).values()]
        body += ['', f'# N^2 f of x, y, z on the diagonal [({_SAMPLE_UNITS[sensor, N]})^2]']
        if len(values) < 3 or not all(values):
            body += [f'# {name}_covariance: the result does not have all three axes']
            continue
        diagonal = [(value or 0.0)**2 * f for value in values]
        cells = [_number(diagonal[i] if i == j else 0.0) for i in range(3) for j in range(3)]
        body += [f'{name}_covariance: [{", ".join(cells)}]']
    lines += [f'    {line}' if line else '' for line in body]
    return FilterConfig('imu_covariance.yaml', _joined(lines))


def px4(result: Result, rate_hz: float | None = None) -> FilterConfig:
    """
    PX4's EKF2 parameters as QGroundControl loads them: N sqrt(F), K sqrt(F), F = 100 Hz.

    ``predictCovariance`` (covariance.cpp) squares ``dt value``; ranges are those of the
    parameters' metadata.
    """
    names = {('accel', N): ('EKF2_ACC_NOISE', 0.01, 1.0, 0.35),
             ('accel', K): ('EKF2_ACC_B_NOISE', 0.0, 0.01, 0.003),
             ('gyro', N): ('EKF2_GYR_NOISE', 0.0001, 0.1, 0.015),
             ('gyro', K): ('EKF2_GYR_B_NOISE', 0.0, 0.01, 0.001)}
    lines = [*_heading(result, 'PX4'), '# Vehicle-Id Component-Id Name Value Type']
    lines += _autopilot(result, 'PX4', rate_hz or 100.0, names,
                        lambda name, value: f'1\t1\t{name}\t{value}\t9')
    return FilterConfig('px4_imu.params', _joined(lines))


def ardupilot(result: Result, rate_hz: float | None = None) -> FilterConfig:
    """
    Write ArduPilot's EKF3 parameters: N sqrt(F), K sqrt(F), F = 83 Hz.

    ``CovariancePrediction`` of AP_NavEKF3_core.cpp squares ``dt value``; ranges are those of the
    parameters' metadata (AP_NavEKF3.cpp).
    """
    names = {('accel', N): ('EK3_ACC_P_NSE', 0.01, 1.0, 0.35),
             ('accel', K): ('EK3_ABIAS_P_NSE', 0.00001, 0.02, 0.02),
             ('gyro', N): ('EK3_GYRO_P_NSE', 0.0001, 0.1, 0.015),
             ('gyro', K): ('EK3_GBIAS_P_NSE', 0.00001, 0.001, 0.001)}
    lines = _heading(result, 'ArduPilot')
    lines += _autopilot(result, 'ArduPilot', rate_hz or 83.0, names,
                        lambda name, value: f'{name},{value}')
    return FilterConfig('ardupilot_imu.params', _joined(lines))


CONSUMERS: dict[str, Callable[[Result, float | None], FilterConfig]] = {
    function.__name__: function for function in (
        kalibr, openvins, orb_slam3, vins_fusion, lio_sam, fast_lio, gtsam, basalt, msckf_vio,
        robot_localization, px4, ardupilot)
}


def _autopilot(result: Result, name: str, rate: float,
               names: dict[tuple[str, str], tuple[str, float, float, float]],
               line: Callable[[str, str], str]) -> Iterator[str]:
    yield f'# Per prediction step at F = {rate:g} Hz: N sqrt(F) and K sqrt(F).'
    yield '# These are LOWER BOUNDS, measured at rest: in flight vibration dominates. '
    yield f"# Start from {name}'s defaults and go towards these values only as far as the logs' "
    yield '# innovation test ratios allow.'
    root = sqrt(rate)
    for (sensor, key), (parameter, low, high, usual) in names.items():
        entry = _worst(result, sensor, key, lambda value: value * root, 'sqrt(F)',
                       _SAMPLE_UNITS[sensor, key])
        yield ''
        yield from (f'# {remark}' for remark in entry.remarks)
        if entry.value is None:
            yield f'# {parameter}'
            continue
        value = min(max(entry.value, low), high)
        yield f"# {name}'s default {usual:g}, range {low:g} .. {high:g}"
        if value != entry.value:
            yield f'# {_number(entry.value)} is outside the range: its end is written instead'
        yield line(parameter, _number(value))


def _heading(result: Result, consumer: str) -> list[str]:
    return [f'# {line}' for line in _provenance(result, consumer)]


def _provenance(result: Result, consumer: str) -> list[str]:
    source, timeline = result.source, result.timeline
    rate = '' if timeline.sample_rate_hz is None else f' at {timeline.sample_rate_hz:g} Hz'
    parts = [printable(source.path) if source.path else '',
             f'topic {printable(source.topic)}' if source.topic else '',
             f'frame {printable(source.frame_id)}' if source.frame_id else '',
             f'of {printable(source.start_time)}' if source.start_time else '',
             f'{timeline.samples} samples{rate} over {timeline.duration_s:.6g} s']
    return [f'IMU noise for {consumer}, by imu_allan {printable(result.imu_allan_version)} from',
            ', '.join(part for part in parts if part)]


def _pairs(result: Result, names: dict[tuple[str, str], str], scale: Scale = lambda value: value,
           scaling: str = '', units: dict[tuple[str, str], str] | None = None) -> list[str]:
    """YAML lines ``name: worst axis``, each below its remarks."""
    lines = []
    for (sensor, key), name in names.items():
        entry = _worst(result, sensor, key, scale, scaling, (units or _UNITS)[sensor, key])
        lines += ['', *(f'# {remark}' for remark in entry.remarks)]
        lines += [f'# {name}:' if entry.value is None else f'{name}: {_number(entry.value)}']
    return lines


def _worst(result: Result, sensor: str, key: str, scale: Scale, scaling: str,
           unit: str) -> _Entry:
    """Largest of the axes' values or upper bounds, scaled, and what to say about it."""
    letter = _LETTERS[key] + ('' if not scaling else scaling if scaling[0] == '^'
                              else f' {scaling}')
    what = f'{letter} [{unit}], {_TERMS[sensor, key]}'
    known: dict[str, tuple[float, bool]] = {}
    for name, axis in _axes(result, sensor).items():
        value, bound = _of_axis(axis, key)
        if value:
            known[name] = (value, bound)
    if not known:
        return _Entry(None, (f'{what}: this result has no value for it',))
    worst = max(known, key=lambda name: known[name][0])
    value, bound = known[worst]
    remarks = [what]
    if bound:
        remarks.append(f'NOT OBSERVABLE on {worst} in this recording: its 95 % upper bound, '
                       'the true value is smaller')
    else:
        low, high = result.axes[worst].coefficients[key].ci95 or (value, value)
        remarks.append(f'{worst}, the worst axis; 95 % interval {scale(max(low, 0.0)):.4g} .. '
                       f'{scale(high):.4g}')
    others = [f'{name} {"below " if is_bound else ""}{scale(other):.6g}'
              for name, (other, is_bound) in known.items() if name != worst]
    if others:
        remarks.append('other axes: ' + ', '.join(others))
    return _Entry(scale(value), tuple(remarks))


def _of_axis(axis: AxisResult, key: str) -> tuple[float | None, bool]:
    """Value or upper bound of a coefficient, and whether it is the bound."""
    coefficient = axis.coefficients[key]
    if coefficient.observable and coefficient.value is not None:
        return coefficient.value, False
    return coefficient.upper95, True


def _axes(result: Result, sensor: str) -> dict[str, AxisResult]:
    names = [f'{sensor}_{letter}' for letter in 'xyz']
    return {name: result.axes[name] for name in names if name in result.axes}


def _topic_and_rate(result: Result, rate_hz: float | None, topic: str, rate: str,
                    consumer: str) -> list[str]:
    lines = [f'{rate}: {_number(_rate(result, rate_hz, consumer))}']
    return [f'{topic}: {_quoted(result.source.topic or "/imu/data_raw")}', *lines]


def _rate(result: Result, rate_hz: float | None, consumer: str) -> float:
    rate = rate_hz or result.timeline.sample_rate_hz
    if rate is None:
        raise ImuAllanError(f'the configuration for {consumer} needs the sample rate, which this '
                            'result does not have; give it with --rate HZ')
    return rate


def _number(value: float) -> str:
    """`value` so that it reads back exactly in YAML 1.1, too, where a real must have a point."""
    text = repr(float(value))
    return text.replace('e', '.0e') if 'e' in text and '.' not in text else text


def _quoted(text: str) -> str:
    return json.dumps(printable(text), ensure_ascii=False)


def _joined(lines: list[str]) -> str:
    return '\n'.join(line.rstrip(' ') for line in lines) + '\n'
