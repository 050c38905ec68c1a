# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""ArduPilot logs, which pymavlink writes, and reads along."""

from struct import calcsize
import sys

from bags import read, said
from imu_allan import analyze
from imu_allan.recordings import open_recording
import numpy as np
from processes import run
import pytest
from whole_lines import refused

DFReader = pytest.importorskip('pymavlink.DFReader')

NOISE = np.random.default_rng(3)
FORMATS = {
    'IMU': (131, 'QBffffffIIfBBHH',
            'TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz'),
    'GYR': (132, 'QBQfff', 'TimeUS,I,SampleUS,GyrX,GyrY,GyrZ'),
    'ACC': (133, 'QBQfff', 'TimeUS,I,SampleUS,AccX,AccY,AccZ'),
    'IMU2': (136, 'QffffffIIfBBHH', 'TimeUS,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz')}


def write(path, messages):
    """Write a log with pymavlink: the formats, then the messages in their order."""
    known = {name: DFReader.DFFormat(number, name, 0, form, columns)
             for name, (number, form, columns) in FORMATS.items()}
    known['FMT'] = DFReader.DFFormat(128, 'FMT', 89, 'BBnNZ', 'Type,Length,Name,Format,Columns')
    described = [('FMT', (form.type, 3 + calcsize(form.msg_struct), name, form.format,
                          ','.join(form.columns))) for name, form in known.items()]
    path.write_bytes(b''.join(
        DFReader.DFMessage(known[name], list(values), False, None).get_msgbuf()
        for name, values in [*described, *messages]))
    return path


def imu(count=300, step_us=2500, number=0):
    samples = np.sin(np.arange(count)[:, None] * np.arange(1, 7) + number).astype(np.float32)
    return [('IMU', (1000 + n * step_us, number, *samples[n], 0, 0, 41.5, 1, 1, 400, 400))
            for n in range(count)]


def raw(name, step_us, count, sigma):
    samples = NOISE.normal(0, sigma, (count, 3))
    return [(name, (7 + n * step_us, 0, n * step_us + 5, *samples[n])) for n in range(count)]


def test_every_bit_is_what_pymavlink_reads(tmp_path):
    path = write(tmp_path / 'a.bin', [
        *(m for pair in zip(imu(), imu(number=1), strict=True) for m in pair),
        *raw('GYR', 1000, 300, 0.01)])
    for topic, number, fields in (
            ('IMU', 1, ('TimeUS', 'GyrX', 'GyrY', 'GyrZ', 'AccX', 'AccY', 'AccZ')),
            ('GYR', 0, ('SampleUS', 'GyrX', 'GyrY', 'GyrZ'))):
        log = DFReader.DFReader_binary(str(path))
        expected = [[getattr(m, name) for name in fields] for m in iter(
            lambda log=log, topic=topic: log.recv_match(type=topic), None) if number == m.I]
        log.close()
        messages, remarks = read(path, f'{topic}.1' if number else topic)
        assert remarks == [said(path, 'filtered')][:number]
        assert len(expected) == 300
        assert messages.header_ns.tolist() == [row[0] * 1000 for row in expected]
        assert messages.samples[:, :len(fields) - 1].tolist() == [row[1:] for row in expected]


def test_an_old_log_has_a_message_for_the_second_imu(tmp_path):
    second = [('IMU2', (values[0], *values[2:])) for _, values in imu(number=1)]
    path = write(tmp_path / 'a.bin', imu() + second)
    with open_recording(path) as recording:
        assert [topic.name for topic in recording.topics] == ['IMU', 'IMU.1']
    assert read(path, 'IMU.1')[0].samples[:, 3].tolist() == [values[4] for _, values in second]


def test_raw_samples_are_preferred_and_have_the_temperature_of_their_imu(tmp_path):
    path = write(tmp_path / 'a.bin', imu() + raw('GYR', 1000, 900, 0.01) + raw(
        'ACC', 500, 1800, 0.1))
    result = analyze(path)
    assert result.source.topic == 'GYR, ACC'
    [chosen] = [remark for remark in result.warnings if remark.code == 'chosen_topic']
    assert chosen == said(path, 'chosen_topic', topics=3, chosen=['GYR', 'ACC'], others=['IMU'],
                          reason=chosen.values['reason'])
    assert {*result.temperature.mean} == {41.5}
    assert [one.values for one in result.warnings if one.code == 'thermometer'] == [
        {'fault': 'constant'}]
    assert [result.axes[f'{name}_x'].sample_rate_hz for name in ('gyro', 'accel')
            ] == pytest.approx([1000, 2000])
    assert read(path, 'GYR')[0].header_ns[:2].tolist() == [5000, 1_005_000]


def test_the_library_goes_through_a_log_once(tmp_path, monkeypatch):
    path, passes = write(tmp_path / 'a.bin', raw('GYR', 1000, 900, 0.01) + raw(
        'ACC', 500, 1800, 0.1)), []

    class Counted(DFReader.DFReader_binary):
        def __init__(self, *given):
            passes.append(given)
            super().__init__(*given)

    monkeypatch.setattr(DFReader, 'DFReader_binary', Counted)
    analyze(path)
    assert len(passes) == 1


@pytest.mark.parametrize(('field', 'kind'), [(b'Q', b'f'), (b'T', b'n')])
def test_a_log_without_a_temperature_or_with_one_in_words_has_none(tmp_path, field, kind):
    path = write(tmp_path / 'a.bin', imu())
    path.write_bytes(path.read_bytes().replace(b'EA,T,', b'EA,' + field + b',').replace(
        b'QBffffffIIf', b'QBffffffII' + kind))
    with open_recording(path) as recording:
        assert [topic.name for topic in recording.topics] == ['IMU']
        assert recording.thermometers == []


def test_a_thin_log_says_what_to_set(tmp_path, fails_with):
    path = write(tmp_path / 'a.bin', imu(step_us=100_000))
    fails_with(f'{path}: no topic of type sensor_msgs/msg/Imu; it holds IMU (ArduPilot IMU); 10 '
               'Hz are too thin; set LOG_BITMASK (IMU_RAW) or INS_RAW_LOG_OPT in the autopilot '
               'for raw samples at the full rate', 'analyze', path)


def test_without_pymavlink_the_package_is_named(tmp_path, monkeypatch):
    path = write(tmp_path / 'a.bin', imu())
    monkeypatch.setitem(sys.modules, 'pymavlink.DFReader', None)
    with refused(
            f'{path}: ArduPilot logs need the package pymavlink; '
            "pip install 'imu_allan[ardupilot]'"):
        open_recording(path)


def test_damage_is_quiet(tmp_path):
    path = write(tmp_path / 'a.bin', imu())
    path.write_bytes(path.read_bytes()[:5000] + bytes(3000) + path.read_bytes()[5000:])
    status, shown, err = run('info', path)
    assert (status, err) == (0, '')
    assert '  read as     ArduPilot IMU, its fields GyrX and AccX' in shown.splitlines()


@pytest.mark.parametrize(('given', 'reason'), [
    ('TimeUS,I,GyrX,GyrY,GyrZ,AccX',
     'ArduPilot IMU has no field AccY in the definition that comes with it; name the fields with '
     '--gyro and --accel'),
    ('TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ',
     '51 bytes are not a message of type ArduPilot IMU, which takes 33')])
def test_a_message_of_another_format_is_reported_with_the_reason(tmp_path, given, reason):
    path = write(tmp_path / 'a.bin', imu())
    path.write_bytes(path.read_bytes().replace(
        FORMATS['IMU'][2].encode().ljust(64, b'\0'), given.encode().ljust(64, b'\0')))
    with open_recording(path) as recording:
        assert (recording.topics, recording.reasons['IMU']) == ([], reason)
