# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Many recordings at once: processes that work on them, folders for results, a fleet's page."""

import csv
import json
import os
import re
import signal
import subprocess
import sys

from bags import no_axes
from imu_allan.cli.workers import executor
from imu_allan.recordings.write import write_recording
from imu_allan.result import Inspection
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
from imu_allan.writers.result_files import load_result
import numpy as np
from processes import living, marked, python, wait_until
import pytest
from repeated import slow
from whole_lines import refused, Varying
import zstandard


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
def packed(tmp_path_factory, recording):
    """Return a recording compressed as a whole: unpacked into a folder while it is read."""
    [file] = recording.glob('*.mcap')
    packed = tmp_path_factory.mktemp('packed') / f'{file.name}.zstd'
    packed.write_bytes(zstandard.compress(file.read_bytes()))
    return packed


@pytest.mark.parametrize(('number', 'jobs'), [
    (signal.SIGINT, 1), (signal.SIGINT, 2), slow(signal.SIGTERM, 2), (signal.SIGKILL, 2)])
def test_whatever_ends_the_command_its_workers_and_files_go_too(tmp_path, packed, number, jobs):
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
    assert process.returncode in (128 + number, -number)
    wait_until(lambda: not living(tmp_path))
    wait_until(lambda: not list(temporary.iterdir()))
    if number == signal.SIGINT:
        assert (process.returncode, complaints) == (130, b'')
        assert not [path for path in output.rglob('.*') if path.is_file()]


MAKE_FOLDER_INTERRUPTED = """
import os, signal
from imu_allan.__main__ import main

made = os.mkdir


def mkdir(path, *mode):
    made(path, *mode)
    exec('os.kill(os.getpid(), signal.SIGINT)')


os.mkdir = mkdir
raise SystemExit(main())
"""


EXITS = """
import atexit, sys, time
from imu_allan.cli.workers import serve
atexit.register(lambda: (print('exits', file=sys.stderr, flush=True), time.sleep(0.5)))
serve()
"""


def test_a_worker_that_is_ended_while_it_exits_says_nothing_of_it():
    with subprocess.Popen([sys.executable, '-c', EXITS], stdin=subprocess.DEVNULL,
                          stderr=subprocess.PIPE, text=True) as worker:
        assert worker.stderr.readline() == 'exits\n'
        worker.terminate()
        assert (worker.stderr.read(), worker.wait()) == ('', 0)


def test_ctrl_c_as_a_folder_is_made_to_unpack_into_removes_it(tmp_path, packed):
    # Within `exec`, as where dataclasses are made, `python -m` would end by the signal.
    program, temporary = tmp_path / 'interrupted.py', tmp_path / 'temporary'
    program.write_text(MAKE_FOLDER_INTERRUPTED)
    temporary.mkdir()
    done = python('-m', 'interrupted', 'info', packed, cwd=tmp_path,
                  env=marked(tmp_path) | {'TMPDIR': str(temporary)})
    assert (done.returncode, done.stderr, list(temporary.iterdir())) == (130, '', [])


def test_jobs_give_the_same_results_and_errors_in_order(recording, tmp_path, model, fails_with):
    other = write_recording(tmp_path / 'other', simulated_blocks(model, 50.0, 5000))
    line = '{}: no topic /nowhere; its Imu topics are /imu/data_raw ({} messages)'
    for topic, error in (('/imu/data_raw', f'{tmp_path}/none: no such file or directory'),
                         ('/nowhere', '\nimu_allan: '.join([
                             f'{tmp_path}/none: no such file or directory',
                             line.format(recording, '30,000'), line.format(other, '5,000')]))):
        command = ['analyze', recording, other, tmp_path / 'none', '--topic', topic]
        shown = [fails_with(error, *command, *jobs) for jobs in ((), ('--jobs', '2'))]
        assert shown[0] == shown[1]
        assert ('N is good' in shown[0]) == (topic == '/imu/data_raw')


@pytest.mark.slow
def test_a_dask_cluster_gives_the_same_results(recording, analyzed):
    distributed = pytest.importorskip('distributed')
    with distributed.LocalCluster(n_workers=1, threads_per_worker=1,
                                  dashboard_address=None) as cluster:
        assert analyzed(recording) == analyzed(recording, '--dask', cluster.scheduler_address)


def test_a_dask_address_where_nobody_answers_is_one_line(recording, fails_with):
    pytest.importorskip('distributed')
    fails_with("--dask not an address: no scheduler answers (missing port number in address 'not "
               "an address'); start one with: dask scheduler",
               'analyze', recording, '--dask', 'not an address')


def write_csv(path, density, seed, samples=6000, axes='y'):
    """Write a minute of axes of a gyroscope at 100 Hz, of which y has another density."""
    model = parse_model(f'gyro: {{noise_density: 0.005 deg/s/sqrt(Hz), '
                        f'y: {{noise_density: {density} deg/s/sqrt(Hz)}}}}')
    columns = np.concatenate([block.samples[:, :3] for block in simulated_blocks(
        model, 100.0, samples, seed=seed)])
    path.parent.mkdir(exist_ok=True)
    rows = '\n'.join(f'{i / 100},' + ','.join(repr(row['xyz'.index(axis)]) for axis in axes)
                     for i, row in enumerate(columns.tolist()))
    path.write_text(f'time_s,{",".join(f"gyro_{axis}" for axis in axes)}\n{rows}\n')
    return str(path)


def test_the_line_of_a_recording_says_which_sensor_is_not_good(tmp_path, fails_with):
    paths = [write_csv(tmp_path / f'{name}.csv', 0.005, 1, samples, 'xyz')
             for name, samples in (('good', 7000), ('short', 600))]
    constant = tmp_path / 'constant.csv'
    constant.write_text('time_s,gyro_y\n' + ''.join(f'{i / 100},1\n' for i in range(7000)))
    shown = fails_with(f'{constant}: no coefficient. Gyroscope: not usable: every sample is the '
                       'same (y).',
                       'analyze', *paths, constant)
    assert shown.splitlines()[:3] == [
        Varying('good: Gyroscope: N is good (<words>). <words>'),
        'short: Gyroscope: not usable: 6 s at rest.',
        'constant: Gyroscope: not usable: every sample is the same (y).']


def test_a_fleet_gets_a_page_a_table_and_a_document(tmp_path, fails_with):
    # Six units, of which sn10 is noisy, and a file that is no recording.
    paths = [write_csv(tmp_path / f'sn{number}' / 'night.csv', 0.009 if number == 10 else 0.005,
                       number, axes='xyz') for number in (2, 4, 5, 6, 7, 10)]
    bad = tmp_path / 'sn11' / 'night.csv'
    bad.parent.mkdir()
    bad.write_text('no,recording\n1,2\n')
    output = tmp_path / 'fleet'
    shown = fails_with(f'{bad}: {no_axes("no,recording")}', 'analyze', *paths, bad, '--output',
                       output, '--name-from', 'folder').splitlines()
    assert Varying('sn10: gyro_y angle random walk 0.54<number> deg/sqrt(h): <number> times the '
                   'median of the others, <number> spreads away') in shown
    document = json.loads((output / 'fleet.json').read_text())
    assert document['schema'] == 'imu_allan.fleet/1'
    assert [(unit['name'], bool(unit['odd'])) for unit in document['units']] == [
        (f'sn{number}', number == 10) for number in (2, 4, 5, 6, 7, 10)]
    assert [failure['unit'] for failure in document['failures']] == ['sn11']
    (density,) = (trait for trait in document['traits']
                  if (trait['axis'], trait['key']) == ('gyro_x', 'noise_density'))
    assert density['median'] == pytest.approx(0.005 * 0.0174533, rel=0.02)
    with (output / 'fleet.csv').open() as file:
        rows = list(csv.DictReader(file))
    assert [row['verdict'] for row in rows] == ['ok'] * 5 + ['odd', 'failed']
    result = load_result(output / 'sn7' / 'result.json')
    assert float(rows[4]['gyro_x.noise_density']) == \
        result.axes['gyro_x'].coefficients['noise_density'].value
    page = (output / 'fleet.html').read_text()
    assert '<a href="sn10/report.html">sn10</a>' in page
    fails_with(f'{bad}: {no_axes("no,recording")}', 'analyze', paths[0], bad, '--output', output,
               '--name-from', 'folder')
    assert re.search(r'Allan deviation of 1 unit\b', (output / 'fleet.html').read_text())
    assert '<script' not in page


def test_recordings_of_one_imu_make_one_result(tmp_path, output_of, fails_with):
    paths = [write_csv(tmp_path / f'night{number}.csv', 0.005, number) for number in (1, 2)]
    assert f'{paths[0]} + {paths[1]}' in output_of(
        'analyze', *paths, '--together', '--output', tmp_path / 'out', '--json',
        tmp_path / 'r.json', '--serial', 'A-17', '--meta', 'station=bench 3').splitlines()
    result = load_result(tmp_path / 'r.json')
    assert [part.path for part in result.recordings] == paths
    assert result.inspection == Inspection('A-17', None, 'bench 3')
    assert set(result.turn_on_bias) == {'gyro_y'}
    assert (tmp_path / 'out' / 'report.html').exists()
    assert not (tmp_path / 'out' / 'fleet.html').exists()
    # Nothing is left out.
    assert fails_with(f'{tmp_path}/no.csv: no such file or directory',
                      'analyze', paths[0], tmp_path / 'no.csv', '--together') == ''
