# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from collections.abc import Iterator
import contextlib
import json
import os
from pathlib import Path
import pty
import signal
import socket
import subprocess
import sys
import threading
import time

import imu_allan
from imu_allan.analysis import analyze as analyze_recording
from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu
from imu_allan.cli import analyze, dask_cluster, workers
from imu_allan.cli.main import main
from imu_allan.errors import ImuAllanError
from imu_allan.recordings.write import write_recording
from imu_allan.sensor.noise_model import NoiseModel
from imu_allan.sensor.simulated_imu import simulated_blocks
from imu_allan.writers.filters import export
from mcap.writer import Writer
import numpy as np
import pytest
from repeated import slow
from whole_lines import Varying
import yaml

RATE_HZ = 100.0
SAMPLES = 30_000
START_NS = 1_700_000_000 * 10**9

COMMAND = [sys.executable, '-m', 'imu_allan', 'analyze']


def test_table_goes_to_stdout_and_nothing_to_stderr(
        imu_recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['analyze', str(imu_recording)]) == 0
    shown = capsys.readouterr()
    assert shown.err == ''
    assert '30,000 samples at 100 Hz, 5 min' in shown.out.splitlines()
    assert 'angle random walk' in shown.out
    assert 'velocity random walk' in shown.out
    assert shown.out.splitlines()[-1] == (
        'Nothing is saved: --output DIR keeps result, report, plot and curve.')


def test_what_is_saved_is_not_said_to_be_lost(
        recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for options in (['--json', str(tmp_path / 'r.json')], ['--for', 'kalibr'],
                    ['--output', str(tmp_path / 'out')]):
        assert main(['analyze', str(recording), *options]) == 0
        assert 'Nothing is saved' not in capsys.readouterr().out


def test_json_holds_exactly_what_python_returns(
        recording: Path, tmp_path: Path) -> None:
    assert main(['analyze', str(recording), '--json', str(tmp_path / 'r.json')]) == 0
    written = json.loads((tmp_path / 'r.json').read_text())
    assert written == imu_allan.analyze(recording).to_dict()
    assert written['schema'] == 'imu_allan.result/1'


@pytest.mark.parametrize(('step', 'flaw'), [(0.0, 'constant'), (-0.01, 'out of order')])
def test_a_table_whose_times_do_not_go_on_is_told_of_its_times(
        tmp_path: Path, capsys: pytest.CaptureFixture[str], step: float, flaw: str) -> None:
    rows = ['time_s,gyro_x,gyro_y,gyro_z', *(
        f'{1000 + step * place:.2f},{place % 7},{place % 5},{place % 3}' for place in range(2000))]
    (tmp_path / 'imu.csv').write_text('\n'.join(rows))
    assert main(['analyze', str(tmp_path / 'imu.csv')]) == 1
    assert capsys.readouterr().err == (
        f'imu_allan: {tmp_path}/imu.csv: the times of the samples are {flaw}: mend them, or state '
        'the sample rate (analyze --rate)\n')


def test_output_folder_holds_result_curve_plot_and_report(
        recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / 'with' / 'parents'
    assert main(['analyze', str(recording), '--output', str(output)]) == 0
    # The last line says where to look.
    where, names = capsys.readouterr().out.splitlines()[-1].rsplit(': ', 1)
    assert where == f'Written to {output}'
    assert set(names.split(', ')) == {path.name for path in output.iterdir()}
    assert sorted(path.name for path in output.iterdir()) == [
        'allan_deviation.png', 'curve.csv', 'report.html', 'result.json']
    assert (output / 'allan_deviation.png').read_bytes().startswith(b'\x89PNG')


def test_a_configuration_comes_in_the_same_command_alone_on_stdout(
        imu_recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['analyze', str(imu_recording), '--for', 'kalibr']) == 0
    shown = capsys.readouterr()
    assert set(yaml.safe_load(shown.out)) == {
        'accelerometer_noise_density', 'accelerometer_random_walk', 'gyroscope_noise_density',
        'gyroscope_random_walk', 'rostopic', 'update_rate'}
    assert 'angle random walk' in shown.err


def test_configurations_go_into_the_folder_where_there_is_one(
        recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['analyze', str(recording), '--for', 'kalibr', '--for', 'px4',
                 '--output', str(tmp_path)]) == 0
    assert {'imu.yaml', 'px4_imu.params'} <= {path.name for path in tmp_path.iterdir()}
    shown = capsys.readouterr()
    assert shown.err == ''
    assert 'angle random walk' in shown.out


def test_one_configuration_of_several_recordings_is_wrong_usage(
        recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(['analyze', str(recording), str(recording), '--for', 'kalibr'])
    assert end.value.code == 2
    assert capsys.readouterr().err.splitlines()[-1] == (
        'imu_allan analyze: error: --for takes one recording; use --output DIR for several')


def test_the_table_may_be_in_si_units(
        recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['analyze', str(recording), '--units', 'si']) == 0
    shown = capsys.readouterr().out
    assert 'rad/s/sqrt(Hz)' in shown
    assert 'deg/h' not in shown


def test_several_recordings_get_folders_of_their_own_and_lines_in_order(
        recording: Path, tmp_path: Path, model: NoiseModel,
        capsys: pytest.CaptureFixture[str]) -> None:
    other = write_recording(tmp_path / 'b' / 'at_rest', simulated_blocks(model, 50.0, 5000))
    assert main(['analyze', str(recording), str(other), '--output', str(tmp_path / 'out')]) == 0
    shown = capsys.readouterr().out
    lines = shown.splitlines()
    assert [line.partition(', ')[0] for line in lines[:2]] == ['at_rest: 5 min',
                                                               'at_rest-2: 100 s']
    rates = {folder.name: json.loads((folder / 'result.json').read_text())['timeline'][
        'sample_rate_hz'] for folder in (tmp_path / 'out').iterdir() if folder.is_dir()}
    assert rates == {'at_rest': pytest.approx(100), 'at_rest-2': pytest.approx(50)}


def test_one_bad_recording_does_not_keep_the_others_from_being_analyzed(
        recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['analyze', 'no/such', str(recording), 'nor/this']) == 1
    shown = capsys.readouterr()
    assert shown.out.startswith('at_rest: 5 min, gyro N ')
    assert shown.err == ('imu_allan: no/such: no such file or directory\n'
                         'imu_allan: nor/this: no such file or directory\n')


@pytest.fixture
def two_topics(tmp_path: Path, model: NoiseModel) -> Path:
    """Two recordings of one topic each, merged into a split one by hand."""
    from imu_allan.cdr import encode_imu_rows
    from rosbags.rosbag2 import StoragePlugin, Writer
    from rosbags.typesys import get_typestore, Stores

    store = get_typestore(Stores.ROS2_JAZZY)
    path = tmp_path / 'two'
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic, rate in (('/front/imu', 100.0), ('/../up', 50.0)):
            connection = writer.add_connection(topic, 'sensor_msgs/msg/Imu', typestore=store)
            for block in simulated_blocks(model, rate, 3000, start_ns=START_NS):
                for stamp, row in zip(block.receive_ns, encode_imu_rows(block), strict=True):
                    writer.write(connection, int(stamp), row.tobytes())
    return path


def test_several_topics_are_named_and_the_user_chooses(
        two_topics: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['analyze', str(two_topics)]) == 1
    assert capsys.readouterr().err == (
        f'imu_allan: {two_topics}: 2 Imu topics; choose one with --topic: /../up (3,000 '
        'messages), /front/imu (3,000 messages)\n')
    assert main(['analyze', str(two_topics), '--topic', '/front/imu']) == 0
    assert '3,000 samples at 100 Hz, 30 s' in capsys.readouterr().out.splitlines()


def test_all_topics_are_analyzed_and_no_topic_name_leads_out_of_the_output_folder(
        two_topics: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / 'deep' / 'output'
    assert main(['analyze', str(two_topics), '--all-topics', '--output', str(output)]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert '3,000 samples at 100 Hz, 30 s' in shown
    assert '3,000 samples at 50 Hz, 60 s' in shown
    assert sorted(path.suffix for path in output.iterdir() if path.is_file()) == [
        '.csv', '.html', '.json']
    assert len([path for path in output.iterdir() if path.is_dir()]) == 2
    assert list((tmp_path / 'deep').iterdir()) == [output]


@pytest.mark.parametrize('more', [slow([]), ['--jobs', '2', '--start', 'auto']])
def test_of_all_topics_each_result_is_that_of_the_topic_alone(
        two_topics: Path, tmp_path: Path, more: list[str]) -> None:
    assert main(['analyze', str(two_topics), '--all-topics', '--output', str(tmp_path),
                 *more]) == 0
    for topic in ('/../up', '/front/imu'):
        folder = tmp_path / f'two_{topic[1:].replace("/", "_")}'
        alone = imu_allan.analyze(str(two_topics), topic, start_s='auto' if more else 0.0)
        assert json.loads((folder / 'result.json').read_text()) == alone.to_dict()


def test_of_all_topics_the_one_without_a_coefficient_is_named(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with (tmp_path / 'a.mcap').open('wb') as file:
        writer = Writer(file)
        writer.start('ros2')
        schema = writer.register_schema('sensor_msgs/msg/Imu', 'ros2msg', b'')
        for topic in ('/imu', '/short'):
            channel = writer.register_channel(topic, 'cdr', schema)
            for number in range(3000 if topic == '/imu' else 20):
                stamp = START_NS + number * 10**7
                writer.add_message(channel, stamp, encode_imu(
                    stamp, np.random.default_rng(number).normal(size=6), 'imu'), stamp)
        writer.finish()
    assert main(['analyze', str(tmp_path / 'a.mcap'), '--all-topics']) == 1
    assert capsys.readouterr().err == (
        f'imu_allan: {tmp_path / "a.mcap"}, topic /short: no coefficient: 20 samples are too few; '
        'record for longer\n')


def test_of_thousands_of_topics_without_a_message_some_are_named_and_the_rest_counted(
        tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with (tmp_path / 'a.mcap').open('wb') as file:
        writer = Writer(file)
        writer.start('ros2')
        schema = writer.register_schema('sensor_msgs/msg/Imu', 'ros2msg', b'')
        for number in range(2000):
            channel = writer.register_channel(f'/imu_{number}', 'cdr', schema)
        writer.add_message(channel, START_NS, b'none', START_NS)
        writer.finish()
    assert main(['analyze', str(tmp_path / 'a.mcap'), '--all-topics']) == 1
    path = tmp_path / 'a.mcap'
    assert capsys.readouterr().err.splitlines() == [
        *(f'imu_allan: {path}: topic /imu_{number} has no messages; record it while the IMU '
          'driver runs' for number in range(100)),
        'imu_allan: 1,899 more like these, the last of all is:',
        f'imu_allan: {path}: topic /imu_1999 holds no readable message; --topic names another']


def test_all_topics_do_not_fit_into_one_json_file(
        two_topics: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['analyze', str(two_topics), '--all-topics',
                 '--json', str(tmp_path / 'r.json')]) == 1
    assert capsys.readouterr().err == (
        f'imu_allan: {two_topics}: has 2 Imu topics, too many for --json; choose one with --topic '
        'or use --output DIR\n')
    assert not (tmp_path / 'r.json').exists()


def test_start_and_duration_choose_a_part(recording: Path, tmp_path: Path) -> None:
    assert main(['analyze', str(recording), '--start', '1min', '--duration', '100',
                 '--json', str(tmp_path / 'r.json')]) == 0
    result = json.loads((tmp_path / 'r.json').read_text())
    assert result['timeline']['samples'] == 100 * RATE_HZ
    assert result['source']['start_time'].startswith('2023-11-14T22:14:20')


def test_a_part_beyond_the_end_says_how_long_the_recording_is(
        recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['analyze', str(recording), '--start', '2h']) == 1
    assert capsys.readouterr().err == (f'imu_allan: {recording}: lasts 5 min: --start 2 h leaves '
                                       'nothing of it\n')
    assert main(['analyze', str(recording), '--start', '3min', '--duration', '5min',
                 '--verbose']) == 0
    assert ('only 2 min of the 5 min asked for are recorded'
            in ' '.join(capsys.readouterr().out.split()))
    assert main(['analyze', str(recording), '--duration', '5min']) == 0
    assert 'asked for' not in capsys.readouterr().out


def test_a_stated_rate_that_contradicts_the_stamps_must_be_forced(
        recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = ['analyze', str(recording), '--rate', '200', '--json', str(tmp_path / 'r.json')]
    assert main(wrong) == 1
    assert capsys.readouterr().err == (
        f'imu_allan: {recording}, topic /imu/data_raw: the stated rate is 200 Hz, but the header '
        'stamps advance at 100 Hz: leave out the rate, choose the other clock (analyze --clock), '
        'or force the stated rate (analyze --clock none)\n')
    assert main([*wrong, '--clock', 'none']) == 0
    # The word before that.
    assert main([*wrong, '--force-rate']) == 0
    assert json.loads((tmp_path / 'r.json').read_text())['timeline']['sample_rate_hz'] == 200


def test_clock_can_be_chosen(recording: Path, tmp_path: Path) -> None:
    assert main(['analyze', str(recording), '--clock', 'receive',
                 '--json', str(tmp_path / 'r.json')]) == 0
    assert json.loads((tmp_path / 'r.json').read_text())['source']['clock'] == 'receive'


def shaken(model: NoiseModel) -> Iterator[ImuBlock]:
    for block in simulated_blocks(model, RATE_HZ, SAMPLES, start_ns=START_NS,
                                  block_samples=SAMPLES):
        block.samples[12_000:12_500] += np.sin(np.arange(500))[:, None]
        yield block


def test_motion_can_be_kept(tmp_path: Path, model: NoiseModel) -> None:
    path = write_recording(tmp_path / 'shaken', shaken(model))
    density = {}
    for choice in ('exclude', 'keep'):
        assert main(['analyze', str(path), '--motion', choice,
                     '--json', str(tmp_path / 'r.json')]) == 0
        result = json.loads((tmp_path / 'r.json').read_text())
        density[choice] = result['axes']['gyro_x']['curve']['adev'][0]
        assert bool(result['timeline']['motion']) == (choice == 'exclude')
    assert density['keep'] > 2 * density['exclude']


def test_jobs_give_the_same_results_in_the_same_order(
        recording: Path, tmp_path: Path, model: NoiseModel,
        capsys: pytest.CaptureFixture[str]) -> None:
    other = write_recording(tmp_path / 'other', simulated_blocks(model, 50.0, 5000))
    shown = []
    for options in ((), ('--jobs', '2')):
        assert main(['analyze', str(recording), str(other), *options]) == 0
        shown.append(capsys.readouterr().out)
    assert shown[0] == shown[1]


def test_an_error_in_a_worker_is_one_line_too(
        recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(['analyze', str(recording), str(recording), '--topic', '/nowhere',
                 '--jobs', '2']) == 1
    assert capsys.readouterr().err == 2 * (
        f'imu_allan: {recording}: no topic /nowhere; its Imu topics are /imu/data_raw (30,000 '
        'messages)\n')


@pytest.mark.slow
def test_a_dask_cluster_gives_the_same_results(
        recording: Path, tmp_path: Path) -> None:
    distributed = pytest.importorskip('distributed')
    assert main(['analyze', str(recording), '--json', str(tmp_path / 'here.json')]) == 0
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1,
                                  dashboard_address=None) as cluster:
        assert main(['analyze', str(recording), '--json', str(tmp_path / 'there.json'),
                     '--dask', cluster.scheduler_address]) == 0
    assert (tmp_path / 'here.json').read_bytes() == (tmp_path / 'there.json').read_bytes()


def test_a_dask_address_where_somebody_is_silent_is_one_line(
        recording: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
        ) -> None:
    pytest.importorskip('distributed')
    monkeypatch.setattr(dask_cluster, 'ANSWER_S', 0.5)
    with socket.create_server(('127.0.0.1', 0)) as silent:
        address = f'tcp://127.0.0.1:{silent.getsockname()[1]}'
        assert main(['analyze', str(recording), '--dask', address]) == 1
    assert capsys.readouterr().err == (
        f'imu_allan: --dask {address}: what listens there does not answer as a scheduler; start '
        'one with: dask scheduler\n')


def test_a_dask_address_where_garbage_is_sent_is_one_line(recording: Path) -> None:
    pytest.importorskip('distributed')

    def send(server: socket.socket) -> None:
        with contextlib.suppress(OSError):
            while True:
                peer, _ = server.accept()
                with peer:
                    # As the library counts: one frame, of 2^56 bytes.
                    peer.sendall((24).to_bytes(8, 'little') + (1).to_bytes(8, 'little')
                                 + (1 << 56).to_bytes(8, 'little') * 2)

    with socket.create_server(('127.0.0.1', 0)) as server:
        threading.Thread(target=send, args=(server,), daemon=True).start()
        address = f'tcp://127.0.0.1:{server.getsockname()[1]}'
        ended = subprocess.run([sys.executable, '-m', 'imu_allan', 'analyze', str(recording),
                                '--dask', address], capture_output=True, text=True)
    assert ended.returncode == 1
    assert ended.stderr == Varying(
        f'imu_allan: --dask {address}: what listens there is no scheduler (<words>); start one '
        'with: dask scheduler\n')


def test_a_dask_address_where_nobody_answers_is_one_line(
        recording: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip('distributed')
    assert main(['analyze', str(recording), '--dask', 'not an address']) == 1
    assert capsys.readouterr().err == Varying(
        'imu_allan: --dask not an address: no scheduler answers (<words>); start one with: dask '
        'scheduler\n')


def on_a_terminal(arguments: list[str]) -> bytes:
    """Return what the command writes to a stderr that is a terminal."""
    master, slave = pty.openpty()
    with subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=slave,
                          env={**os.environ, 'TERM': 'xterm'}) as process:
        os.close(slave)
        seen = b''
        while True:
            try:
                piece = os.read(master, 65536)
            except OSError:
                break
            if not piece:
                break
            seen += piece
    os.close(master)
    assert process.returncode == 0
    return seen


def test_progress_is_shown_on_a_terminal_only_and_can_be_switched_off(recording: Path) -> None:
    assert b'100%' in on_a_terminal([*COMMAND, str(recording)])
    assert on_a_terminal([*COMMAND, str(recording), '--no-progress']) == b''


def processes_of_group(group: int) -> list[str]:
    """Names of the living processes of a process group."""
    names = []
    for status in Path('/proc').glob('[0-9]*/stat'):
        with contextlib.suppress(OSError):
            name, fields = status.read_text().rsplit(')', 1)
            state, _, process_group = fields.split()[:3]
            if int(process_group) == group and state != 'Z':
                names.append(name)
    return names


@pytest.mark.parametrize('jobs', ['1', '2'])
def test_ctrl_c_ends_every_process_and_leaves_no_file(
        tmp_path: Path, model: NoiseModel, jobs: str) -> None:
    long = write_recording(tmp_path / 'long', simulated_blocks(model, 1000.0, 50_000))
    with subprocess.Popen(
            [*COMMAND, *[str(long)] * 50, '--jobs', jobs, '--output', str(tmp_path / 'out')],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True) as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.readline()
        os.killpg(process.pid, signal.SIGINT)
        process.stdout.read()
        assert process.stderr.read() == b''
    assert process.returncode == 130
    for folder in (tmp_path / 'out').iterdir():
        assert not any(file.name.startswith('.') for file in folder.iterdir())
    deadline = time.monotonic() + 10
    while processes_of_group(process.pid) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert processes_of_group(process.pid) == []


def test_an_output_folder_that_cannot_be_written_is_one_line(
        recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / 'file').write_text('')
    assert main(['analyze', str(recording), '--output', str(tmp_path / 'file')]) == 1
    assert capsys.readouterr().err == (
        f'imu_allan: {tmp_path}/file: cannot be written ({tmp_path}/file is not a folder); choose '
        'a folder that may be written to\n')


def test_an_output_folder_that_cannot_be_written_is_told_before_the_work(
        recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / 'file').write_text('')
    begun: list[object] = []
    monkeypatch.setattr(workers, 'characterize', lambda *args: begun.append(args))
    for option in ('--output', '--json'):
        assert main(['analyze', str(recording), option, str(tmp_path / 'file' / 'deep')]) == 1
    assert begun == []


@pytest.mark.parametrize('wanted', [['--output', 'out'], ['--json', 'out/result.json']])
def test_a_result_that_cannot_be_saved_is_shown_all_the_same(
        recording: Path, tmp_path: Path, wanted: list[str], monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    # A folder in the place of the file: found out by writing alone, as a full disk is.
    (tmp_path / 'out' / 'result.json').mkdir(parents=True)
    monkeypatch.chdir(tmp_path)
    assert main(['analyze', str(recording), *wanted]) == 1
    shown = capsys.readouterr()
    assert 'angle random walk' in shown.out
    assert shown.err == (
        'imu_allan: out/result.json: cannot be written (is a directory); choose a folder that '
        'exists on a disk with room and may be written to\n')


def test_an_earlier_configuration_is_named_beside_what_was_saved_on_this_disk_alone(
        recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str]) -> None:
    result = analyze_recording(recording)
    (tmp_path / 'imu.yaml').write_text(export(result, 'kalibr').text)
    command = ['analyze', str(recording), '--output', str(tmp_path)]
    monkeypatch.setattr(workers, 'characterize', lambda *_: (result, None))
    assert main(command) == 0
    assert capsys.readouterr().err == (
        f'imu_allan: {tmp_path}: imu.yaml is of an earlier result and was not replaced; --for '
        'kalibr writes it anew\n')
    with monkeypatch.context() as patched:
        # What a cluster saves may lie on another disk; here it is this process.
        patched.setattr(analyze, 'executor', lambda *_: workers.executor(1, None))
        assert main([*command, '--dask', 'tcp://elsewhere:8786']) == 0
        assert capsys.readouterr().err == ''
    monkeypatch.setattr(workers, 'characterize',
                        lambda *_: (result, ImuAllanError('the disk is full')))
    assert main(command) == 1
    assert capsys.readouterr().err == 'imu_allan: the disk is full\n'


@pytest.mark.skipif('IMU_ALLAN_DATA' not in os.environ,
                    reason='IMU_ALLAN_DATA names no folder of real recordings')
def test_a_real_recording_is_characterized_in_well_under_a_minute(tmp_path: Path) -> None:
    recording = Path(os.environ['IMU_ALLAN_DATA']) / 'adis16405_imu2'
    began = time.monotonic()
    subprocess.run([*COMMAND, str(recording), '--output', str(tmp_path)], check=True,
                   stdout=subprocess.DEVNULL)
    assert time.monotonic() - began < 45
    axes = json.loads((tmp_path / 'result.json').read_text())['axes']
    for axis, density in (('gyro_x', 7.0e-4), ('gyro_y', 7.4e-4), ('gyro_z', 6.7e-4)):
        assert axes[axis]['coefficients']['noise_density']['value'] == pytest.approx(
            density, rel=0.03)
