# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Every exporter against values worked by hand, read by the consumer's own format library.

The axes are chosen so that the hand can follow: x has N = 2e-3 and K = 3e-5 (gyro) or N = 4e-2 and
K = 5e-4 (accel), y half of that, z a tenth with K not observable below a bound; 400 samples per
second, whose root is 20.
"""

from collections.abc import Callable
import json
import re

from imu_allan.errors import ImuAllanError
from imu_allan.result import Result, Source, Timeline
from imu_allan.writers.filters import CONSUMERS, export, save_exports
import pytest
import yaml

GYRO_N, GYRO_K, ACCEL_N, ACCEL_K = 2e-3, 3e-5, 4e-2, 5e-4
RATE = 400.0


def near(value: float) -> object:
    return pytest.approx(value, rel=1e-14, abs=0)


@pytest.fixture
def build(make_axis: Callable, make_result: Callable) -> Callable[..., Result]:
    def build(bound: float = 1e-6, **fields):
        axes = {}
        for sensor, n, k in (('gyro', GYRO_N, GYRO_K), ('accel', ACCEL_N, ACCEL_K)):
            axes[f'{sensor}_x'] = make_axis(f'{sensor}_x', {'noise_density': n,
                                                            'rate_random_walk': k})
            axes[f'{sensor}_y'] = make_axis(f'{sensor}_y', {'noise_density': n / 2,
                                                            'rate_random_walk': k / 2})
            axes[f'{sensor}_z'] = make_axis(f'{sensor}_z', {'noise_density': n / 10},
                                            {'rate_random_walk': bound})
        settings = {'axes': axes, 'timeline': Timeline(RATE, 1_000_000, 2500.0)}
        settings.update(fields)
        return make_result(**settings)
    return build


@pytest.fixture
def easy(build) -> Result:
    return build()


def opencv(text: str, tmp_path):
    cv2 = pytest.importorskip('cv2', reason='opencv-python-headless is not installed')
    (tmp_path / 'config.yaml').write_text(text)
    storage = cv2.FileStorage(str(tmp_path / 'config.yaml'), cv2.FILE_STORAGE_READ)
    assert storage.isOpened()
    return storage


def test_kalibr_takes_n_and_k_as_they_are(easy):
    config = export(easy, 'kalibr')
    assert config.name == 'imu.yaml'
    assert yaml.safe_load(config.text) == {
        'accelerometer_noise_density': ACCEL_N, 'accelerometer_random_walk': ACCEL_K,
        'gyroscope_noise_density': GYRO_N, 'gyroscope_random_walk': GYRO_K,
        'rostopic': '/imu/data_raw', 'update_rate': 400.0}


def test_openvins_takes_n_and_k_in_a_file_that_opencv_reads(easy, tmp_path):
    # The nodes are views into the storage, which must live as long.
    storage = opencv(export(easy, 'openvins').text, tmp_path)
    imu = storage.getNode('imu0')
    assert imu.getNode('accelerometer_noise_density').real() == ACCEL_N
    assert imu.getNode('accelerometer_random_walk').real() == ACCEL_K
    assert imu.getNode('gyroscope_noise_density').real() == GYRO_N
    assert imu.getNode('gyroscope_random_walk').real() == GYRO_K
    assert imu.getNode('update_rate').real() == 400.0
    assert imu.getNode('rostopic').string() == '/imu/data_raw'
    assert imu.getNode('model').string() == 'kalibr'
    for key in ('T_i_b', 'Tw', 'R_IMUtoGYRO', 'Ta', 'R_IMUtoACC', 'Tg'):
        rows = imu.getNode(key)
        size = 4 if key == 'T_i_b' else 3
        assert [[rows.at(i).at(j).real() for j in range(size)] for i in range(size)] == [
            [float(i == j and key != 'Tg') for j in range(size)] for i in range(size)]


def test_orb_slam3_takes_n_and_k_as_reals(easy, tmp_path):
    storage = opencv(export(easy, 'orb_slam3').text, tmp_path)
    expected = {'IMU.NoiseGyro': GYRO_N, 'IMU.NoiseAcc': ACCEL_N, 'IMU.GyroWalk': GYRO_K,
                'IMU.AccWalk': ACCEL_K, 'IMU.Frequency': 400.0}
    for key, value in expected.items():
        assert storage.getNode(key).isReal(), key
        assert storage.getNode(key).real() == value


def test_vins_fusion_takes_standard_deviations_per_sample(easy, tmp_path):
    config = export(easy, 'vins_fusion')
    storage = opencv(config.text, tmp_path)
    assert storage.getNode('acc_n').real() == near(0.8)
    assert storage.getNode('acc_w').real() == near(0.01)
    assert storage.getNode('gyr_n').real() == near(0.04)
    assert storage.getNode('gyr_w').real() == near(6e-4)
    assert storage.getNode('imu_topic').string() == '/imu/data_raw'
    assert 'sqrt(2)' in config.text


def test_lio_sam_takes_n_and_k(easy):
    document = yaml.safe_load(export(easy, 'lio_sam').text)
    assert document == {'/**': {'ros__parameters': {
        'imuAccNoise': ACCEL_N, 'imuGyrNoise': GYRO_N, 'imuAccBiasN': ACCEL_K,
        'imuGyrBiasN': GYRO_K, 'imuTopic': '/imu/data_raw'}}}


def test_fast_lio_takes_variances_per_sample(easy):
    document = yaml.safe_load(export(easy, 'fast_lio').text)
    assert document == {
        'mapping': {'acc_cov': near(0.64), 'gyr_cov': near(1.6e-3), 'b_acc_cov': near(1e-4),
                    'b_gyr_cov': near(3.6e-7)},
        'common': {'imu_topic': '/imu/data_raw'}}


def test_gtsam_takes_continuous_covariances(easy):
    document = yaml.safe_load(export(easy, 'gtsam').text)
    expected = {'accelerometerCovariance': 1.6e-3, 'gyroscopeCovariance': 4e-6,
                'biasAccCovariance': 2.5e-7, 'biasOmegaCovariance': 9e-10}
    assert set(document) == set(expected)
    for key, value in expected.items():
        assert document[key] == [[near(value), 0, 0], [0, near(value), 0], [0, 0, near(value)]]


def test_basalt_takes_n_and_k_of_each_axis(easy):
    document = json.loads(export(easy, 'basalt').text)
    assert document['value0'] == {
        'imu_update_rate': 400.0, 'accel_noise_std': [ACCEL_N, ACCEL_N / 2, ACCEL_N / 10],
        'gyro_noise_std': [GYRO_N, GYRO_N / 2, GYRO_N / 10],
        'accel_bias_std': [ACCEL_K, ACCEL_K / 2, 1e-6],
        'gyro_bias_std': [GYRO_K, GYRO_K / 2, 1e-6]}
    assert 'gyro_bias_std: not observable on z, there the 95 % upper bound' in \
        document['imu_allan']


def test_msckf_vio_takes_n_and_k(easy):
    assert yaml.safe_load(export(easy, 'msckf_vio').text) == {'noise': {
        'gyro': GYRO_N, 'acc': ACCEL_N, 'gyro_bias': GYRO_K, 'acc_bias': ACCEL_K}}


def test_robot_localization_gets_the_covariance_of_a_message(easy):
    document = yaml.safe_load(export(easy, 'robot_localization').text)
    parameters = document['/**']['ros__parameters']
    assert parameters['linear_acceleration_stddev'] == near(0.8)
    assert parameters['angular_velocity_stddev'] == near(0.04)
    assert parameters['linear_acceleration_covariance'] == [
        near(0.64), 0, 0, 0, near(0.16), 0, 0, 0, near(6.4e-3)]
    assert parameters['angular_velocity_covariance'] == [
        near(1.6e-3), 0, 0, 0, near(4e-4), 0, 0, 0, near(1.6e-5)]


def qgroundcontrol(text: str) -> dict[str, tuple[float, int]]:
    """Read parameters as QGroundControl's ParameterManager::readParametersFromStream does."""
    parameters = {}
    for line in text.splitlines():
        if line.startswith('#') or not line:
            continue
        vehicle, component, name, value, kind = line.split('\t')
        assert (int(vehicle), int(component)) == (1, 1)
        parameters[name] = (float(value), int(kind))
    return parameters


def test_px4_takes_standard_deviations_per_prediction_step(easy):
    mav_param_type_real32 = 9
    assert qgroundcontrol(export(easy, 'px4').text) == {
        'EKF2_ACC_NOISE': (near(0.4), mav_param_type_real32),
        'EKF2_ACC_B_NOISE': (near(0.005), mav_param_type_real32),
        'EKF2_GYR_NOISE': (near(0.02), mav_param_type_real32),
        'EKF2_GYR_B_NOISE': (near(3e-4), mav_param_type_real32)}


def test_px4_follows_another_prediction_rate(easy):
    parameters = qgroundcontrol(export(easy, 'px4', 225.0).text)
    assert parameters['EKF2_GYR_NOISE'][0] == near(0.03)


def test_ardupilot_takes_standard_deviations_per_prediction_step(easy, tmp_path):
    mavparm = pytest.importorskip('pymavlink.mavparm', reason='pymavlink is not installed')
    (tmp_path / 'imu.params').write_text(export(easy, 'ardupilot').text)
    parameters = mavparm.MAVParmDict()
    parameters.load(str(tmp_path / 'imu.params'))
    assert dict(parameters) == {
        'EK3_ACC_P_NSE': near(ACCEL_N * 83**0.5), 'EK3_ABIAS_P_NSE': near(ACCEL_K * 83**0.5),
        'EK3_GYRO_P_NSE': near(GYRO_N * 83**0.5), 'EK3_GBIAS_P_NSE': near(GYRO_K * 83**0.5)}


@pytest.mark.parametrize('consumer', ['px4', 'ardupilot'])
def test_an_autopilot_is_told_that_the_values_are_lower_bounds(easy, consumer):
    assert 'LOWER BOUNDS' in export(easy, consumer).text


def test_a_value_outside_the_range_of_an_autopilot_is_its_end_and_a_comment(
        make_axis, make_result):
    quiet = {name: make_axis(name, {'noise_density': 1e-6}) for name in (
        'gyro_x', 'gyro_y', 'gyro_z')}
    text = export(make_result(axes=quiet, timeline=Timeline(100.0, 1000, 10.0)), 'px4').text
    assert qgroundcontrol(text)['EKF2_GYR_NOISE'][0] == 0.0001
    assert 'is outside the range: its end is written instead' in text


@pytest.mark.parametrize('consumer', CONSUMERS)
def test_every_config_says_where_it_comes_from(easy, consumer):
    text = export(easy, consumer).text
    for part in ('imu_allan 0.1.0', 'rec/imu_2026', '/imu/data_raw', '1000000 samples', '400 Hz'):
        assert part in text


@pytest.mark.parametrize('consumer', [name for name in CONSUMERS if name != 'basalt'])
def test_one_value_for_a_sensor_is_the_worst_axis_with_the_others_as_comments(easy, consumer):
    text = export(easy, consumer).text
    assert 'gyro_x, the worst axis; 95 % interval' in text
    assert re.search('# other axes: gyro_y .*, gyro_z ', text)


@pytest.mark.parametrize('consumer', [name for name in CONSUMERS
                                      if name not in ('basalt', 'robot_localization')])
def test_an_upper_bound_that_stands_in_is_said_to_be_one(build, consumer):
    text = export(build(bound=1e-3), consumer).text
    assert 'NOT OBSERVABLE on gyro_z in this recording: its 95 % upper bound' in text


def test_the_upper_bound_stands_in_where_no_axis_shows_the_coefficient(build):
    result = build(bound=7e-4)
    document = yaml.safe_load(export(result, 'kalibr').text)
    assert document['gyroscope_random_walk'] == 7e-4


@pytest.mark.parametrize('consumer', CONSUMERS)
def test_no_number_is_written_as_numpy_writes_it_or_shortened(easy, consumer):
    assert 'np.' not in export(easy, consumer).text
    assert 'nan' not in export(easy, consumer).text


def test_small_numbers_stay_numbers_in_yaml(make_axis, make_result):
    """YAML 1.1 reads 1e-05 as a text; a good gyro must not vanish in seven decimals either."""
    axes = {name: make_axis(name, {'noise_density': 1e-5, 'rate_random_walk': 1.23456789e-11})
            for name in ('gyro_x', 'gyro_y', 'gyro_z')}
    document = yaml.safe_load(export(make_result(axes=axes), 'kalibr').text)
    assert document['gyroscope_noise_density'] == 1e-5
    assert document['gyroscope_random_walk'] == 1.23456789e-11


def test_a_sensor_that_the_result_lacks_is_left_out_and_named(build):
    result = build()
    gyro = {name: axis for name, axis in result.axes.items() if name.startswith('gyro')}
    for consumer in CONSUMERS:
        text = export(build(axes=gyro), consumer).text
        assert 'no value' in text or 'does not have all three axes' in text
    document = yaml.safe_load(export(build(axes=gyro), 'kalibr').text)
    assert 'accelerometer_noise_density' not in document
    assert document['gyroscope_noise_density'] == GYRO_N


def test_a_constant_axis_gives_no_zero_for_kalibr_to_refuse(make_axis, make_result):
    axes = {name: make_axis(name, {}, {'noise_density': 0.0, 'rate_random_walk': 0.0})
            for name in ('gyro_x', 'gyro_y', 'gyro_z')}
    document = yaml.safe_load(export(make_result(axes=axes), 'kalibr').text)
    assert set(document) == {'rostopic', 'update_rate'}


NASTY = 'evil"\n- key: {x: 1}\n%YAML:1.0 # \x1b[2J \u2028 $(rm) </script>'


@pytest.mark.parametrize('consumer', CONSUMERS)
def test_names_from_a_recording_cannot_add_lines(build, consumer, tmp_path):
    result = build(source=Source('recording', NASTY, NASTY, NASTY, NASTY, 'header'),
                   imu_allan_version=NASTY)
    text, tame = export(result, consumer).text, export(build(), consumer).text
    assert len(text.splitlines()) == len(tame.splitlines())
    assert '\x1b' not in text
    if consumer in ('openvins', 'orb_slam3', 'vins_fusion'):
        storage = opencv(text, tmp_path)
        assert storage.getNode('x').empty()
        assert storage.getNode('key').empty()
    elif consumer == 'basalt':
        assert set(json.loads(text)) == {'value0', 'imu_allan'}
    elif consumer not in ('px4', 'ardupilot'):
        shape = {key: type(value) for key, value in yaml.safe_load(text).items()}
        assert shape == {key: type(value) for key, value in yaml.safe_load(tame).items()}


def test_a_missing_rate_is_told_and_may_be_given(build):
    result = build(timeline=Timeline(None, 10, 1.0))
    with pytest.raises(ImuAllanError, match=r'vins_fusion needs the sample rate.*--rate HZ'):
        export(result, 'vins_fusion')
    assert 'acc_n: 0.8' in export(result, 'vins_fusion', 400.0).text


def test_an_unknown_consumer_is_refused_with_the_known_ones(easy):
    with pytest.raises(ImuAllanError, match='known are kalibr, openvins'):
        export(easy, 'madgwick')


def test_several_configs_go_into_one_folder_under_different_names(easy, tmp_path):
    paths = save_exports(easy, tmp_path, CONSUMERS)
    assert len({path.name for path in paths}) == len(CONSUMERS)
    for path, consumer in zip(paths, CONSUMERS, strict=True):
        assert path.read_text() == export(easy, consumer).text
