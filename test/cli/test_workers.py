# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Processes that work on several recordings, and the folders that results go to."""

import os
import signal
import socket
import subprocess
import sys

from imu_allan.cli import dask_cluster
from imu_allan.cli.tasks import folder_names
from imu_allan.cli.workers import executor
from imu_allan.recordings.write import write_recording
from imu_allan.sensor.simulated_imu import simulated_blocks
from processes import living, marked, wait_until
import pytest
from repeated import slow
from whole_lines import refused
import zstandard


def test_no_name_of_a_topic_leads_out_of_the_folder_above_or_is_too_long_for_it(tmp_path):
    topics = ['/' + 'a' * 301, '/' + 'ä' * 301, '/../../up', '/' + '\0\n', '..', '']
    for name in folder_names([('recording', topic) for topic in topics]):
        (tmp_path / name).mkdir()
    assert len(list(tmp_path.iterdir())) == len(topics)


def test_a_worker_that_is_killed_costs_its_own_recording_only_and_a_defect_shows_where_it_is():
    with executor(2, None) as workers:
        lost = workers.submit(os._exit, 9)
        with refused('--jobs: the process that worked on it was ended from outside, perhaps for '
                     'want of memory; try fewer jobs'):
            lost.result(timeout=60)
        assert [workers.submit(abs, -number).result(timeout=60) for number in range(5)] == [
            *range(5)]
        with pytest.raises(ZeroDivisionError) as error:
            workers.submit(divmod, 1, 0).result(timeout=60)
        assert 'ZeroDivisionError' in str(error.value.__cause__)


@pytest.fixture(scope='module')
def packed(tmp_path_factory, model):
    """Return a recording compressed as a whole: unpacked into a folder while it is read."""
    long = write_recording(tmp_path_factory.mktemp('packed') / 'long',
                           simulated_blocks(model, 1000.0, 60_000))
    [file] = long.glob('*.mcap')
    packed = file.with_name(file.name + '.zstd')
    packed.write_bytes(zstandard.compress(file.read_bytes()))
    return packed


@pytest.mark.parametrize(('number', 'jobs'), [
    (signal.SIGINT, 1), (signal.SIGINT, 2), slow(signal.SIGTERM, 2), (signal.SIGKILL, 2)])
def test_however_the_command_ends_its_workers_and_what_they_unpacked_go_too(
        tmp_path, packed, number, jobs):
    temporary, output = tmp_path / 'temporary', tmp_path / 'out'
    temporary.mkdir()
    with subprocess.Popen(
            [sys.executable, '-m', 'imu_allan', 'analyze', *[str(packed)] * 30, '--jobs',
             str(jobs), '--output', str(output)],
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
            env=marked(tmp_path) | {'TMPDIR': str(temporary)}) as process:
        process.stdout.readline()
        assert len(living(tmp_path)) >= 2 * jobs - 1
        os.killpg(process.pid, number)
        process.stdout.read()
        complaints = process.stderr.read()
    assert process.returncode in (130, -number)
    wait_until(lambda: not living(tmp_path))
    wait_until(lambda: not list(temporary.iterdir()))
    if number == signal.SIGINT:
        assert (process.returncode, complaints) == (130, b'')
        assert not [path for path in output.rglob('.*') if path.is_file()]


def test_jobs_give_the_same_results_and_errors_in_the_same_order(
        recording, tmp_path, model, fails_with):
    other = write_recording(tmp_path / 'other', simulated_blocks(model, 50.0, 5000))
    line = '{}: no topic /nowhere; its Imu topics are /imu/data_raw ({} messages)'
    for topic, error in (('/imu/data_raw', f'{tmp_path}/none: no such file or directory'),
                         ('/nowhere', '\nimu_allan: '.join([
                             f'{tmp_path}/none: no such file or directory',
                             line.format(recording, '30,000'), line.format(other, '5,000')]))):
        command = ['analyze', recording, other, tmp_path / 'none', '--topic', topic]
        shown = [fails_with(error, *command, *jobs) for jobs in ((), ('--jobs', '2'))]
        assert shown[0] == shown[1]
        assert ('gyro N' in shown[0]) == (topic == '/imu/data_raw')


@pytest.mark.slow
def test_a_dask_cluster_gives_the_same_results(recording, analyzed):
    distributed = pytest.importorskip('distributed')
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1,
                                  dashboard_address=None) as cluster:
        assert analyzed(recording) == analyzed(recording, '--dask', cluster.scheduler_address)


def test_a_dask_address_where_nobody_answers_or_somebody_is_silent_is_one_line(
        recording, monkeypatch, fails_with):
    pytest.importorskip('distributed')
    monkeypatch.setattr(dask_cluster, 'ANSWER_S', 0.5)
    with socket.create_server(('127.0.0.1', 0)) as silent:
        for address, reason in ((f'tcp://127.0.0.1:{silent.getsockname()[1]}', 'TimeoutError'),
                                ('not an address', '<words>')):
            fails_with(f'--dask {address}: no scheduler answers ({reason}); start one with: dask '
                       'scheduler', 'analyze', recording, '--dask', address)
