# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""CSV recordings."""

from dataclasses import replace
from math import pi
import time

import bags
from bags import no_axes, NO_TIME, refusal, said, START_NS
from characterized import AXES
from hypothesis import given, HealthCheck, settings, strategies as st
from imu_allan import analyze
from imu_allan.finding_messages import advice, sentence_of
from imu_allan.recordings import open_recording, read_blocks, RecordingOptions
import numpy as np
import pytest
from whole_lines import refused

STAMP = 1_403_636_579_758_555_392
HEADER = 'time_s,gyro_x,gyro_y,gyro_z'
GYRO = HEADER.partition(',')[2]
ROWS = np.random.default_rng(4).normal(0, 0.01, (30, 3)).round(6)
SUMMER = [1403636579_750000000, 1403636580_000000000]
LOGGED = {'time': '1 ms', 'gyro_z': '3 deg/s', 'accel_x': '4 g'}
THERE = 'there are time_s, time_ms, gx_dps, w0'
ROSTOPIC = ('%time,field.header.seq,field.header.stamp,field.header.frame_id,'
            'field.orientation.x,field.orientation_covariance0,field.angular_velocity.x,'
            'field.angular_velocity.y,field.angular_velocity.z,field.angular_velocity_covariance0,'
            'field.linear_acceleration.x,field.linear_acceleration.y,'
            'field.linear_acceleration.z,field.linear_acceleration_covariance0\n')
ECHOED = '5,{},imu,0,0,0,1' + ',0' * 9 + ',1,2,3' + ',0' * 9 + ',4,5,6' + ',0' * 9 + '\n'


@pytest.fixture
def path(tmp_path):
    return tmp_path / 'imu.csv'


def read(path, **options):
    """Read a file, which lacks axes on purpose."""
    block, remarks = bags.read(path, **options)
    return block, [remark for remark in remarks if remark.code != 'axis_not_finite']


def read_text(path, text, **options):
    path.write_text(text)
    return read(path, **options)


def named(**columns):
    return RecordingOptions(columns=tuple(columns.items()))


def ignored(path, columns, count=None):
    return said(path, 'ignored_columns', columns=columns,
                count=len(columns) if count is None else count)


@pytest.mark.parametrize('empty', ['', 'NaN'])
@pytest.mark.parametrize('together', [0, 1])
def test_sensors_on_rows_of_their_own_are_the_halves_of_an_imu(path, empty, together):
    # As pandas joins two tables, and PlotJuggler exports two topics.
    rows = [(number, number, empty, '') for number in range(40)]
    rows += [(number + 0.5 * (1 - together), number if together else empty, -number, 25)
             for number in range(0, 40, 2)]
    path.write_text('time [ms],gx,ax,temperature\n' + ''.join(
        f'{",".join(map(str, row))}\n' for row in sorted({row[0]: row for row in rows}.values())))
    result = analyze(path)
    assert {name: axis.signal.mean for name, axis in result.axes.items()} == {
        'gyro_x': (*range(40),), 'accel_x': (*range(0, -40, -2),)}
    assert [axis.sample_rate_hz for axis in result.axes.values()] == pytest.approx([1000, 500])
    assert {*result.temperature.mean} == {25.0}


# A loaded machine may be slow at anything.
@settings(max_examples=30, suppress_health_check=[HealthCheck.function_scoped_fixture,
                                                  HealthCheck.too_slow])
@given(st.permutations(list(AXES)), st.integers(0, 5), st.integers(0, 6))
def test_any_subset_of_columns_in_any_order(path, columns, left_out, place):
    columns = columns[left_out:]
    columns.insert(place, 'time_s')
    values = {name: number + 1.0 for number, name in enumerate(['time_s', *AXES])}
    messages, _ = read_text(path, ','.join(columns) + '\n'
                                  + ','.join(repr(values[name]) for name in columns) + '\n')
    assert messages.header_ns.tolist() == [10**9]
    for axis, name in enumerate(AXES):
        assert np.array_equal(messages.samples[:, axis],
                              [values[name] if name in columns else np.nan], equal_nan=True)
    assert messages.absent.tolist() == [[
        not any(name.startswith(sensor) for name in columns) for sensor in ('gyro', 'accel')]]


def test_without_time_column_the_rate_makes_the_stamps(path):
    for text, stamps in (('gyro_z\n1\n2\n3\n', [0, 2_500_000, 5_000_000]),
                         # Xsens may leave its column of times empty.
                         ('// Update Rate: 400.0Hz\nPacketCounter\tSampleTimeFine\tGyr_Z\n'
                          '1\t\t1\n2\t\t2\n3\t\t3\n', [0, 2_500_000, 5_000_000]),
                         # One that is there counts before a rate.
                         ('time_s,gyro_z\n0,1\n0.5,2\n', [0, 500_000_000])):
        assert read_text(path, text, rate_hz=400.)[0].header_ns.tolist() == stamps
    for rate in (0.0, float('nan')):
        with refused(f'rate_hz must be a number from 1e-30 to 1e+30, not {rate:g}'):
            open_recording(path, rate_hz=rate)


def test_a_table_has_no_topic_to_choose(path):
    assert refusal(path, 'time_s,gyro_x\n0,1\n', topic='/imu') == (
        'no topic /imu; a CSV file has no topics: leave out --topic')


def test_a_file_of_many_blocks_is_read_whole(path):
    count = 60_000
    time = START_NS // 10**9 + np.arange(count) / 1024
    samples = np.random.default_rng(1).normal(size=(count, 6))
    np.savetxt(path, np.column_stack([time, samples]), '%.17g', ',', comments='',
               header=','.join(['time_s', *AXES]))
    assert path.stat().st_size > 4 << 20
    with open_recording(path) as recording:
        positions = []
        blocks = list(read_blocks(recording, 'csv', positions.append))
    assert np.concatenate([block.samples for block in blocks]).tobytes() == samples.tobytes()
    stamps = np.concatenate([block.header_ns for block in blocks])
    assert np.abs(stamps - START_NS - np.arange(count) * 10**9 / 1024).max() < 250
    assert positions == sorted(positions)
    assert positions[-1] == path.stat().st_size


def test_a_table_that_grows_is_read_as_it_was(path):
    text = 'time_s,gyro_x\n' + ''.join(f'{number},{number}\n' for number in range(9000))
    for now, later in ((text, text + '9000,1\n9001,'), (text[:-3], text + '9000,1\n')):
        path.write_text(now)
        with open_recording(path) as recording:
            path.write_text(later)
            [block] = read_blocks(recording, 'csv')
            assert block.samples[:, 0].tolist() == [*range(9000)]
            assert 'malformed_messages' not in {each.code for each in recording.remarks}


@pytest.mark.parametrize(('text', 'stamps', 'values', 'count', 'first'), [
    ('time_s,gyro_x_rad_s\n1,5\nx,6\n3\n4,\nnan,7\n1e300,8\n7,9\n',
     [10**9, 4 * 10**9, 7 * 10**9], [5, np.nan, 9], 4, 'line 3: x,6'),
    ('time_s,gyro_x [rad/s]\n0.0,1\n\n\nnothing,1\n0.1,2\n1e300,3\n0.2,4\n1e300,5\nx\n',
     [0, 10**8, 2 * 10**8], [1, 2, 4], 4, 'line 5: nothing,1'),
    *(('time_s,gyro_x [rad/s],accel_x\n' + f'0.0,{none},{none}\n' * 3 + '0.1,2,3\n0.2,4,5\n',
       [10**8, 2 * 10**8], [2, 4], 3, f'line 2: 0.0,{none},{none}') for none in ('NA', '--'))],
    ids=['empty cell', 'no time', 'NA', 'dashes'])
def test_lines_that_are_no_numbers_are_counted(path, text, stamps, values, count, first):
    messages, [remark] = read_text(path, text)
    assert messages.header_ns.tolist() == stamps
    assert np.array_equal(messages.samples[:, 0], values, equal_nan=True)
    assert remark == said(path, 'malformed_messages', what='line', count=count, first=first,
                          severity='act')


@pytest.mark.parametrize(('header', 'stated', 'assumed'), [
    ('time_s,gyro_x', {}, True), ('time_s,gyro_x', {'gyro_unit': 'rad/s'}, False),
    ('time_s,gyro_x', {'gyro_unit': 'deg/s'}, False), ('time_s,gyro_x [deg/s]', {}, False),
    ('t,w', {'columns': (('time', 't'), ('gyro_x', 'w'))}, False), ('time_s,accel_x', {}, False),
    ('time_s,imu.angular_velocity.x', {}, False), ('time_s,gyro_rad[0]', {}, False)])
def test_a_gyroscope_without_a_unit_is_said_to_be_taken_as_rad_per_s(
        path, header, stated, assumed):
    # In deg/s, a quiet one would pass for a plausible one that is 57 times as noisy.
    _, remarks = read_text(path, f'{header}\n' + '0.01,1\n' * 9,
                           options=RecordingOptions(**stated))
    assert ('unit_assumed' in {remark.code for remark in remarks}) is assumed


def test_an_accelerometer_on_rows_of_its_own_has_no_unit_of_a_gyroscope(path):
    path.write_text('t,gx,ax\n' + ''.join(f'0.{n}0,1,\n0.{n}5,,9.8\n' for n in range(10, 50)))
    for topic, assumed in (('accel columns', False), ('gyro columns', True)):
        with open_recording(path) as recording:
            list(read_blocks(recording, topic))
            codes = {remark.code for remark in recording.remarks}
        assert ('unit_assumed' in codes) is assumed


def table(header, row, mark=','):
    """Return a table of 30 rows, each made of its number and the three values."""
    lines = [mark.join(row(place, map(str, values))) for place, values in enumerate(ROWS.tolist())]
    return '\n'.join([header, *lines, ''])


def plain(place, values):
    return [str(place / 100), *values]


def with_commas(cells):
    return [cell.replace('.', ',') for cell in cells]


FIVE_FIELDS = (
    'the rows have 5 fields, the header names 4, so that none can be recognized by its name; name '
    'every column, the number of the row, too, as R does with col.names=NA')
EIGHT_FIELDS = (
    'the rows have 8 fields, the header names 4, so that none can be recognized by its name; '
    'where that comes of decimal commas, write semicolons between the cells')


@pytest.mark.filterwarnings('error')
@pytest.mark.parametrize(('text', 'reason'), [
    ('gyro_z\n1\n', NO_TIME), ('SampleTimeFine\tGyr_X\n\t1\n\t2\n', NO_TIME),
    ('sep=,\nroll,pitch\n4,5\n', no_axes('roll,pitch')),
    # A table of something else, which is left out of a folder of recordings
    ('Battery level\n98\n97\n', no_axes('Battery,level')),
    ('Temperatures\n0.0,25.1,26\n', no_axes('Temperatures')),
    ('accel_bmi160_fifo_index,gyro_bmi160_hz\n1,2\n',
     no_axes('accel_bmi160_fifo_index,gyro_bmi160_hz')),
    ('gyro_mpu6050_dps_x,gyro_bmi_temp_x,xgyro\n1,2,3\n',
     no_axes('gyro_mpu6050_dps_x,gyro_bmi_temp_x,xgyro')),
    ('\n' * 200 + 'time_s,gyro_x\n0,1\n', no_axes('')),
    *((f'{above}1.7e18,0.1,-0.2,0.3,imu,9.8\n',
       'no line names the 6 columns. Say what they are, such as --columns gyro_x=1,gyro_y=2,'
       'gyro_z=3,accel_x=4,accel_y=5,accel_z=6 if that is their '
       "order, with units as in 'time=1 us,gyro_x=2 deg/s'. Or write a first line such as "
       'time_s,gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z')
      for above in ('', 'Ready.\nDevice with address a0 found\n')),
    *((f'time_s,gyro_x\n{blank}', 'no line of samples below the names of the columns')
      for blank in ('', '\n', ' \n\n')),
    ('time_s,gyro_x\n0,1\n'.encode('utf-16'),
     'text in UTF-16, as a redirection of PowerShell writes it; save it as UTF-8'),
    (b'\x1f\x8b\x08\x00',
     'compressed with gzip or zip; take the recording out of it'),
    ('time_s,gyro_x [m/s^2]\n0,5\n', 'column gyro_x: m/s^2 cannot be turned into rad/s; '
     "--columns gives another unit, as in 'gyro_x=NAME deg/s'"),
    *((f'{header}\n0{",5" * header.count(",")}\n', f'columns {both} are both {meaning}; --columns '
       f'names all those to read, such as {example}') for header, both, meaning, example in (
           ('time_s,imu0_gyro_x,imu1_gyro_x', '2 and 3', 'gyro_x', 'gyro_x=2'),
           ('time_s,accel_x,linear_accel_x,gy', '2 and 3', 'accel_x', 'accel_x=2,gyro_y=4'),
           # One of them is without gravity.
           ('time_s,gyroscope_lsm6ds3_c.z,accelerometer_lsm6ds3_c.x,linear_Acceleration.x',
            '3 and 4', 'accel_x', 'gyro_z=2,accel_x=3'))),
    # A line below the names that holds no units, or fewer.
    ('time,gyro_x,accel_z\nfloat,float,float\n0.5,180,1\n1.0,90,2\n',
     'column gyro_x: float cannot be turned into rad/s; '
     "--columns gives another unit, as in 'gyro_x=NAME deg/s'"),
    ('time,gyro_x,accel_z\ns,deg/s\n0.5,180,1\n1.0,90,2\n', no_axes('s,deg/s')),
    (b'time_s,gyro_x\n0,1\n' + b'1' * 3_000_000,
     'a line ending at byte 2097167 is longer than 1048576 bytes; not a CSV file of samples'),
    ('gyro_x,' * 200_000, 'line 1 is longer than 1 MiB: it is no table of samples'),
    *(('time_s,gyro_x\r' + '0,1\r' * count, 'the lines end with \\r alone, not \\n; replace it '
       "with: tr '\\r' '\\n' < OLD.csv > NEW.csv") for count in (3, 300_000)),
    # What may be something else is not taken.
    *((f'{header}\n' + '1,' * header.count(',') + '1\n', no_axes(header)) for header in (
        't,magX (G),magY (G),magZ (G)', 't,FreeAcc_X (m/s^2),FreeAcc_Y (m/s^2),FreeAcc_Z (m/s^2)',
        't,x,y,z', 't,gyro0,gyro1,gyro2,gyro3')),
    # Rows of more fields than names.
    (table(HEADER, lambda place, values: [str(place + 1), *plain(place, values)]), FIVE_FIELDS),
    (table(HEADER.replace(',', ' '), lambda *row: [*plain(*row), '1'], ' '), FIVE_FIELDS),
    (table(HEADER, lambda *row: with_commas(plain(*row))), EIGHT_FIELDS),
    # No two parts of one time.
    (table(f'seconds,nanoseconds,{GYRO}', lambda place, values: [
        f'{place / 8}', f'{125_000_000 * (place % 8)}', *values]), NO_TIME),
    (table(f'seconds,nanoseconds,{GYRO}', lambda place, values: [
        f'{place // 8}', f'{125_000_000 * place}', *values]), NO_TIME),
])
def test_what_cannot_be_used_is_refused_in_one_line(path, text, reason):
    assert refusal(path, text) == reason


@pytest.mark.parametrize(('header', 'row'), [
    (f'note,{HEADER}', lambda *row: ['"a, b"', *plain(*row)]),
    (HEADER, lambda place, values: [*plain(place, values), *['7'][:place == 3]]),
    (f'note,{HEADER}', lambda place, values: [['"open', ''][place > 0], *plain(place, values)]),
    (HEADER, lambda *row: [cell.replace('-', '\N{MINUS SIGN}') for cell in plain(*row)])],
    ids=['commas in quotes', 'one long row',
         'quote that is not closed', 'minus signs'])
def test_rows_that_are_only_written_unusually_are_read(path, header, row):
    messages, _ = read_text(path, table(header, row))
    assert messages.samples[:, :3].tolist() == ROWS.tolist()


@pytest.mark.parametrize(('before', 'cut', 'end'), [
    # A quote that is not closed, part of a line, more lines of another topic than are looked at.
    ('', 0, '"open'), ('', 17, ''), (',,,,1.5\n' * 10_000, 0, '')],
    ids=['quote', 'part', 'another topic'])
def test_the_digits_and_the_unit_of_times_are_those_of_most_rows(path, before, cut, end):
    head, _, rows = table(f'timestamp,{GYRO},height', lambda place, values: [
        str(START_NS + 1 + place * 10_000_001), *values, '' if place else end]).partition('\n')
    messages, _ = read_text(path, f'{head}\n{before}{rows[cut:]}')
    assert (messages.header_ns - START_NS - 1).tolist()[-29:] == [
        place * 10_000_001 for place in range(1, 30)]


def fields(form):
    """Return the columns of an Imu, named by field and axis."""
    return ','.join(form.format(field, axis) for field in (
        'angular_velocity', 'linear_acceleration') for axis in 'xyz')


@pytest.mark.parametrize(('text', 'stamps'), [
    ('#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],'
     'a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n'
     f'{STAMP},1,2,3,4,5,6\n{STAMP + 1},1,2,3,4,5,6\n', [STAMP, STAMP + 1]),
    (ROSTOPIC + f'{STAMP},7,{STAMP + 5},imu,0,-1,1,2,3,0,4,5,6,0\n', [STAMP]),
    (ECHOED.format(17) + ECHOED.format(18), [5_000_000_017, 5_000_000_018]),
    (f'__time,/gps/fix,{fields("/imu/{}/{}")}\n'
     '1.5,,1,2,3,4,5,6\n1.75,9,,,,,,\n2.5,,1,2,3,4,5,6\n', [1_500_000_000, 2_500_000_000]),
    (f'__time,/cam/header/stamp,/imu/header/stamp,{fields("/imu/{}/{}")},/imu/orientation/x\n'
     '7,,1.5,1,2,3,4,5,6,0\n7,9,,,,,,,,\n8,,2.5,1,2,3,4,5,6,0\n', [7 * 10**9, 8 * 10**9]),
    (f'/imu/header/stamp,__time,{fields("/imu/{}/{}")}\n'
     '0,7,1,2,3,4,5,6\n0,8,1,2,3,4,5,6\n', [7 * 10**9, 8 * 10**9]),
    (f'/imu/raw/header/stamp,{fields("/imu/data/{}/{}")}\n1.5,1,2,3,4,5,6\n', [1_500_000_000]),
    ('timestamp [nsec],gyro_x,gyro_y,gyro_z,accel_x,accel_y,accel_z\n'
     f'"{STAMP}","1","2","3","4","5","6"\n"{STAMP + 5_000_001}","1","2","3","4","5","6"\n',
     [STAMP, STAMP + 5_000_001]),
    ('time;gx;gy;gz;ax;ay;az\n0;1;2;3;4;5;6\n0,01;1,0;2;3;4;5;6\n', [0, 10_000_000]),
    ('stamp,imu.wx,imu.wy,imu.wz,ax,ay,az\n1700000000000000,1,2,3,4,5,6\n',
     [1_700_000_000 * 10**9]),
    ('# timestamp ang_vel_x ang_vel_y ang_vel_z lin_acc_x lin_acc_y lin_acc_z\n'
     '1.5 1 2 3 4 5 6\n', [1_500_000_000]),
    ('t, a_x, a_y, a_z, w_x, w_y, w_z\n1, 4, 5, 6, 1, 2, 3\n', [10**9]),
    ('"Time (s)","Gyroscope x (rad/s)","Gyroscope y (rad/s)","Gyroscope z (rad/s)",'
     '"Acceleration x (m/s^2)","Acceleration y (m/s^2)","Acceleration z (m/s^2)"'
     '\r\n 1.5E0, 1 ,2,3,4,5,6\r\n\r\n', [1_500_000_000]),
    ('# A Logger, device 4\n# gyro_range = 250.0 dps\nt,a_x,a_y,a_z,g_x,g_y,g_z\n1,4,5,6,1,2,3\n',
     [10**9]),
    ('Timestamp,X_acc,Y_acc,Z_acc,pitch,X_gyro,Y_gyro,Z_gyro\n1,4,5,6,0,1,2,3\n', [10**9]),
    ('Time,header.seq,header.stamp.secs,header.stamp.nsecs,header.frame_id,'
     f'{fields("{}.{}")}\n7.5,1,{STAMP // 10**9},{STAMP % 10**9},imu,1,2,3,4,5,6\n', [STAMP]),
    ('loggingTime(txt)|accelerometerTimestamp_sinceReboot(s)|accelerometerAccelerationX(m/s^2)|'
     'accelerometerAccelerationY(m/s^2)|accelerometerAccelerationZ(m/s^2)|'
     'gyroTimestamp_sinceReboot(s)|gyroRotationX(rad/s)|gyroRotationY(rad/s)|gyroRotationZ(rad/s)|'
     'motionUserAccelerationX(m/s^2)|motionUserAccelerationY(m/s^2)|'
     'motionUserAccelerationZ(m/s^2)\n2019-07-10 14:51:07.234 +0900|2.5|4|5|6|2.5|1|2|3|7|8|9\n',
     [2_500_000_000]),
    ('ACCELEROMETER X (m/s²);ACCELEROMETER Y (m/s²);ACCELEROMETER Z (m/s²);GYROSCOPE X (rad/s);'
     'GYROSCOPE Y (rad/s);GYROSCOPE Z (rad/s);MAGNETIC FIELD X (μT);Time since start in ms ;'
     'YYYY-MO-DD HH-MI-SS_SSS\n4;5;6;1;2;3;0;250;2019-07-10 14:51:07:234\n', [250_000_000]),
    *((f'{clock},gx,gy,gz,ax,ay,az\n7,999999,1,2,3,4,5,6\n8,250000,1,2,3,4,5,6\n',
       [7_999_999_000, 8_250_000_000]) for clock in (
           'Unix Time,Microseconds', 'sec,usec', 'time_s,time_us')),
    ('time,seconds,nanoseconds,gx,gy,gz,ax,ay,az\n1.5,0.125,125000000,1,2,3,4,5,6\n'
     '1.5,0.25,250000000,1,2,3,4,5,6\n', [1_500_000_000] * 2),
    ('Booting...\nMPU6050 found, range +-8 g\n"fw","2"\ngx: 250 dps, ax: 8 g\ngain,ax\n'
     'millis,ax,ay,az,gx,gy,gz\n'
     '500,4,5,6,1,2,3\n', [500_000_000]),
    (f'# timestamp[ns] w.x w.y w.z a.x a.y a.z\n{STAMP} 1 2 3 4 5 6\n', [STAMP]),
    ('millis,ax,ay,az,gx,gy,gz\n500,4,5,6,1,2,3\n', [500_000_000]),
    ('ms,ax,ay,az,gx,gy,gz\n500,4,5,6,1,2,3\n', [500_000_000]),
    ('micros,ax,ay,az,gx,gy,gz\n500,4,5,6,1,2,3\n', [500_000]),
    ('"Zeit (s)";"Gyroskop x (rad/s)";"Gyroskop y (rad/s)";"Gyroskop z (rad/s)";'
     '"Beschleunigung x (m/s^2)";"Beschleunigung y (m/s^2)";"Beschleunigung z (m/s^2)"\n'
     '2,5E0;1,0E0;2,0E0;3,0E0;4,0E0;5,0E0;6,0E0\n', [2_500_000_000]),
    ('Tiempo (s),Aceleración X (m/s²),Acelerómetro Y (m/s²),Accélération Z (m/s²),'
     'Giroscopio X (rad/s),Giroscópio Y (rad/s),Gyroscope Z (rad/s)\n2.5,4,5,6,1,2,3\n',
     [2_500_000_000]),
    ('TimeStartup,UncompAccelX,UncompGyroX,Temp,AccelX,AccelY,AccelZ,AngularRateX,AngularRateY,'
     'AngularRateZ\n2500000001,7,8,25,4,5,6,1,2,3\n', [2_500_000_001]),
    ('Time [s],GpsToW,UnCompMagX,UnCompAccX,UnCompAccY,UnCompAccZ,UnCompGyroX,UnCompGyroY,'
     'UnCompGyroZ,Temperature\n2.5,0,0,4,5,6,1,2,3,25\n', [2_500_000_000]),
    ('TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,T\n2500000,0,1,2,3,4,5,6,25\n', [2_500_000_000]),
    ('timestamp,TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,T\n2.5,7,0,1,2,3,4,5,6,25\n',
     [2_500_000_000]),
    ('time_usec,gyro_rad[0],gyro_rad[1],gyro_rad[2],gyro_integral_dt,accelerometer_m_s2[0],'
     'accelerometer_m_s2[1],accelerometer_m_s2[2]\n2500000,1,2,3,5000,4,5,6\n', [2_500_000_000]),
], ids=['euroc', 'rostopic echo -p', 'ros2 topic echo --csv', 'plotjuggler', 'with stamps',
        'with stamps of zero', 'stamp of another topic', 'quotes', 'commas behind whole numbers',
        'omega', 'uzh', 'insane', 'phyphox', 'comments', 'axis first', 'bagpy',
        'sensorlog', 'androsensor', 'advanced navigation', 'timeval', 'two units',
        'time beside two numbers',
        'arduino that starts',
        'tum-vi for dso', 'arduino', 'arduino, short', 'arduino, fast',
        'phyphox in German', 'other languages', 'vectornav',
        'instinct', 'ardupilot', 'mavlogdump', 'px4'])
def test_the_tables_of_other_programs_are_understood(path, text, stamps):
    messages, remarks = read_text(path, text)
    assert messages.header_ns.tolist() == stamps
    assert messages.samples.tolist() == [[1, 2, 3, 4, 5, 6]] * len(stamps)
    # The rest of an Imu is nobody's loss.
    assert not any('orientation' in str(remark.values) for remark in remarks)
    assert 'malformed_messages' not in {remark.code for remark in remarks}


@pytest.mark.parametrize(('header', 'factors'), [
    ('gyro_x [deg/s],gyro_y [deg/s],gyro_z [deg/s],accel_x [g],accel_y [g],accel_z [g]',
     (pi / 180, 9.80665)),
    ('gx_dps,gy_dps,gz_dps,ax_g,ay_g,az_g', (pi / 180, 9.80665)),
    ('w_x (deg/s),w_y (deg/s),w_z (deg/s),Acc X (m/s2),Acc Y (m/s2),Acc Z (m/s2)',
     (pi / 180, 1.0)),
    ('gx [deg/s/131],gy [deg/s/131],gz [deg/s/131],ax [g/2048],ay [g/2048],az [g/2048]',
     (pi / 180 / 131, 9.80665 / 2048)),
    ('LSM6DSOX_GYR_x_dps,LSM6DSOX_GYR_y_dps,LSM6DSOX_GYR_z_dps,Acc. X,Acc. Y,Acc. Z',
     (pi / 180, 1.0)),
    # The axis may come first, or the chip behind the sensor.
    ('X.gyro [dps],Y-gyro [dps],z_gyro [dps],x_accel (g-force),y_accel (G),z_accel (g force)',
     (pi / 180, 9.80665)),
    ('gyro_icm20948_x,gyro_icm20948_y,gyro_icm20948_z,acc_bmi270.x,acc_bmi270.y,acc_bmi270.z',
     (1.0, 1.0)),
    ('Gx[dps],Gy[dps],Gz[dps],Ax[mG],Ay[mG],Az[mG]', (pi / 180, 9.80665e-3)),
    # WitMotion and Betaflight's blackbox_decode
    ('AsX(°/s),AsY(°/s),AsZ(°/s),AccX(g),AccY(g),AccZ(g)', (pi / 180, 9.80665)),
    (' gyroADC[0] (deg/s), gyroADC[1] (deg/s), gyroADC[2] (deg/s), accSmooth[0] (m/s/s),'
     ' accSmooth[1] (m/s/s), accSmooth[2] (m/s/s)', (pi / 180, 1.0)),
    # Blanks are no unit.
    ('gyro_x [],gyro_y [ ],gyro_z,accel_x ( ),accel_y (),accel_z', (1.0, 1.0)),
])
def test_units_stand_in_names_in_many_ways(path, header, factors):
    numbers = ','.join(map(str, range(1, header.count(',') + 2)))
    messages, _ = read_text(path, f'time [ms],{header}\n500,{numbers}\n')
    assert messages.header_ns.tolist() == [500_000_000]
    assert messages.samples[0] == pytest.approx(np.arange(1, 7) * np.repeat(factors, 3), rel=1e-15)


@pytest.mark.parametrize(('names', 'units', 'row'), [
    ('time,status,gyro_x,accel_x', 's,,deg/s,g', '0.5,7,180,2'),
    ('"Time","status","Gyro X","Acc X"', '"[ms]","[]","[deg/s]","[mg]"', '500,7,180,2000'),
    ('# t status gx ax', '# us - mdps m/s2', '500000 7 180000 19.6133'),
    ('"sep=,"\n' + ','.join(f'S_Head_{name}_CAL' for name in (
        'Timestamp_Unix', 'Battery', 'Gyro_X', 'Accel_WR_X')) + ',', 'ms,mV,deg/s,m/(s^2),',
     '500,7,180,19.6133,'),
    # A program of SBG
    ('timestamp\tstatus\tgyroX\taccelX', '(us)\t(na)\t(deg.s^-1)\t(m.s^-2)',
     '500000\t7\t180\t19.6133'),
    ('iso8601Time\tstatus\tgyroX\taccelX', '(yyyy-mm-ddThh:mm:ss.sssZ)\t(na)\t(deg.s^-1)\t(g)',
     '1970-01-01T00:00:00.500Z\t7\t180\t2')],
    ids=['bare', 'in brackets', 'blanks', 'shimmer', 'sbg', 'sbg with dates'])
def test_a_line_below_the_names_may_hold_their_units(path, names, units, row):
    messages, remarks = read_text(path, f'{names}\n{units}\n{row}\n')
    assert messages.header_ns.tolist() == [500_000_000]
    assert messages.samples[0, [0, 3]] == pytest.approx([pi, 2 * 9.80665], rel=1e-12)
    assert [remark.code for remark in remarks] == ['ignored_columns']


def test_counts_of_a_flight_controller_have_no_unit_but_a_stated_one(path):
    header = 'loopIteration, time (us), ' + ', '.join(
        f'{name}[{axis}]' for name in ('gyroADC', 'accSmooth') for axis in range(3))
    assert refusal(path, f'{header}\n0, 500, 1, 2, 3, 4, 5, 6\n') == (
        'column gyroADC[0]: counts cannot be turned into rad/s; --columns gives another unit, as '
        "in 'gyro_x=NAME deg/s'")
    block, _ = read(path, options=RecordingOptions(gyro_unit='deg/s', accel_unit='g/2048'))
    assert block.samples[0] == pytest.approx(
        np.arange(1, 7) * np.repeat([pi / 180, 9.80665 / 2048], 3), rel=1e-15)


@pytest.mark.parametrize('encoding', ['utf-8', 'utf-8-sig', 'latin-1'])
def test_units_with_signs_beyond_ascii_are_read_in_the_usual_encodings(path, encoding):
    path.write_text('t [µs],gyro_x [°/s],accel_x [m/s²]\n500,180,1\n', encoding)
    messages, _ = read(path)
    assert messages.header_ns.tolist() == [500_000]
    assert messages.samples[0, [0, 3]] == pytest.approx([pi, 1.0], rel=1e-15)


@pytest.mark.parametrize(('header', 'times', 'stamps'), [
    ('time,gx', ('2014-06-24T19:02:59.75Z,', '2014-06-24T19:03:00Z,'), SUMMER),
    ('"Timestamp","gx"',
     ('"2014-06-24 21:02:59.750000+02:00",', '2014-06-24T13:33:00-05:30,'), SUMMER),
    ('time;gx', ('2014-06-24 19:02:59,7500000001;', '2014-06-24 19:03:00;0,'), SUMMER),
    ('time_s,gx', ('2014-06-24 19:02:59.75,', '2014-06-24 19:03:00,'), SUMMER),
    # A time of day beside a time that is a number, or a date as WitMotion writes it.
    ('time,timestamp_ns,gx',
     ('7:02:59,1403636579750000000,', '7:03:00,1403636580000000000,'), SUMMER),
    ('Time,Chip Time(),gx',
     (' 7:02:59.75, 2014-6-24 19:02:59:750,', ' 7:03:00.00, 2014-6-24 19:03:00:000,'), SUMMER),
    ('time,gx', ('2014/06/24 19:02:59.75,', '2014/6/24 19:03:00,'), SUMMER),
    # As pandas names an index.
    (',gx', ('2014-06-24 19:02:59.75,', '2014-06-24 19:03:00,'), SUMMER),
    # A logger without a battery.
    ('time,gx', ('1970-01-01T01:59:59.99+02:00,', '1970-01-01T02:00:00.00+02:00,'),
     [-10_000_000, 0])])
def test_times_that_are_written_as_dates_are_read(path, header, times, stamps):
    block, _ = read_text(path, f'{header}\n{times[0]}1\n{times[1]}2\n2014-06-31T00:00:00Z,3\n')
    assert block.header_ns.tolist() == stamps


@pytest.mark.parametrize('options', [{}, {'rate_hz': 100.0}])
def test_times_of_another_form_are_no_numbers_and_reported(path, options):
    text = 'time,gx\n19h02m59.75,1\n19h02m59.76,2\n'
    assert refusal(path, text, **options) == (
        'line 2: 19h02m59.75,1 lacks a number in a column that is read. A column that '
        'holds none can be left out: --columns names the others, and --rate takes the place of '
        'the time. A time is a number or like 2024-06-24 19:02:59.75')
    block, _ = read(path, options=replace(named(gyro_x='gx'), rate_hz=100.0))
    assert block.header_ns.tolist() == [0, 10_000_000]


def test_a_column_that_is_not_read_is_not_said_to_name_no_axis(path):
    _, [remark] = read_text(path, 'time_s,Rate X,ax\n1,2,3\n2,3,4\n',
                            options=named(gyro_x='Rate X deg/s'))
    assert sentence_of(remark).endswith(': columns not read: ax')
    assert advice(remark).endswith('it has to name all axes that shall be read')


@pytest.mark.parametrize(('text', 'columns', 'seconds', 'samples'), [
    ('when,w0,w1,other,up [g]\n2,180,90,7,1\n',
     {'time': 'when', 'gyro_x': 'w0 deg/s', 'gyro_y': 'w1 deg/s', 'accel_z': 'up'},
     [2], {0: [pi], 1: [pi / 2], 5: [9.80665]}),
    *((text, LOGGED, [2.5, 3.5], {2: [pi / 2, pi], 3: [9.80665, 19.6133]}) for text in (
        '2500 imu 90 1\n3500 imu 180 2\n',
        *(f'{above}2500,imu,90,1\n3500,imu,180,2\n' for above in (
            'a,b,c,d\n', 'Device,A\na,b,c,d\n', 'Device found\n')))),
    *((text, {'gyro_x': 'w0', 'time': 'time'}, [1, 2], {0: [2, 3]}) for text in (
        '# time w0 w1\n1 2 3\n2 3 4\n', 'time w0 w1 note\n1 2 3\n2 3 4\n',
        '// a logger\n// time,w0,w1\n1,2,3\n2,3,4\n')),
    # Without names the first sample is none of them.
    ('\ufeff0;1,5\n0,1;1,6\n', {'time': '1', 'gyro_x': '2'}, [0, 0.1], {0: [1.5, 1.6]}),
], ids=['names', 'blanks', 'numbers of named columns', 'below a device',
        'below a message', 'comment and blanks', 'a column without cells', 'two comments',
        'mark and decimal commas'])
def test_columns_of_any_name_can_be_named_or_numbered(path, text, columns, seconds, samples):
    messages, remarks = read_text(path, text, options=named(**columns))
    if 'other' in text:
        assert remarks == [ignored(path, ['other'])]
    assert messages.header_ns.tolist() == [round(second * 1e9) for second in seconds]
    for axis, values in enumerate(messages.samples.T):
        assert values == pytest.approx(
            samples.get(axis, [np.nan] * len(seconds)), rel=1e-15, nan_ok=True)


@pytest.mark.parametrize(('first', 'step', 'hz', 'unit'), [
    (50, 10, '0.1', 's'), (25_000_000, 5_000_000, '2e-07', 's'),
    # Counters since boot are no time of this century.
    (108_000_000_000, 10_000, '0.1', 'ms')])
def test_whole_times_without_a_unit_are_not_taken_for_seconds(path, first, step, hz, unit):
    rows = [f'{first + row * step},{row}' for row in range(200)]
    text = '\n'.join(['timestamp,gx', *rows, ''])
    assert refusal(path, text) == (
        f'the times are {step} apart, which in {unit} would be {hz} Hz, the rate of no IMU. Say '
        "what they are, such as --columns 'time=timestamp ms' (or s, us, ns, min, s/10000), or "
        'give the sample rate with --rate')
    for options, nanoseconds in ((RecordingOptions(rate_hz=50.0), 20_000_000),
                                 (named(time='timestamp us'), step * 1000)):
        block, _ = read(path, options=options)
        assert (np.diff(block.header_ns) == nanoseconds).all()
        assert block.samples[:, 0].tolist() == list(range(200))


def test_ticks_of_windows_are_not_taken_for_nanoseconds(path):
    first = 638_500_000_000_000_000
    text = 'timestamp,gx\n' + ''.join(f'{first + row * 100_000},0.5\n' for row in range(200))
    assert refusal(path, text) == (
        'the times may be nanoseconds before 2001, or the ticks of 100 ns of Windows. For '
        "nanoseconds give --columns 'time=timestamp ns', for ticks the sample rate with --rate")
    for options, nanoseconds in ((RecordingOptions(rate_hz=100.0), 10_000_000),
                                 (named(time='timestamp ns'), 100_000)):
        block, _ = read(path, options=options)
        assert (np.diff(block.header_ns) == nanoseconds).all()


def test_numbers_of_rows_are_not_said_to_be_milliseconds(path):
    text = 'time,gx\n' + ''.join(f'{row},0.5\n' for row in range(200))
    assert refusal(path, text) == (
        'the times are 1 apart, as the numbers of rows are. Give the sample rate with --rate, or '
        "the unit of times with --columns 'time=time ms'")
    block, _ = read(path, rate_hz=50.0)
    assert (np.diff(block.header_ns) == 20_000_000).all()


@pytest.mark.parametrize('seconds', [
    np.arange(200) / 5.01, np.arange(200) / 19_900,
    np.arange(200) // 2 / 40 + np.arange(200) % 2 * 1e-6,
    np.arange(200) / 100 + 3600 * (np.arange(200) >= 30),
    np.arange(200) / 100 - 1e9 * (np.arange(200) >= 30),
    np.arange(200) // 100, 1.7e9 + np.arange(200) / 100],
    ids=['slow', 'fast', 'pairs', 'outage', 'set back', 'whole seconds', 'epoch'])
def test_seconds_without_a_unit_are_taken_for_them(path, seconds):
    rows = [f'{second:.9f},{row}' for row, second in enumerate(seconds)]
    block, _ = read_text(path, '\n'.join(['time,gx', *rows, '']))
    np.testing.assert_allclose(block.header_ns / 1e9, seconds, rtol=0, atol=1e-6)


@pytest.mark.parametrize(('columns', 'reason'), [
    ({'gyro_x': '5'}, f'--columns: no column 5; {THERE}'),
    ({'gyro_x': 'w9'}, f'--columns: no column w9; {THERE}'),
    ({'roll': 'w0'}, '--columns roll: not time or one of gyro_x, gyro_y, gyro_z, accel_x, '
                     'accel_y, accel_z'),
    ({'gyro_x': 'w0', 'gyro_y': 'w0'}, '--columns: column w0 is named twice'),
    ({'gyro_x': 'w0', 'time': 'gx_dps'}, 'column gx_dps: deg/s cannot be turned into s; '
     "--columns gives another unit, as in 'time=NAME ms'")])
def test_a_column_that_is_not_there_or_something_else_is_refused(path, columns, reason):
    assert refusal(path, 'time_s,time_ms,gx_dps,w0' + '\n0.01,10,1,2' * 9,
                   options=named(**columns)) == reason


def test_a_table_of_all_topics_of_a_robot_takes_no_time(path):
    # Each name was compared with all others: 100 s.
    names = [f'/robot/joint_{number}/pos/{axis}' for number in range(10_000) for axis in 'xyz']
    begin = time.process_time()
    messages, [remark] = read_text(path, f'{",".join(["t", *names, "gy_rad_s"])}\n'
                                         f'{",".join(["1", *["0"] * len(names), "3"])}\n')
    assert time.process_time() - begin < 5
    assert messages.samples[0, 1] == 3
    assert remark == ignored(path, names[:10], count=len(names))
