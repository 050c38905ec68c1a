# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The temperature beside an IMU, from every kind of recording that has one."""

from dataclasses import replace
import re

from bags import mcap_written, serialized
from characterized import celsius_at, messages
from imu_allan import analyze, simulate
from imu_allan.recordings import open_recording, RecordingOptions
from imu_allan.recordings.thermometers import readings_of, temperatures
import numpy as np
from other_types import full_definition, recorded, sample, stamped, store_with, vector
import pytest
from whole_lines import refused

TEMPERATURE = 'sensor_msgs/msg/Temperature'
RATE_HZ = 10
SECONDS = np.arange(36_000) / RATE_HZ
CELSIUS = celsius_at(SECONDS)
PER_KELVIN = 2e-3
STORE = store_with({})


@pytest.fixture(scope='module')
def samples():
    """Draw an hour at rest of which gyro_x follows the temperature."""
    rows = np.stack([simulate({'noise_density': 1e-3}, len(SECONDS), RATE_HZ, seed)
                     for seed in range(6)], axis=1)
    rows[:, 0] += PER_KELVIN * CELSIUS
    rows[:, 5] += 9.81
    return rows


def write(path, samples, thermometers, imu='/imu/data_raw', headers=True):
    """Write an Imu topic, and one for each thermometer, with its frame_id; every 2 s."""
    definition = full_definition(STORE, TEMPERATURE)
    with mcap_written(path) as message:
        for number, (stamp, row) in enumerate(serialized(messages(samples, RATE_HZ))):
            message(imu, stamp, row)
            for name, frame_id in thermometers.items() if number % 20 == 0 else ():
                heat = STORE.types[TEMPERATURE](
                    stamped(STORE, 0, frame_id, stamp if headers else 0), CELSIUS[number], 0.0)
                message(name, stamp, STORE.serialize_cdr(heat, TEMPERATURE), TEMPERATURE,
                        definition)
    return path


def follows(result):
    """Tell whether the coefficient was found, and on gyro_x alone."""
    found = {name: axis.trend.temperature for name, axis in result.axes.items()
             if axis.trend is not None and axis.trend.temperature is not None}
    if not found:
        return False
    assert list(found) == ['gyro_x']
    assert found['gyro_x'].ci95[0] < PER_KELVIN < found['gyro_x'].ci95[1]
    assert found['gyro_x'].per_kelvin == pytest.approx(PER_KELVIN, rel=0.05)
    return True


@pytest.mark.parametrize('headers', [True, False])
def test_a_topic_of_the_same_namespace_is_taken(tmp_path, samples, output_of, headers):
    thermometers = {'/imu/temperature': '', '/battery/temperature': ''}
    path = write(tmp_path / 'a.mcap', samples, thermometers, headers=headers)
    assert follows(analyze(path))
    assert '  temperature from /imu/temperature' in output_of('info', path).splitlines()


def test_a_reading_without_a_stamp_is_of_when_it_came_and_leaves_the_others_theirs():
    block = messages(np.full((3, 6), 20.0), RATE_HZ)
    stamps = block.header_ns.copy()
    late = replace(block, receive_ns=stamps + 7)
    late.header_ns[1] = 0
    for clock, expected in (
            ('header', [stamps[0], stamps[1] + 7, stamps[2]]), ('receive', late.receive_ns)):
        found, celsius = readings_of(late, clock)
        assert (found.tolist(), celsius.tolist()) == (list(expected), [20.0] * 3)


@pytest.fixture
def chosen(output_of):
    def thermometer(path, *options):
        return re.findall('^  temperature from (.*)$', output_of('info', path, *options),
                          re.MULTILINE)
    return thermometer


def test_the_frame_id_decides_where_the_namespace_does_not(tmp_path, samples, chosen):
    few = samples[:100]
    path = write(tmp_path / 'a.mcap', few, {'/temp': 'imu_link', '/motor': 'motor'}, '/imu')
    assert chosen(path) == ['/temp']
    assert chosen(path, '--temperature', 'motor') == ['/motor']
    path = write(tmp_path / 'b.mcap', few, {'/temp': '', '/motor': 'motor'}, '/imu')
    assert chosen(path) == []
    path = write(tmp_path / 'c.mcap', few, {'/imu/a': 'x', '/imu/b': 'imu_link'})
    assert chosen(path) == ['/imu/b']
    with refused(
            f'{path}: --temperature /imu/c: no topic of type sensor_msgs/Temperature, field or '
            'column of this name; there are /imu/a, /imu/b'):
        analyze(path, reading=RecordingOptions(temperature='/imu/c'))


def test_a_column_is_taken(tmp_path, samples):
    columns = zip(SECONDS.tolist(), samples[:, 0].tolist(), CELSIUS.tolist(), strict=True)
    rows = [f'{second},{x!r},{celsius if number % 20 == 0 else ""}'
            for number, (second, x, celsius) in enumerate(columns)]
    path = tmp_path / 'a.csv'
    for name, temperature, taken in (
            ('temperature [degC]', None, True), ('heat', 'heat', True), ('heat', None, False)):
        path.write_text('\n'.join([f'time_s,gyro_x,{name}', *rows, '']))
        assert follows(analyze(path, reading=RecordingOptions(temperature=temperature))) is taken
    # Whether others hold one is not known where a name is given.
    with refused(f'{path}: --temperature hat: no topic of type sensor_msgs/Temperature, field or '
                 'column of this name'):
        analyze(path, reading=RecordingOptions(temperature='hat'))


def test_a_column_that_is_no_temperature_is_reported(tmp_path):
    path = tmp_path / 'a.csv'
    rows = [f'{i / 100},{(i * i) % 7},warm' for i in range(500)]
    path.write_text('\n'.join(['time_s,gyro_x,temp', *rows, '']))
    [remark] = [remark for remark in analyze(path).warnings if remark.code == 'thermometer']
    line = (f'{path}: line 2: 0.0,0,warm lacks a number in a column that is read. A column that '
            'holds none can be left out: --columns names the others, and --rate takes the place '
            'of the time. A time is a number or like 2024-06-24 19:02:59.75')
    assert remark.values == {'fault': 'unread', 'reason': line}
    with refused(line):
        analyze(path, reading=RecordingOptions(temperature='temp'))


@pytest.mark.parametrize(('given', 'name'), [
    (None, '/sensor:temperature'), ('board.heat', '/sensor:board.heat')])
def test_a_field_of_the_messages_is_taken_in_celsius_or_kelvin(tmp_path, chosen, given, name):
    type_name = 'my_driver/msg/Any'
    text = ('std_msgs/Header header\ngeometry_msgs/Vector3 angular_velocity\n'
            'geometry_msgs/Vector3 linear_acceleration\nfloat32 temperature\nBoard board\n')
    kelvin = 300.0 + np.arange(50)
    # One that is missing leaves the others in degrees Celsius.
    kelvin[7] = np.nan

    def message(store, number):
        return store.types[type_name](
            stamped(store, number), vector(store, sample(number)[:3]),
            vector(store, sample(number)[3:]), kelvin[number],
            store.types['my_driver/msg/Board'](kelvin[number]))

    path = recorded(tmp_path, type_name, {
        'my_driver/msg/Board': 'float64 heat\n', type_name: text}, message, 50)
    assert chosen(path, *['--temperature', given][:2 * bool(given)]) == [name]
    options = RecordingOptions(temperature=given)
    with open_recording(path, options=options) as recording:
        [(stamps, celsius)] = temperatures(recording, '/sensor', 'header')
        [(block, _)] = recording.decoded('/sensor')
    assert stamps.tolist() == block.header_ns.tolist()
    np.testing.assert_allclose(celsius, kelvin - 273.15, atol=1e-4)
    drawn = analyze(path, reading=options).temperature
    assert np.mean(drawn.mean) == pytest.approx(np.nanmean(kelvin) - 273.15, abs=0.5)
