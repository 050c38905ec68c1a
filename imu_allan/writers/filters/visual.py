# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Filters and smoothers that a camera corrects, in one module as each takes a few lines."""

import json
from math import sqrt

from imu_allan.writers.filters.chosen_numbers import K, N, Numbers
from imu_allan.writers.filters.layout import (
    document,
    each,
    heading,
    indented,
    joined,
    Pair,
    pairs,
    quoted,
    real,
    SAMPLE_UNITS,
    times,
    topic_of,
    UNITS,
    with_topic,
)

_OPENCV = ('%YAML:1.0',)
"""First line of what OpenCV's FileStorage reads."""
_KALIBR: dict[Pair, str] = {
    ('accel', N): 'accelerometer_noise_density', ('accel', K): 'accelerometer_random_walk',
    ('gyro', N): 'gyroscope_noise_density', ('gyro', K): 'gyroscope_random_walk'}


def kalibr(numbers: Numbers) -> str:
    """
    Kalibr's ``imu.yaml``: N and K, continuous.

    ``ImuParameters`` of Kalibr's ConfigReader.py divides the noise density by ``sqrt(dt)`` itself,
    takes the random walk as it is, and refuses values that are not above zero.
    """
    return document(numbers, _KALIBR, ends=['', *_topic_and_rate(numbers)])


def openvins(numbers: Numbers) -> str:
    """
    Write OpenVINS' ``kalibr_imu_chain.yaml``: N and K, continuous, as for Kalibr.

    ``VioManagerOptions::print_and_load_noise`` (VioManagerOptions.h) squares them and
    ``Propagator::predict_and_compute`` (Propagator.cpp) adds ``dt^2`` times the squares over dt:
    N^2 dt and K^2 dt. The file is read by OpenCV's FileStorage; the geometry in it is the identity
    that OpenVINS ships.
    """
    lines = [*_OPENCV, *heading(numbers), '', 'imu0:']
    identity = ('[1.0, 0.0, 0.0]', '[0.0, 1.0, 0.0]', '[0.0, 0.0, 1.0]')
    body = ['# Geometry: no more than the identity, put in what your calibration found.', 'T_i_b:',
            *(f'  - [{", ".join("1.0" if i == j else "0.0" for j in range(4))}]'
              for i in range(4))]
    body += pairs(numbers, _KALIBR)
    body += ['', *_topic_and_rate(numbers), 'time_offset: 0.0', 'model: "kalibr"']
    for key in ('Tw', 'R_IMUtoGYRO', 'Ta', 'R_IMUtoACC'):
        body += [f'{key}:', *(f'  - {row}' for row in identity)]
    body += ['Tg:', *['  - [0.0, 0.0, 0.0]'] * 3]
    return joined([*lines, *indented(body, 2)])


def orb_slam3(numbers: Numbers) -> str:
    """
    ORB-SLAM3's ``IMU.*`` settings: N and K, continuous.

    ``Settings::readIMU`` (Settings.cc) reads them as reals through OpenCV's FileStorage;
    ``Tracking::newParameterLoader`` (Tracking.cc) multiplies the noises by ``sqrt(f)`` and divides
    the walks by it. ``Preintegrated::IntegrateNewMeasurement`` (ImuTypes.cc) adds dt^2 times the
    square of the first and once that of the second at each sample: N^2 dt and K^2 dt.
    """
    return document(
        numbers, {('gyro', N): 'IMU.NoiseGyro', ('accel', N): 'IMU.NoiseAcc',
                  ('gyro', K): 'IMU.GyroWalk', ('accel', K): 'IMU.AccWalk'}, begin=_OPENCV,
        notes=['Part of a settings file: put these lines in place of its IMU noise section.'],
        ends=['', '# [Hz], a real number in settings of File.version 1.0; older versions want a '
              'whole number', f'IMU.Frequency: {real(numbers.rate())}'])


def vins_fusion(numbers: Numbers) -> str:
    """
    VINS-Fusion (and VINS-Mono): standard deviations per sample, N sqrt(f) and K sqrt(f).

    ``IntegrationBase::midPointIntegration`` (integration_base.h) adds ``(dt value)^2`` at each
    step.
    """
    lines = [*_OPENCV, *heading(numbers), *_vins_lines(numbers),
             '# The midpoint step counts each sample twice by half, as if the halves were '
             'independent: it uses',
             '# half the variance written here, so that its NIS may be twice that expected above. '
             '--for vins_fusion_midpoint',
             '# writes what it strictly wants, sqrt(2) N sqrt(f).']
    lines += _vins_pairs(numbers, 1.0)
    return joined(lines)


def vins_fusion_midpoint(numbers: Numbers) -> str:
    """
    VINS-Fusion with what its midpoint step strictly wants: sqrt(2) N sqrt(f) and K sqrt(f).

    ``midPointIntegration`` weighs the noises of the two ends of a step by 0.5 each and adds their
    squares as if they were independent, which halves the variance of a step.
    """
    lines = [*_OPENCV, *heading(numbers), *_vins_lines(numbers),
             '# acc_n and gyr_n times sqrt(2), which the midpoint step halves in variance again.']
    lines += _vins_pairs(numbers, sqrt(2))
    return joined(lines)


def _vins_lines(numbers: Numbers) -> list[str]:
    return ['# Part of a settings file: put these lines in place of its imu parameters.',
            f'# Per sample at f = {numbers.rate():g} Hz: N sqrt(f) and K sqrt(f).']


def _vins_pairs(numbers: Numbers, midpoint: float) -> list[str]:
    root = sqrt(numbers.rate())
    lines = []
    for key, factor, scaling in ((N, root * midpoint,
                                  'sqrt(f)' if midpoint == 1 else 'sqrt(2 f)'),
                                 (K, root, 'sqrt(f)')):
        names: dict[Pair, str] = {('accel', key): f'acc_{"n" if key == N else "w"}',
                                  ('gyro', key): f'gyr_{"n" if key == N else "w"}'}
        lines += pairs(numbers, names, times(factor), scaling, SAMPLE_UNITS)
    return lines + with_topic(numbers, 'imu_topic')


def basalt(numbers: Numbers) -> str:
    """
    Basalt's ``calibration.json``: N and K for each axis, continuous.

    ``Calibration::dicrete_time_accel_noise_std`` (calibration.hpp) multiplies by the root of
    ``imu_update_rate``, and ``IntegratedImuMeasurement::integrate`` (preintegration.h) adds dt^2
    times the square at each sample: N^2 dt. ``ImuBlock::linearizeImu`` (imu_block.hpp) weighs the
    difference of two biases by ``1/(K sqrt(dt))``, dt the time between the frames. JSON knows no
    comments: they stand under a key that cereal passes over.
    """
    values: dict[str, object] = {'imu_update_rate': float(real(numbers.rate()))}
    remarks = numbers.provenance()
    names: dict[Pair, str] = {('accel', N): 'accel_noise_std', ('gyro', N): 'gyro_noise_std',
                              ('accel', K): 'accel_bias_std', ('gyro', K): 'gyro_bias_std'}
    for (sensor, key), name in names.items():
        found, said = each(numbers, sensor, key)
        remarks += [f'{name}: {remark}' for remark in said]
        if found is not None:
            values[name] = [float(real(value)) for value in found]
            remarks.append(f'{name}: {key} of x, y, z [{UNITS[sensor, key]}], continuous')
    text = json.dumps({'value0': values, 'imu_allan': remarks}, indent=4, ensure_ascii=False)
    return text + '\n'


def msckf_vio(numbers: Numbers) -> str:
    """
    MSCKF-VIO's ``noise`` parameters: N and K, continuous.

    ``MsckfVio::loadParameters`` (msckf_vio.cpp) squares them and ``MsckfVio::processModel``
    multiplies by dt: N^2 dt and K^2 dt.
    """
    return document(
        numbers, {('gyro', N): 'gyro', ('accel', N): 'acc', ('gyro', K): 'gyro_bias',
                  ('accel', K): 'acc_bias'}, opens=['noise:'], indent=2,
        notes=['In the launch file: <rosparam command="load" file="msckf_vio_noise.yaml"/> inside '
               'the node, and no', '<param name="noise/..."> of the same names after it.'])


def isaac_ros_vslam(numbers: Numbers) -> str:
    """
    Isaac ROS Visual SLAM's node parameters: N and K, continuous.

    ``VisualSlamNode`` (visual_slam_node.cpp) declares them as reals, and
    ``VisualSlamImpl::CreateConfiguration`` (visual_slam_impl.cpp) hands them as they are to
    ``CUVSLAM_ImuCalibration``. The units are those that cuVSLAM's header gives there:
    rad/s/sqrt(Hz), rad/s^2/sqrt(Hz), m/s^2/sqrt(Hz), m/s^3/sqrt(Hz) and Hz. Of these
    ``ImuCalibration`` of cuVSLAM (libs/common/imu_calibration.cpp) makes variances per sample by
    the frequency given, N^2 f and K^2/f, and ``IMUPreintegration::update_state``
    (libs/imu/imu_preintegration.cpp) adds dt^2 times the first and once the second at each sample:
    N^2 dt and K^2 dt where the frequency is that of the samples.
    """
    return document(
        numbers, {('gyro', N): 'gyro_noise_density', ('gyro', K): 'gyro_random_walk',
                  ('accel', N): 'accel_noise_density', ('accel', K): 'accel_random_walk'},
        notes=['cuVSLAM makes values per sample of them itself, by calibration_frequency, which '
               'has to be the rate of the', 'IMU. The node takes the IMU with enable_imu_fusion: '
               'true, in newer releases with tracking_mode: 1.'],
        opens=['/**:', '  ros__parameters:'], indent=4,
        ends=['', '# [Hz], the rate of the recording',
              f'calibration_frequency: {real(numbers.rate())}'])


def okvis2(numbers: Numbers) -> str:
    """
    OKVIS2's ``imu_parameters``: N and K, continuous, through OpenCV's FileStorage.

    ``ImuError::redoPreintegration`` (ImuError.cpp) adds dt times their squares at each sample.
    ``sigma_bg`` and ``sigma_ba`` of config/euroc.yaml are priors of the bias at the start, no bias
    instability: they are left to the user. ``tau`` is read no more.
    """
    return document(
        numbers, {('gyro', N): 'sigma_g_c', ('accel', N): 'sigma_a_c', ('gyro', K): 'sigma_gw_c',
                  ('accel', K): 'sigma_aw_c'}, begin=_OPENCV, opens=['imu_parameters:'], indent=4,
        notes=['Part of a settings file: put these lines in place of those in its section. '
               'sigma_bg and sigma_ba are',
               'priors of the bias at the start (turn-on bias), not bias instability: leave '
               'them.'])


def kimera(numbers: Numbers) -> str:
    """
    Kimera-VIO's ``ImuParams.yaml``: N and K, continuous.

    ``ImuParams::parseYAML`` (ImuFrontendParams.cpp) reads them with ``rate_hz``; the
    preintegration multiplies the walks by the root of the time between keyframes.
    """
    return document(
        numbers, dict(sorted(_KALIBR.items(), key=lambda pair: (pair[0][1] == K,
                                                                pair[0][0] != 'gyro'))),
        begin=_OPENCV, ends=['', f'rate_hz: {real(numbers.rate())}'],
        notes=['Part of ImuParams.yaml: put these lines in place of those of the same names.'])


def maplab(numbers: Numbers) -> str:
    """
    Write maplab's IMU ``sigmas``: N and K, continuous.

    The names are those of its calibrations (imu-bmi160.yaml). ``ImuIntegratorRK4`` of
    imu-integrator-rk4 (imu-integrator.cc, imu-integrator-inl.h) squares them and takes that as the
    rate at which the covariance grows.
    """
    return document(numbers, {('gyro', N): 'gyro_noise_density',
                              ('gyro', K): 'gyro_bias_random_walk_noise_density',
                              ('accel', N): 'acc_noise_density',
                              ('accel', K): 'acc_bias_random_walk_noise_density'},
                    opens=['sensor_type: IMU', 'sigmas:'], indent=2)


def rovio(numbers: Numbers) -> str:
    """
    Write ROVIO's ``PredictionNoise``: N^2 and K^2 for each axis, continuous.

    rovio.info names the units: velocity m^2/s^3, attitude rad^2/s, biases m^2/s^5 and rad^2/s^3,
    which are squared densities. They are the diagonal of ``prenoiP_`` (Prediction.hpp of
    lightweight_filtering), the covariance of a noise that ``ImuPrediction::evalPrediction``
    (ImuPrediction.hpp) divides by ``sqrt(dt)`` for rates and multiplies by it for biases.
    """
    lines = [*heading(numbers, ';'),
             '; Part of rovio.info: put these lines in place of those of the same names.',
             'Prediction', '{', '    PredictionNoise', '    {']
    names: dict[Pair, str] = {('accel', N): 'vel', ('gyro', N): 'att', ('accel', K): 'acb',
                              ('gyro', K): 'gyb'}
    for (sensor, key), name in names.items():
        found, remarks = each(numbers, sensor, key, lambda value: value**2)
        lines += [f'        ; {name}: {key}^2 of x, y, z [({UNITS[sensor, key]})^2]',
                  *(f'        ; {name}: {remark}' for remark in remarks)]
        lines += [f'        {name}_{i} {real(value)};' for i, value in enumerate(found or [])]
    return joined([*lines, '    }', '}'])


def svo_pro(numbers: Numbers) -> str:
    """
    SVO Pro's ``imu_params``: N and K, continuous.

    The names are those of its calibrations (euroc_stereo.yaml). ``CeresBackendInterface``
    (ceres_backend_interface.cpp) hands them on as they are, and ``ImuError::redoPreintegration``
    (imu_error.cpp) adds dt times their squares. ``acc_bias_sigma`` and ``omega_bias_sigma`` are
    priors of the bias at the start.
    """
    return document(
        numbers, {('gyro', N): 'sigma_omega_c', ('accel', N): 'sigma_acc_c',
                  ('gyro', K): 'sigma_omega_bias_c', ('accel', K): 'sigma_acc_bias_c'},
        notes=['Part of a calibration: put these lines in place of those in its section. '
               'acc_bias_sigma and', 'omega_bias_sigma of imu_initialization are priors of the '
               'turn-on bias: leave them.'],
        opens=['imu_params:'], indent=2, ends=['', f'imu_rate: {real(numbers.rate())}'])


def rtabmap(numbers: Numbers) -> str:
    """
    RTAB-Map's odometry backends: N and K, each under the backend's own names.

    Its list of parameters names the units of OpenVINS; ORB-SLAM3's, MSCKF-VIO's and LIO-SAM's
    (OdometryORBSLAM3.cpp, OdometryLIOSAM.cpp) are handed over as they are. The first wants the
    rate, too, which is that of its first two samples where it is 0, the default. RTAB-Map's values
    are strings.
    """
    lines = [*heading(numbers), '# Only the lines of the backend that Odom/Strategy chooses '
             'are read; those of OdomLIOSAM where', '# OdomLIOSAM/ConfigPath names no file.',
             '/**:', '  ros__parameters:']
    backends: dict[str, dict[Pair, str]] = {
        'OdomOpenVINS': {('accel', N): 'AccelerometerNoiseDensity',
                         ('accel', K): 'AccelerometerRandomWalk',
                         ('gyro', N): 'GyroscopeNoiseDensity',
                         ('gyro', K): 'GyroscopeRandomWalk'},
        'OdomORBSLAM': {('accel', N): 'AccNoise', ('accel', K): 'AccWalk',
                        ('gyro', N): 'GyroNoise', ('gyro', K): 'GyroWalk'},
        'OdomMSCKF': {('accel', N): 'NoiseAcc', ('accel', K): 'NoiseAccBias',
                      ('gyro', N): 'NoiseGyro', ('gyro', K): 'NoiseGyroBias'},
        'OdomLIOSAM': {('accel', N): 'ImuAccNoise', ('accel', K): 'ImuAccBiasN',
                       ('gyro', N): 'ImuGyrNoise', ('gyro', K): 'ImuGyrBiasN'}}
    body: list[str] = []
    for backend, names in backends.items():
        own = {pair: f'{backend}/{name}' for pair, name in names.items()}
        body += pairs(numbers, own, line="{name}: '{value}'")
    body += ['', '# [Hz], by which ORB-SLAM3 makes values per sample of them',
             f"OdomORBSLAM/SamplingRate: '{real(numbers.rate())}'"]
    return joined([*lines, *indented(body, 4)])


def _topic_and_rate(numbers: Numbers) -> list[str]:
    return [f'rostopic: {topic_of(numbers) or quoted("/imu/data_raw")}',
            f'update_rate: {real(numbers.rate())}']
