# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Every exporter against values worked by hand, read by the consumer's own format library."""

from dataclasses import replace
import json
import re
import shutil
import subprocess
import tempfile
import xml.etree.ElementTree as ElementTree

from exact_results import (
    axis_result,
    build_result,
    only,
    UNSEEN,
    with_axes,
    with_coefficient,
)
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import DriftModel, GaussMarkov, PowerLaw, Source, Timeline
from imu_allan.sensor.noise_model import load_model, parse_model
from imu_allan.tuning.state_space import state_space
from imu_allan.writers.atomic import CONFIGURATION, kind_of
from imu_allan.writers.filters import export as export_as_wished, ExportOptions
from imu_allan.writers.filters.chosen_numbers import result_of_datasheet
from imu_allan.writers.supported_filters import consumer_called, CONSUMERS, FAMILIES
import numpy as np
from on_terminal import assert_as_before, FLAT
import pytest
from whole_lines import refused
import yaml

GYRO_N, GYRO_K, ACCEL_N, ACCEL_K = 2e-3, 3e-5, 4e-2, 5e-4
RATE = 400.0
"""The hand can follow: y has half of that, z a tenth and for K a bound; the root of f is 20."""
DEGREE = 0.017453292519943295
OCTAVE = shutil.which('octave-cli')
OPENCV = ('openvins', 'orb_slam3', 'vins_fusion', 'vins_fusion_midpoint', 'okvis2', 'kimera')
NASTY = 'evil"\n- key: {x: 1}\n*/ {"x": 1} /* %YAML:1.0 # \x1b[2J \u2028 $(rm) </script>'


def near(value):
    return pytest.approx(value, rel=1e-5, abs=0)


def export(result, consumer, rate_hz=None):
    """Write the coefficients as they are, so that the hand can follow."""
    return export_as_wished(result, consumer, ExportOptions(rate_hz, as_measured=True))


def build(bound=1e-6, **fields):
    """Return six axes whose sigma is 10 K at 200 s: the driving density 10 K sqrt(2/200) is K."""
    axes = {}
    for sensor, n, k in (('gyro', GYRO_N, GYRO_K), ('accel', ACCEL_N, ACCEL_K)):
        for letter, share in (('x', 1), ('y', 1 / 2), ('z', 1 / 10)):
            name, values = f'{sensor}_{letter}', {'noise_density': n * share}
            if letter != 'z':
                values['rate_random_walk'] = k * share
            axis = axis_result(name, values, {'rate_random_walk': bound},
                               gauss_markov=GaussMarkov(10 * k * share, 200.0),
                               drift_model=DriftModel(n * share, k * share, (), 0.01, 3600.0))
            # A curve that is hardly known forbids no bound.
            axes[name] = replace(axis, curve=replace(axis.curve, ci95=tuple(
                (low, 1e6 * high) for low, high in axis.curve.ci95)))
    return build_result(**{'axes': axes, 'timeline': Timeline(RATE, 1_000_000, 2500.0), **fields})


EASY = build()
DRIFTING = with_axes(EASY, drift_model=lambda axis: replace(
    axis.drift_model, processes=(GaussMarkov(axis.drift_model.noise_density / 10, 30.0),)))
"""The same on a sensor that drifts with a process of 30 s, too."""
DEAD = {'curve': FLAT, 'drift_model': None,
        'coefficients': axis_result('gyro_x', {}, dict.fromkeys(TERMS, 0.0)).coefficients}


def opencv(text):
    cv2 = pytest.importorskip('cv2', reason='opencv-python-headless is not installed')

    def value(node):
        if node.isMap():
            return {key: value(node.getNode(key)) for key in map(str, node.keys())}
        if node.isSeq():
            return [value(node.at(place)) for place in range(node.size())]
        return node.string() if node.isString() else node.real()

    # The nodes are views into the storage, which must live as long.
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    assert storage.isOpened()
    return value(storage.root())


def xml(text):
    def value(element):
        inside = element.attrib | {child.tag: value(child) for child in element}
        return inside or float(element.text)
    return value(ElementTree.fromstring(text))


def octave(text):
    found = re.findall(r"^([\w.]+) = \[([^\]]*)\]'?;", text, re.MULTILINE)
    return {name: [float(value) for value in values.split(',')] for name, values in found}


def qgroundcontrol(text):
    """Read parameters as QGroundControl's ParameterManager::readParametersFromStream does."""
    parameters = {}
    for line in text.splitlines():
        if line.startswith('#') or not line:
            continue
        vehicle, component, name, value, kind = line.split('\t')
        assert (int(vehicle), int(component)) == (1, 1)
        parameters[name] = (float(value), int(kind))
    return parameters


def mavlink(text):
    mavparm = pytest.importorskip('pymavlink.mavparm', reason='pymavlink is not installed')
    parameters = mavparm.MAVParmDict()
    with tempfile.NamedTemporaryFile('w', suffix='.params') as file:
        file.write(text)
        file.flush()
        parameters.load(file.name)
    return dict(parameters)


def python(text):
    found = {}
    exec(text, found)
    return found['imu_config']


READERS = {
    **dict.fromkeys(OPENCV, opencv), **dict.fromkeys(('basalt', 'airsim', 'state_space'),
                                                     json.loads),
    **dict.fromkeys(('navego', 'psins', 'matlab'), octave), 'gazebo': xml, 'rotors': xml,
    'px4': qgroundcontrol, 'ardupilot': mavlink, 'pegasus': python,
    'glim': lambda text: json.loads(re.sub('//[^\n]*', '', text)),
    'rovio': lambda text: {key: float(value) for key, value in re.findall(
        r'^ +(\w{3}_\d) (\S+);', text, re.MULTILINE)},
    'state_space_cpp': lambda text: dict.fromkeys(re.findall(r'^namespace (\w+)', text,
                                                             re.MULTILINE))}
"""As each consumer reads its file, where that is not YAML."""


def read(consumer, text):
    return READERS.get(consumer, yaml.safe_load)(text)


def triple(value):
    """Give what x, y and z have of something whose bound on z says nothing."""
    return [near(value), near(value / 2), near(value / 10)]


PARAMETERS = ('/**', 'ros__parameters')
ACCEL_COVARIANCE = [near(0.64), 0, 0, 0, near(0.16), 0, 0, 0, near(6.4e-3)]
GYRO_COVARIANCE = [near(1.6e-3), 0, 0, 0, near(4e-4), 0, 0, 0, near(1.6e-5)]


def densities(*keys):
    """Call N and K of the accelerometer, then of the gyroscope, as a consumer does."""
    return dict(zip(keys, (ACCEL_N, ACCEL_K, GYRO_N, GYRO_K), strict=True))


KALIBR = densities('accelerometer_noise_density', 'accelerometer_random_walk',
                   'gyroscope_noise_density', 'gyroscope_random_walk')
LIO_SAM = {'imuTopic': '/imu/data_raw', **densities('imuAccNoise', 'imuAccBiasN', 'imuGyrNoise',
                                                    'imuGyrBiasN')}


def diagonal(value):
    return [[near(value) if i == j else 0 for j in range(3)] for i in range(3)]


# Per sample N sqrt(f) = 0.8 and 0.04, K sqrt(f) = 0.01 and 6e-4. In units of navigation
# 2e-3 rad/s/sqrt(Hz) = 2e-3 * 60 / DEGREE deg/sqrt(h) = 6.875; 3e-4 rad/s = 61.88 deg/h.
@pytest.mark.parametrize(('consumer', 'place', 'expected'), [
    ('kalibr', (), {**KALIBR, 'rostopic': '/imu/data_raw', 'update_rate': 400.0}),
    ('lio_sam', (), {'/**': {'ros__parameters': LIO_SAM}}),
    ('lio_sam_ros1', (), {'lio_sam': LIO_SAM}),
    ('fast_lio', (), {
        'mapping': {'acc_cov': near(0.64), 'gyr_cov': near(1.6e-3), 'b_acc_cov': near(1e-4),
                    'b_gyr_cov': near(3.6e-7)},
        'common': {'imu_topic': '/imu/data_raw'}}),
    # It never reads a bias.
    ('fast_livo2', ('imu',), {'imu_en': True, 'acc_cov': near(0.64), 'gyr_cov': near(1.6e-3)}),
    ('point_lio', ('mapping',), {
        'acc_cov_input': near(0.64), 'gyr_cov_input': near(1.6e-3),
        'imu_meas_acc_cov': near(0.64), 'imu_meas_omg_cov': near(1.6e-3),
        'b_acc_cov': near(1e-4), 'b_gyr_cov': near(3.6e-7), 'imu_time_inte': 0.0025}),
    ('gtsam', (), {
        'accelerometerCovariance': diagonal(1.6e-3), 'gyroscopeCovariance': diagonal(4e-6),
        'biasAccCovariance': diagonal(2.5e-7), 'biasOmegaCovariance': diagonal(9e-10)}),
    ('msckf_vio', (), {'noise': densities('acc', 'acc_bias', 'gyro', 'gyro_bias')}),
    ('isaac_ros_vslam', (), {'/**': {'ros__parameters': {
        **densities('accel_noise_density', 'accel_random_walk', 'gyro_noise_density',
                    'gyro_random_walk'), 'calibration_frequency': 400.0}}}),
    ('maplab', (), {'sensor_type': 'IMU', 'sigmas': densities(
        'acc_noise_density', 'acc_bias_random_walk_noise_density', 'gyro_noise_density',
        'gyro_bias_random_walk_noise_density')}),
    ('svo_pro', (), {'imu_params': {
        **densities('sigma_acc_c', 'sigma_acc_bias_c', 'sigma_omega_c', 'sigma_omega_bias_c'),
        'imu_rate': 400.0}}),
    # The variance of a step of the bias is added.
    ('fusioncore', ('fusioncore', 'ros__parameters'), {
        'imu.gyro_noise': near(GYRO_N * 20), 'imu.accel_noise': near(ACCEL_N * 20),
        'ukf.q_gyro_bias': near(GYRO_K**2 / 400), 'ukf.q_accel_bias': near(ACCEL_K**2 / 400)}),
    ('kf_gins', ('imunoise',), {
        'arw': [near(6.87549), near(3.43775), near(0.687549)],
        'vrw': [near(2.4), near(1.2), near(0.24)],
        'gbstd': [near(61.8794), near(30.9397), near(6.18794)],
        'abstd': [near(500), near(250), near(50)], 'corrtime': near(200 / 3600)}),
    ('ob_gins', ('imumodel',), {
        'arw': near(6.87549), 'vrw': near(2.4), 'gbstd': near(61.8794), 'abstd': near(500),
        'corrtime': near(200 / 3600)}),
    ('autoware', PARAMETERS, {
        'angular_velocity_stddev_xx': near(0.04), 'angular_velocity_stddev_yy': near(0.02),
        'angular_velocity_stddev_zz': near(0.004), 'angular_velocity_offset_x': 0.01,
        'angular_velocity_offset_y': 0.01, 'angular_velocity_offset_z': 0.01,
        'acceleration_stddev': near(0.8)}),
    # Strings, for each backend.
    ('rtabmap', PARAMETERS, {'OdomORBSLAM/SamplingRate': '400.0', **{
        f'Odom{backend}{key}': text for backend, keys in (
            ('OpenVINS/', ('AccelerometerNoiseDensity', 'AccelerometerRandomWalk',
                           'GyroscopeNoiseDensity', 'GyroscopeRandomWalk')),
            ('ORBSLAM/', ('AccNoise', 'AccWalk', 'GyroNoise', 'GyroWalk')),
            ('MSCKF/Noise', ('Acc', 'AccBias', 'Gyro', 'GyroBias')),
            ('LIOSAM/Imu', ('AccNoise', 'AccBiasN', 'GyrNoise', 'GyrBiasN')))
        for key, text in zip(keys, ('0.04', '0.0005', '0.002', '3.0e-05'), strict=True)}}),
    # Of a message.
    *(('drivers', (node, 'ros__parameters'), expected) for node, expected in (
        ('microstrain_inertial_driver', {'imu_linear_cov': ACCEL_COVARIANCE,
                                         'imu_angular_cov': GYRO_COVARIANCE}),
        ('vn_sensor_msgs', {'linear_acceleration_covariance': ACCEL_COVARIANCE,
                            'angular_velocity_covariance': GYRO_COVARIANCE}),
        ('/**/camera', {'linear_accel_cov': near(0.64), 'angular_velocity_cov': near(1.6e-3)}),
        ('xsens_mti_node', {
            'linear_acceleration_stddev': [near(0.8), near(0.4), near(0.08)],
            'angular_velocity_stddev': [near(0.04), near(0.02), near(0.004)]}),
        ('/**/imu', {'linear_acceleration_stdev': near(0.8),
                     'angular_velocity_stdev': near(0.04)}))),
    *(('robot_localization', (*PARAMETERS, key), expected) for key, expected in (
        ('linear_acceleration_stddev', near(0.8)), ('angular_velocity_stddev', near(0.04)),
        ('linear_acceleration_covariance', ACCEL_COVARIANCE),
        ('angular_velocity_covariance', GYRO_COVARIANCE))),
    ('basalt', ('value0',), {
        'imu_update_rate': 400.0, 'accel_noise_std': triple(ACCEL_N),
        'gyro_noise_std': triple(GYRO_N), 'accel_bias_std': [ACCEL_K, ACCEL_K / 2, 1e-6],
        'gyro_bias_std': [GYRO_K, GYRO_K / 2, 1e-6]}),
    # And no prior of the bias.
    ('okvis2', ('imu_parameters',), densities(
        'sigma_a_c', 'sigma_aw_c', 'sigma_g_c', 'sigma_gw_c')),
    # What is above the default is written, the default where the sensor is better; 9 is
    # MAV_PARAM_TYPE_REAL32.
    ('px4', (), {
        'EKF2_ACC_NOISE': (near(0.4), 9), 'EKF2_ACC_B_NOISE': (near(0.005), 9),
        'EKF2_GYR_NOISE': (near(0.02), 9), 'EKF2_GYR_B_NOISE': (0.001, 9)}),
    ('ardupilot', (), {
        'EK3_ACC_P_NSE': near(ACCEL_N * 83**0.5), 'EK3_ABIAS_P_NSE': 0.02,
        'EK3_GYRO_P_NSE': near(GYRO_N * 83**0.5), 'EK3_GBIAS_P_NSE': 0.001}),
    # Squared densities of each axis.
    ('rovio', (), {
        'vel_0': near(1.6e-3), 'vel_1': near(4e-4), 'vel_2': near(1.6e-5),
        'att_0': near(4e-6), 'att_1': near(1e-6), 'att_2': near(4e-8),
        'acb_0': near(2.5e-7), 'acb_1': near(6.25e-8), 'acb_2': near(1e-12),
        'gyb_0': near(9e-10), 'gyb_1': near(2.25e-10), 'gyb_2': near(1e-12)}),
    # The larger step of a bias in a frame.
    ('glim', ('sensors',), {'imu_acc_noise': ACCEL_N, 'imu_gyro_noise': GYRO_N,
                            'imu_bias_noise': near(ACCEL_K * 0.1**0.5)}),
    # imu_si_errors: gb_dyn * DEGREE / sqrt(gb_corr) is the driving density, here K.
    ('navego', (), {
        'imu.arw': triple(6.87549), 'imu.vrw': triple(2.4),
        'imu.gb_dyn': triple(GYRO_K * 200**0.5 / DEGREE), 'imu.gb_corr': [200.0] * 3,
        'imu.ab_dyn': triple(ACCEL_K * 200**0.5 / 9.80665e-3), 'imu.ab_corr': [200.0] * 3,
        'imu.arrw': [0.0] * 3, 'imu.vrrw': [0.0] * 3}),
    # imuerrset: sqrtR0G deg/h sqrt(2/TauG) is the driving density, here K.
    ('psins', (), {
        'web': triple(6.87549), 'wdb': triple(ACCEL_N / 9.80665e-6),
        'sqrtR0G': triple(GYRO_K * 10 / DEGREE * 3600), 'TauG': [200.0] * 3,
        'sqrtR0A': triple(ACCEL_K * 10 / 9.80665e-6), 'TauA': [200.0] * 3}),
    # IMUSensorSimulator: a sample is NoiseDensity sqrt(bandwidth), a step of the random walk
    # RandomWalk over it, N sqrt(f) and K/sqrt(f) where the bandwidth is f: 'single-sided'.
    ('matlab', (), {
        'gyro.NoiseDensity': [2e-3, 1e-3, 2e-4], 'gyro.RandomWalk': [3e-5, 1.5e-5, 1e-6],
        'gyro.BiasInstability': [0.0] * 3, 'accel.NoiseDensity': [4e-2, 2e-2, 4e-3],
        'accel.RandomWalk': [5e-4, 2.5e-4, 1e-6], 'accel.BiasInstability': [0.0] * 3}),
    # GaussianNoiseModel::ApplyImpl lets the bias settle at dynamic_bias_stddev sqrt(Tc/2): sigma.
    *(('gazebo', (sensor, axis, 'noise'), {
        'type': 'gaussian', 'mean': 0.0, 'stddev': near(20 * n),
        'dynamic_bias_stddev': near(10 * k / 100**0.5), 'dynamic_bias_correlation_time': 200.0})
      for sensor, axis, n, k in (('angular_velocity', 'y', GYRO_N / 2, GYRO_K / 2),
                                 ('linear_acceleration', 'x', ACCEL_N, ACCEL_K))),
    ('rotors', (), {
        'gyroscopeNoiseDensity': GYRO_N, 'gyroscopeBiasRandomWalk': near(GYRO_K),
        'gyroscopeRandomWalk': near(GYRO_K), 'gyroscopeBiasCorrelationTime': 200.0,
        'accelerometerNoiseDensity': ACCEL_N, 'accelerometerRandomWalk': near(ACCEL_K),
        'accelerometerBiasCorrelationTime': 200.0}),
    # ImuSimpleParams.hpp: stability/sqrt(tau) is the density of the random walk.
    ('pegasus', (), {
        'update_rate': 400.0,
        'gyroscope': {'noise_density': GYRO_N, 'random_walk': near(GYRO_K),
                      'bias_correlation_time': 200.0},
        'accelerometer': {'noise_density': ACCEL_N, 'random_walk': near(ACCEL_K),
                          'bias_correlation_time': 200.0}}),
    # Intervals as wide as those of the results here.
    ('plain', ('gyro_y',), {
        'noise_density': {'value': 1e-3, 'low95': near(0.998e-3), 'high95': near(1.002e-3)},
        'bias_instability': {'below95': near(6e-6)},
        'rate_random_walk': {'value': 1.5e-5, 'low95': near(1.05e-5), 'high95': near(1.95e-5)},
        'filter_noise_density': 1e-3, 'filter_random_walk': 1.5e-5}),
    ('plain', ('gyro_z', 'rate_random_walk'), {'below95': 1e-6}),
    ('airsim', ('Imu',), {
        'SensorType': 2, 'Enabled': True, 'AngularRandomWalk': near(6.87549),
        'VelocityRandomWalk': near(ACCEL_N / 9.80665e-3),
        'GyroBiasStability': near(GYRO_K * 500**0.5 / DEGREE * 3600),
        'GyroBiasStabilityTau': 500.0,
        'AccelBiasStability': near(ACCEL_K * 800**0.5 / 9.80665e-6),
        'AccelBiasStabilityTau': 800.0}),
    ('openvins', ('imu0',), {
        **KALIBR, 'update_rate': 400.0, 'rostopic': '/imu/data_raw', 'model': 'kalibr',
        # Nothing is misaligned.
        'T_i_b': np.eye(4).tolist(), 'Tg': np.zeros((3, 3)).tolist(), **dict.fromkeys(
            ('Tw', 'R_IMUtoGYRO', 'Ta', 'R_IMUtoACC'), np.eye(3).tolist())}),
    ('orb_slam3', (), {'IMU.Frequency': 400.0, **densities(
        'IMU.NoiseAcc', 'IMU.AccWalk', 'IMU.NoiseGyro', 'IMU.GyroWalk')}),
    ('vins_fusion', (), {'acc_n': near(0.8), 'acc_w': near(0.01), 'gyr_n': near(0.04),
                         'gyr_w': near(6e-4), 'imu_topic': '/imu/data_raw'}),
    ('vins_fusion_midpoint', (), {'acc_n': near(0.8 * 2**0.5), 'gyr_n': near(0.04 * 2**0.5),
                                  'acc_w': near(0.01), 'gyr_w': near(6e-4)}),
    ('kimera', (), {**KALIBR, 'rate_hz': 400.0})])
def test_a_file_has_the_numbers_that_its_consumer_reads(consumer, place, expected):
    found = read(consumer, export(EASY, consumer))
    for key in place:
        found = found[key]
    if consumer in OPENCV and consumer != 'okvis2':
        # They read one file for all, of which this is a part.
        found = {key: found[key] for key in expected}
    assert found == expected


@pytest.mark.parametrize('consumer', ['px4', 'ardupilot'])
def test_a_file_for_an_autopilot_is_safe_to_load_as_it_is(consumer):
    quiet = {name: axis_result(name, {'noise_density': 1e-6, 'rate_random_walk': 1e-9})
             for name in AXES}
    text = export(build_result(axes=quiet), consumer)
    assert 'LOWER BOUNDS' in text
    values = [float(re.split(r'[\t,]', line)[3 if consumer == 'px4' else 1])
              for line in text.splitlines() if line and not line.startswith('#')]
    assert values == [0.35, 0.003 if consumer == 'px4' else 0.02, 0.015, 0.001]
    assert f'at rest {"1.0e-05" if consumer == "px4" else "9.11043e-06"}; ' in text


@pytest.mark.parametrize('consumer', CONSUMERS)
def test_every_config_says_where_it_comes_from_and_what_was_measured(consumer):
    text = export(EASY, consumer)
    for part in ('imu_allan 0.1.0', 'rec/imu_2026', '/imu/data_raw',
                 '1,000,000 samples at 400 Hz'):
        assert part in text
    assert not re.search(r'np\.|\bnan\b|\binf\b', text)
    # Much is written above the numbers where much is to be said of them.
    options = ExportOptions() if consumer.startswith('state_space') else ExportOptions(
        inflate={'N': 2.0, 'K': 5.0})
    inflated = export_as_wished(EASY, consumer, options)
    assert kind_of(inflated.encode()[:1 << 14]) == CONFIGURATION
    if consumer != 'plain':
        # N of each axis with its interval, in the unit of the file; three axes, two sensors.
        tuned = export_as_wished(DRIFTING, consumer)
        assert len(re.findall(r'measured [\d.e+-]+ \([\d.e+-]+ to [\d.e+-]+\)', tuned)) >= 6
    assert ('gyro_y is DEAD in this recording (constant): it is in none of the '
            'numbers below') in export(with_axes(EASY, 'gyro_y', **DEAD), consumer)
    assert ('This result has no accelerometer: its numbers are left out.'
            in export(only(EASY, 'gyro'), consumer))


def test_the_bound_in_a_configuration_is_that_of_the_result():
    axis = axis_result('gyro_x', {'noise_density': GYRO_N}, {'rate_random_walk': 1e-4})
    # A random walk of the bound exceeds the interval at 300 s by chance: K sqrt(300/3) is 1e-3.
    curve = replace(axis.curve, tau_s=(3.0, 300.0), ci95=((1e-3, 1e-2), (1e-4, 9e-4)))
    result = build_result(axes={'gyro_x': replace(axis, curve=curve)})
    own = yaml.safe_load(export(result, 'plain'))['gyro_x']
    assert own['rate_random_walk'] == {'below95': 1e-4}
    assert own['filter_random_walk'] == 1e-4


def test_small_numbers_stay_numbers_in_yaml():
    """YAML 1.1 reads 1e-05 as a text; a good gyro must not vanish in seven decimals either."""
    axes = {name: axis_result(name, {'noise_density': 1e-5, 'rate_random_walk': 1.23456789e-11})
            for name in ('gyro_x', 'gyro_y', 'gyro_z')}
    document = yaml.safe_load(export(build_result(axes=axes), 'kalibr'))
    assert (document['gyroscope_noise_density'], document['gyroscope_random_walk']) == (
        1e-5, 1.23457e-11)


def test_a_sensor_that_the_result_lacks_and_a_bound_that_stands_in():
    found = yaml.safe_load(export(only(build(bound=1e-3), 'gyro'), 'kalibr'))
    assert found == {'gyroscope_noise_density': GYRO_N, 'gyroscope_random_walk': 1e-3,
                     'rostopic': '/imu/data_raw', 'update_rate': 400.0}


@pytest.mark.parametrize('consumer', CONSUMERS)
def test_names_from_a_recording_cannot_add_lines(consumer):
    result = build(source=Source('recording', NASTY, NASTY, NASTY, NASTY, 'header'),
                   imu_allan_version=NASTY)
    texts = [export(one, consumer) for one in (result, EASY)]
    assert '\x1b' not in texts[0]
    nasty, tame = ((len(text.splitlines()), {
        key: type(value) for key, value in read(consumer, text).items()}) for text in texts)
    assert nasty == tame


@pytest.mark.parametrize('consumer', ['gazebo', 'rotors'])
@pytest.mark.parametrize(('path', 'shown'), [
    ('night---2', 'night- - -2'), ('a & b --> c', 'a & b - -> c')])
def test_a_comment_in_xml_ends_at_no_name_and_shows_it_as_it_is(consumer, path, shown):
    text = export(build(source=replace(EASY.source, path=path)), consumer)
    assert f'\n{shown}, ' in text
    # Its body has no two hyphens, or no parser reads the file.
    assert read(consumer, text)


def test_what_gives_no_configuration_is_refused():
    with refused('no configuration for kalibr: no axis of this result has a noise density '
                 '(constant or too short); look at the driver, or record longer'):
        export(with_axes(only(EASY, 'gyro'), **DEAD), 'kalibr')


@pytest.mark.parametrize('fault', [DEAD, {'high_passed_hz': 0.05, 'drift_model': None}],
                         ids=['dead', 'high-passed'])
def test_the_mean_of_an_axis_without_numbers_is_no_offset(fault):
    found = yaml.safe_load(export(with_axes(EASY, 'gyro_y', **fault), 'autoware'))
    numbers = found['/**']['ros__parameters']
    assert {key[-1] for key in numbers if 'offset' in key} == {'x', 'z'}


FLICKERING = with_coefficient(EASY, 'gyro_y', 'bias_instability', observable=True, value=1e-4,
                              ci95=(5e-5, 2e-4), upper95=None)


def test_the_filter_that_matlab_is_given_makes_flicker_of_b():
    text = export(FLICKERING, 'matlab')
    # Kasdin's recursion, which fractalcoef(1, 1) shows in code generated from it: 1, -1/2.
    [poles] = set(re.findall(r'BiasInstabilityCoefficients = fractalcoef\((\d+), 1\);', text))
    k = np.arange(1, int(poles) + 1)
    denominator = np.concatenate(([1.0], np.cumprod((k - 1.5) / k)))
    assert denominator[1] == -0.5
    nu = np.fft.rfftfreq(1 << 17)[1:]
    power = np.abs(np.fft.rfft(denominator, 1 << 17)[1:]) ** -2.0

    def flat(m, power):
        weight = 2 * np.sin(np.pi * m * nu) ** 4 / (m * np.sin(np.pi * nu)) ** 2
        return np.sqrt(2 * np.sum(power * weight) / (1 << 17) / (2 * np.log(2) / np.pi))

    for m, tolerance in (10, 0.02), (100, 0.02), (1000, 0.02), (8000, 0.1):
        assert flat(m, power) == pytest.approx(1, abs=tolerance)
    # The default of one pole is white noise of twice the size.
    one = np.abs(1 - 0.5 * np.exp(-2j * np.pi * nu)) ** -2
    assert flat(1000, one) * 0.6643 == pytest.approx(2 / np.sqrt(1000), rel=0.01)


def test_what_a_driver_says_of_a_message_is_at_the_rate_of_its_own_topic():
    halves = with_axes(EASY, 'accel', sample_rate_hz=100.0)
    found = yaml.safe_load(export(halves, 'drivers'))
    assert found['/**/camera']['ros__parameters'] == {
        'linear_accel_cov': near(ACCEL_N**2 * 100), 'angular_velocity_cov': near(GYRO_N**2 * 400)}
    for consumer, key in (('robot_localization', 'linear_acceleration_stddev'),
                          ('autoware', 'acceleration_stddev')):
        text = export(halves, consumer)
        assert yaml.safe_load(text)['/**']['ros__parameters'][key] == near(ACCEL_N * 10)
        assert 'at f = 100 Hz (accel), 400 Hz (gyro)' in text
        text = export(halves, consumer, rate_hz=25.0)
        assert yaml.safe_load(text)['/**']['ros__parameters'][key] == near(ACCEL_N * 5)


def test_a_slow_process_keeps_its_time_in_the_state_space(tmp_path):
    """Six digits of exp(-0.1/30000) leave one of what it forgets in a step."""
    result = with_axes(only(EASY, 'gyro_x'), drift_model=lambda axis: replace(
        axis.drift_model, processes=(GaussMarkov(3e-5, 3e4), GaussMarkov(2e-5, 7e5))))
    space = state_space(result.axes['gyro_x'], 0.1)
    document = json.loads(export(result, 'state_space'))
    assert document['step_s'] == 0.1
    found = document['axes']['gyro_x']
    for part, rows in found.items():
        assert rows == getattr(space, part).tolist()
    assert 1 - found['transition'][0][0] == pytest.approx(0.1 / 3e4, rel=1e-5)
    # A filter in C++ reads the same doubles.
    compiler = shutil.which('c++') or pytest.skip('no C++ compiler')
    (tmp_path / 'state_space.hpp').write_text(export(result, 'state_space_cpp'))
    (tmp_path / 'show.cpp').write_text(
        '#include "state_space.hpp"\n#include <cstdio>\n'
        'int main() {\n  namespace gyro = imu_allan::gyro_x;\n'
        '  for (int i = 0; i < gyro::states; ++i)\n'
        '    std::printf("%.17g %.17g\\n", gyro::transition[i][i], gyro::process[i][i]);\n}\n')
    subprocess.run([compiler, '-std=c++17', '-Wall', '-Werror', 'show.cpp', '-o', 'show'],
                   cwd=tmp_path, check=True)
    said = subprocess.run(['./show'], cwd=tmp_path, check=True, capture_output=True).stdout
    np.testing.assert_array_equal(
        np.array(said.split(), dtype=float).reshape(3, 2),
        np.stack([np.diag(space.transition), np.diag(space.process)], axis=1))


def test_of_a_datasheet_nothing_was_measured(tmp_path):
    (tmp_path / 'imu.yaml').write_text('gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}\n')
    sheet = load_model(tmp_path / 'imu.yaml')
    text = export_as_wished(result_of_datasheet(sheet, 'imu.yaml'), 'msckf_vio')
    assert 'worst axis; datasheet 0.0005236' in text
    assert 'measured' not in text.replace('nothing of it was measured', '')


def exported_sheet(tmp_path, consumer, limits):
    (tmp_path / 'imu.yaml').write_text(
        f'gyro: {{noise_density: 0.03 deg/s/sqrt(Hz){limits}}}\n'
        'accel: {noise_density: 100 ug/sqrt(Hz)}\n')
    sheet = result_of_datasheet(load_model(tmp_path / 'imu.yaml'), 'imu.yaml', 100.0)
    return export_as_wished(sheet, consumer)


def test_the_flicker_of_a_datasheet_gives_a_process_where_a_filter_wants_one(tmp_path):
    # Sigma is 1.08 B = 10.8 deg/h, and the Allan deviation peaks at 1.89 Tc = 60 s or 10 min.
    text = exported_sheet(tmp_path, 'kf_gins', ', bias_instability: 10 deg/h')
    found = yaml.safe_load(text)['imunoise']
    assert (found['gbstd'], found['corrtime']) == ([near(10.8)] * 3, near(60 / 1.89 / 3600))
    assert ('# Sigma and Tc are those of a process as large as all slow noise after 60 s unaided; '
            'flicker is 0.664 B.\n') in text
    found = xml(exported_sheet(tmp_path, 'gazebo', ', bias_instability: 10 deg/h'))
    noise = found['angular_velocity']['z']['noise']
    assert noise['dynamic_bias_correlation_time'] == near(600 / 1.89)
    assert noise['dynamic_bias_stddev'] == near(
        10.8 * DEGREE / 3600 * (2 / (600 / 1.89))**0.5)


def test_all_slow_noise_of_a_datasheet_enters_the_bias_of_a_filter(tmp_path):
    limits = ', bias_instability: 10 deg/h, rate_random_walk: 1e-6 rad/s^2/sqrt(Hz)'
    process = ', gauss_markov: {sigma: 10 deg/h, correlation_time: 30 s}'
    b, h = 10 * DEGREE / 3600, 60.0
    slow = {'B': 2 * np.log(2) / np.pi * b**2, 'K': 1e-12 * h / 3,
            # IEEE Std 952-1997, C.1.1.6: a Markov process.
            'sigma': 2 * (b * 30 / h)**2 * (h / 30 - (3 - 4 * np.exp(-2) + np.exp(-4)) / 2)}
    for more, terms in (('', 'BK'), (process, ('B', 'K', 'sigma'))):
        level = sum(slow[term] for term in terms) ** 0.5
        text = exported_sheet(tmp_path, 'kalibr', limits + more)
        assert yaml.safe_load(text)['gyroscope_random_walk'] == pytest.approx(
            level * (3 / h)**0.5, rel=1e-3)
        assert f'from {", ".join(terms)} ' in text
    found = yaml.safe_load(exported_sheet(tmp_path, 'kf_gins', limits))['imunoise']
    assert found['gbstd'] == [pytest.approx(
        1.08 / 0.664 * (slow['B'] + slow['K'])**0.5 * 3600 / DEGREE, rel=1e-3)] * 3
    # A process is given as the filter has it.
    found = yaml.safe_load(exported_sheet(tmp_path, 'kf_gins', limits + process))['imunoise']
    assert (found['gbstd'], found['corrtime']) == ([near(10.0)] * 3, near(30 / 3600))


def test_a_datasheet_has_no_upper_ends_to_be_conservative_with():
    sheet = result_of_datasheet(parse_model('gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}'), 'a')
    with refused('a datasheet has no intervals to be conservative about; --inflate N=2,K=5 makes '
                 'its numbers larger'):
        export_as_wished(sheet, 'kalibr', ExportOptions(conservative=True))


def test_an_imu_on_two_topics_has_none_that_a_filter_could_subscribe_to():
    result = build()
    apart = replace(result, source=replace(result.source, topic='/imu/gyro, /imu/accel'))
    for consumer in ('kalibr', 'vins_fusion', 'fast_lio'):
        text = export(apart, consumer)
        assert '/imu/gyro, /imu/accel' not in [
            line for line in text.splitlines() if not line.lstrip().startswith('#')]
        assert 'topic: "/imu/gyro' not in text


@pytest.mark.parametrize(('consumer', 'line'), [
    ('kf_gins', '  # gbstd: the datasheet has no value for it'),
    ('gazebo', '      <!-- dynamic_bias: the datasheet has no value for it -->'),
    ('glim', '    // imu_bias_noise')])
def test_a_process_that_a_datasheet_does_not_have_is_missing_and_said_so(tmp_path, consumer, line):
    text = exported_sheet(tmp_path, consumer, '')
    assert line in text.splitlines()
    assert read(consumer, text)


@pytest.mark.skipif(OCTAVE is None, reason='octave-cli is not installed')
def test_files_for_matlab_run_in_octave(tmp_path):
    """The toolboxes' own functions stand in: what they are given is what is written here."""
    functions = {
        **dict.fromkeys(('gyroparams', 'accelparams'),
                        "out = struct('NoiseType', 'double-sided', 'NoiseDensity', 0);"),
        'fractalcoef': "out = struct('Numerator', 1, 'Denominator', ones(1, varargin{1}));",
        'imuSensor': 'out = varargin;', 'imuerrset': 'out = varargin;'}
    for name, body in functions.items():
        (tmp_path / f'{name}.m').write_text(f'function out = {name}(varargin)\n{body}\nend\n')
    for consumer in ('matlab', 'navego', 'psins'):
        (tmp_path / f'{consumer}_file.m').write_text(export(FLICKERING, consumer))
    (tmp_path / 'all_of_them.m').write_text("""
        matlab_file
        printf('%s %g %g %d %g\\n', gyro.NoiseType, gyro.NoiseDensity(1), gyro.RandomWalk(2),
               numel(gyro.BiasInstabilityCoefficients.Denominator), imu{3});
        clear imu
        navego_file
        printf('%g ', imu.gb_corr, imu.arrw); printf('\\n');
        eb = [1; 1; 1]; db = [1; 1; 1];
        psins_file
        printf('%d %d %g\\n', size(imuerr{5}), imuerr{6}(1));
        """)
    done = subprocess.run([OCTAVE, '--quiet', '--no-gui', '--no-init-file', 'all_of_them.m'],
                          cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.stdout.split() == [
        'single-sided', '0.002', '1.5e-05', '2000', '400', *['200'] * 3, *'000', '3', '1', '200']


@pytest.mark.parametrize(('name', 'options'), [
    ('tuned', ExportOptions()), ('measured', ExportOptions(as_measured=True)),
    ('as_wished', ExportOptions(aiding_s=1.0, coast_s=7200.0, conservative=True,
                                inflate={'N': 2.0, 'K': 5.0}))])
def test_a_file_for_kalibr_says_what_it_said(name, options):
    slow = with_axes(DRIFTING, 'gyro_x', power_law=PowerLaw(0.7, (0.68, 0.72), 1e-9))
    text = export_as_wished(slow, 'kalibr', options)
    # The last digits depend on how SciPy comes to the best numbers.
    assert_as_before(re.sub(r'\d+\.\d+(e-\d+)?', lambda found: f'{float(found[0]):.3g}', text),
                     f'snapshots/kalibr_{name}.txt')


def test_a_result_without_drift_model_gives_the_measured_numbers_and_says_so():
    old = with_axes(EASY, drift_model=None)
    text = export_as_wished(old, 'kalibr')
    assert ('# Coefficients as measured: this result has no drift model to tune from.'
            in text.splitlines())
    assert yaml.safe_load(text)['gyroscope_random_walk'] == GYRO_K
    with refused('no configuration for state_space: this result has no drift model; analyze the '
                 'recording again'):
        export_as_wished(old, 'state_space')


# What the comment expects is expected of the numbers in the file.

def said(text):
    """Read the range of the expected NIS, and of the squared error, of each sensor."""
    found = re.findall(r'(gyro|accel): expected NIS (\S+)(?: to (\S+))?; squared error after '
                       r'[^;]*?unaided (\S+)(?: to (\S+))? times', text)
    return {sensor: [float(low), float(high or low), float(least), float(most or least)]
            for sensor, low, high, least, most in found}


@pytest.mark.parametrize('consumer', ['basalt', 'rovio'])
def test_where_each_axis_has_its_own_numbers_each_is_expected_to_be_right(consumer):
    for nis_low, nis_high, least, most in said(export_as_wished(DRIFTING, consumer)).values():
        assert 0.8 < nis_low <= nis_high < 1.1
        assert 0.7 < least <= most < 1.4
    # Of the axis with a tenth of the noise the worst pair predicts a hundred times the variance.
    assert said(export_as_wished(DRIFTING, 'kalibr'))['gyro'][2] < 0.05


def test_the_state_space_is_no_tuned_number():
    for consumer in ('state_space', 'state_space_cpp'):
        text = export_as_wished(EASY, consumer)
        assert 'The whole drift model, as measured: NIS and' in text
        assert 'what it predicts, up to 60 min' in text
        assert not said(text)
        with refused(f'{consumer} is the drift model as measured: neither --conservative nor '
                     '--inflate applies; scale its matrices yourself'):
            export_as_wished(EASY, consumer, ExportOptions(inflate={'K': 2.0}))


def test_one_process_for_three_axes_is_that_of_one_of_them():
    # x has the larger sigma, y the longer time: together they would be neither's.
    result = EASY
    for name, *process in (('gyro_x', 4e-4, 50.0), ('gyro_y', 1e-4, 200.0),
                           ('gyro_z', 1e-4, 100.0)):
        result = with_axes(result, name, gauss_markov=GaussMarkov(*process))
    root = ElementTree.fromstring(export(result, 'rotors'))
    # 4e-4 sqrt(2/50) = 8e-5.
    assert float(root.find('gyroscopeRandomWalk').text) == near(8e-5)
    assert float(root.find('gyroscopeBiasCorrelationTime').text) == 50.0
    # One time for all axes of both sensors.
    found = yaml.safe_load(export(result, 'ob_gins'))['imumodel']
    assert (found['gbstd'], found['corrtime']) == (near(4e-4 / DEGREE * 3600), near(50 / 3600))
    # An axis without a process has a K, which is not compared with the sigma of the others.
    result = with_axes(result, 'gyro_z', gauss_markov=None)
    result = with_coefficient(with_coefficient(
        result, 'gyro_z', 'bias_instability', **UNSEEN, upper95=None), 'gyro_z',
        'rate_random_walk', observable=True, value=1e-3, ci95=(9e-4, 2e-3), upper95=None)
    root = ElementTree.fromstring(export(result, 'rotors'))
    assert float(root.find('gyroscopeRandomWalk').text) == near(8e-5)


def test_every_consumer_has_a_family_and_is_called_by_what_people_say():
    assert sorted(name for names in FAMILIES.values() for name in names) == sorted(CONSUMERS)
    for said, name in (('VINS', 'vins_fusion'), ('OpenVINS', 'openvins'),
                       ('ekf', 'robot_localization'), ('FAST-LIO2', 'fast_lio'),
                       ('RobotLocalization', 'robot_localization'), ('Ardu Pilot', 'ardupilot')):
        assert consumer_called(said) == name
