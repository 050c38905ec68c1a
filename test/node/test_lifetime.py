# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""How the node starts, ends, and lives beside others."""

import json
from pathlib import Path
import signal
import subprocess
import sys
import time
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from imu_allan.cdr import encode_imu
from imu_allan.node.characterization_node import HURRY_S, pace_s, TICK_S
from imu_allan.node.results import Results
from imu_allan.writers.filters import CONSUMERS
import numpy as np
import pytest
from repeated import slow
from ros_harness import (
    Driver,
    PATIENCE_S,
    Process,
    RATE_HZ,
    Ros,
    start_repeatedly,
    told_in,
    too_early,
)
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CompressedImage
from std_srvs.srv import SetBool, Trigger
from whole_lines import Varying

NOT_FOR_THE_NODE = ('rosbags', 'mcap', 'zstandard', 'lz4', 'jinja2')


@pytest.fixture(scope='module')
def node(shared_ros: Ros) -> Process:
    """Start a node that several tests share, without the packages that ROS does not have."""
    missing = shared_ros.folder / 'missing'
    missing.mkdir()
    for name in NOT_FOR_THE_NODE:
        (missing / f'{name}.py').write_text(
            f'raise ModuleNotFoundError("No module named {name!r}", name={name!r})')
    return shared_ros.start('imu_allan_node', {'publish_period': 0.5},
                            prepend_path=missing)


@pytest.fixture(scope='module')
def shared_driver(shared_ros: Ros, node: Process) -> Driver:
    assert node.running
    return Driver(shared_ros).wait_for_node()


@pytest.fixture(scope='module')
def shared_reports(shared_ros: Ros) -> list[DiagnosticArray]:
    return shared_ros.listen(DiagnosticArray, '/diagnostics', 10)


@pytest.fixture
def reports(ros: Ros) -> list[DiagnosticArray]:
    return ros.listen(DiagnosticArray, '/diagnostics', 10)


def status(reports: list[DiagnosticArray], ros: Ros, name: str) -> Any:
    """Look up the last status of this test's node."""
    return next((status for report in reversed(reports) for status in report.status
                 if status.name == f'{ros.name("imu_allan")}: {name}'
                 and status.hardware_id.startswith(f'{ros.namespace}/')), None)


def number(reports: list[DiagnosticArray], ros: Ros, name: str, key: str) -> float:
    found = status(reports, ros, name)
    return float(next((v.value for v in found.values if v.key == key), 'nan')
                 if found is not None else 'nan')


def saved(ros: Ros) -> list[Path]:
    return sorted((ros.folder / 'output').rglob('result.json'))


def save(ros: Ros, node: str = 'imu_allan') -> Any:
    """Save; give the document, or None as long as there is nothing to save."""
    response = ros.call(Trigger, f'{node}/save')
    if not response.success:
        assert too_early(response), response.message
        return None
    return json.loads(Path(response.message.splitlines()[0]).read_text())


def test_signals_let_the_node_save_every_sample_once_and_exit_0(
        ros: Ros) -> None:
    cases = {signal.SIGINT: 'first', signal.SIGTERM: 'second'}
    nodes = {number: ros.start('imu_allan_node', {'state_file': str(ros.folder / name)},
                               namespace=ros.name(name)) for number, name in cases.items()}
    for number_, name in cases.items():
        driver = Driver(ros, f'{name}/imu/data_raw').wait_for_node()
        driver.publish(2000)
        assert driver.publisher.wait_for_all_acked()
        # Whoever loses patience signals again.
        for _ in range(3):
            if nodes[number_].running:
                nodes[number_].popen.send_signal(number_)
            time.sleep(0.02)
        assert nodes[number_].wait() == 0, nodes[number_].log
        assert 'Traceback' not in nodes[number_].log
        assert (ros.folder / name).stat().st_size > 10_000
        # Who is killed before the end keeps what cannot be made again.
        [result] = (path for path in saved(ros) if f'_{name}_' in path.parent.name)
        files = [ros.folder / name, result, result.with_name('allan_deviation.png')]
        assert files == sorted(files, key=lambda file: file.stat().st_mtime_ns)
    assert [json.loads(path.read_text())['timeline']['samples'] for path in saved(ros)] == [
        2000, 2000]


@pytest.mark.parametrize('number', [slow(signal.SIGINT), signal.SIGTERM])
def test_a_node_that_fits_and_draws_ends_before_its_container_is_killed(
        ros: Ros, number: signal.Signals) -> None:
    node = ros.start('imu_allan_node', {'publish_period': 0.5})
    driver = Driver(ros).wait_for_node()
    images = ros.listen(CompressedImage, 'imu_allan/plot/compressed')
    driver.publish(20_000)
    ros.until(lambda: images)
    # The next fit begins within half a second, and what is drawn of it after that.
    driver.publish(2000)
    ros.executor.spin_once(timeout_sec=0.6)
    assert node.stop(number, within_s=10.0) == 0, node.log
    assert json.loads(saved(ros)[0].read_text())['timeline']['samples'] == 22_000


def test_a_signal_after_a_single_sample_ends_the_node_without_files(ros: Ros) -> None:
    node, driver = ros.start('imu_allan_node'), Driver(ros).wait_for_node()
    driver.publish(1)
    assert driver.publisher.wait_for_all_acked()
    assert node.stop(signal.SIGTERM) == 0, node.log
    assert saved(ros) == []


def test_a_wrong_parameter_ends_the_start_with_one_line_and_status_1(ros: Ros) -> None:
    (ros.folder / 'broken.yaml').write_text('/**:\n  ros__parameters: [')
    reliability = f'qos_overrides.{ros.name("imu/data_raw")}.subscription.reliability'
    cases: list[tuple[list[str], str]] = [
        (['-p', 'publish_period:=0.0'],
         'parameter publish_period: must lie between 0.5 and 86400'),
        (['-p', 'publish_period:=5'],
         'parameter publish_period: expected a number with a decimal point, such as 10.0'),
        (['-p', 'motion:=ignore'], "parameter motion: 'ignore' is not one of exclude, keep"),
        (['-p', 'export_for:=[kalibr, nonsense]'],
         f"parameter export_for: 'nonsense' is not one of {', '.join(CONSUMERS)}"),
        (['-p', "output_dir:=''"], 'parameter output_dir: must not be empty'),
        (['-p', 'state_file:=/dev/null/state'], 'state_file /dev/null/state: cannot be written '
         '(File exists); choose a folder that may be written to'),
        (['-p', 'output_dir:=~no-such-user/x', '-p', 'state_file:=~no-such-user/x'],
         'state_file ~no-such-user/x: this user has no home folder; write the path without ~'),
        (['-p', 'aiding_interval:=90.0'],
         'parameter aiding_interval: 90 s is longer than coast, 60 s'),
        (['-p', f'spec_file:={ros.folder}/none.yaml'], f'parameter spec_file: {ros.folder}/none.'
         'yaml: cannot be read (No such file or directory); give a noise model or datasheet YAML '
         'file'),
        (['-p', f'reference:={ros.folder}/broken.yaml'],
         f'parameter reference: {ros.folder}/broken.yaml: not JSON; give a result file, written '
         'by: imu_allan analyze RECORDING --json FILE'),
        (['-p', f'{reliability}:=sometimes'], 'qos_overrides of imu/data_raw: '
         'Unexpected QoS override for policy `reliability`: `sometimes`'),
        (['--params-file', str(ros.folder / 'broken.yaml')],
         '<words>; check the arguments after --ros-args and the parameter file')]
    results = start_repeatedly(ros, [arguments for arguments, _ in cases])
    for (status, text), (_, line) in zip(results, cases, strict=True):
        assert status == 1, line
        # rcl complains of a file by itself, before it gives an error.
        own = [text for text in text.splitlines() if text.startswith('imu_allan_node: ')]
        assert own == [Varying(f'imu_allan_node: {line}')]
        assert 'Traceback' not in text


def test_a_missing_parameter_file_is_one_line(ros: Ros) -> None:
    [(status, text)] = start_repeatedly(ros, [['--params-file', '/no/such.yaml']])
    assert (status, text) == (1, 'imu_allan_node: --params-file /no/such.yaml: no such file\n')


def test_a_parameter_without_ros_args_is_refused_with_status_2() -> None:
    done = subprocess.run(
        [sys.executable, '-c', 'from imu_allan.node.imu_allan_node import main\n'
         'raise SystemExit(main())', 'publish_period=5.0'], capture_output=True, text=True,
        timeout=60, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (
        2, '', "imu_allan_node: 'publish_period=5.0' is no argument; give parameters as "
        '--ros-args -p publish_period:=5.0\n')


def test_no_filter_to_export_for_is_no_error_in_either_form(ros: Ros) -> None:
    for status, text in start_repeatedly(ros, [['-p', 'export_for:=[]'],
                                               ['-p', "export_for:=['']"]]):
        assert status == 0, text
        assert told_in(text) == [f'characterizing the IMU on {ros.name("imu/data_raw")}']


def test_a_save_before_there_is_data_leaves_the_storage_well(
        ros: Ros, reports: list[DiagnosticArray]) -> None:
    ros.start('imu_allan_node')
    response = ros.call(Trigger, 'imu_allan/save')
    assert not response.success
    assert response.message == ('nothing to save: too few usable samples have come from '
                                f'{ros.name("imu/data_raw")} yet')
    reports.clear()
    found = ros.until(lambda: status(reports, ros, 'storage'))
    assert found.level == b'\0', found.message


@pytest.mark.parametrize('period_s', [0.5, 0.9, 1.0, 10.0])
def test_a_period_that_is_no_multiple_of_the_tick_is_kept_on_average(period_s: float) -> None:
    nobody: Any = None
    results = Results('/imu_allan', nobody, nobody, nobody, nobody, {
        'spec_file': '', 'reference': '', 'aiding_interval': 0.1, 'coast': 60.0,
        'publish_period': period_s})
    began = time.monotonic()
    ticks = [began + TICK_S * number for number in range(1, 1001)]
    assert sum(map(results.due, ticks)) == pytest.approx(1000 * TICK_S / period_s, abs=1)


def test_the_shipped_parameter_file_is_accepted_and_a_misspelt_name_told(ros: Ros) -> None:
    file = Path(__file__).parents[2] / 'config' / 'imu_allan.yaml'
    node = ros.start('imu_allan_node', {'publish_perid': 5.0}, files=(file,))
    ros.until(lambda: 'characterizing the IMU' in node.log)
    assert 'unknown parameter publish_perid is ignored, did you mean publish_period?' in node.lines


def test_several_imus_are_several_nodes_and_remaps_are_followed(ros: Ros) -> None:
    topics = {'left': 'camera/imu', 'right': 'imu/data_raw'}
    drivers = {}
    for side, topic in topics.items():
        ros.start('imu_allan_node', namespace=ros.name(side), remaps={'imu/data_raw': topic})
        drivers[side] = Driver(ros, f'{side}/{topic}')
    for side, driver in drivers.items():
        driver.wait_for_node()
        driver.publish(1000, frame_id=f'{side}_imu')
        assert driver.publisher.wait_for_all_acked()
    for side, topic in topics.items():
        document = ros.until(lambda side=side: save(ros, f'{side}/imu_allan'))
        assert document['source']['frame_id'] == f'{side}_imu'
        assert document['source']['topic'] == ros.name(f'{side}/{topic}')
    assert len(saved(ros)) == 2


def test_simulated_time_works_without_a_clock_and_with_one(
        ros: Ros, reports: list[DiagnosticArray]) -> None:
    ros.start('imu_allan_node', {'use_sim_time': True, 'publish_period': 0.5})
    driver = Driver(ros).wait_for_node()
    arrays = ros.listen(DiagnosticArray, 'imu_allan/coefficients')
    driver.publish(1000)
    ros.until(lambda: arrays)

    def time_of_report() -> int | None:
        own = [r for r in reports if r.status[0].hardware_id.startswith(f'{ros.namespace}/')]
        return int(own[-1].header.stamp.sec) if own else None

    ros.until(lambda: time_of_report() == 0)
    clock = ros.node.create_publisher(Clock, '/clock', 10)
    ros.until(lambda: clock.publish(Clock(clock=Time(sec=1234))) or time_of_report() == 1234)
    ros.node.destroy_publisher(clock)


def test_lost_messages_are_counted_by_their_numbers(
        ros: Ros, reports: list[DiagnosticArray]) -> None:
    depth = f'qos_overrides.{ros.name("imu/data_raw")}.subscription.depth'
    ros.start('imu_allan_node', {depth: 10}, best_effort=True)
    driver = Driver(ros).wait_for_node()
    # Best effort: the first have to be repeated until one comes through.
    ros.until(lambda: driver.publish(1) or number(reports, ros, 'reception', 'received') > 0)
    first = driver.next
    # Many more between two takings than the queue holds, however slowly they are made.
    ros.until(lambda: driver.publish(500) or number(reports, ros, 'reception', 'lost') > 1000)
    last = driver.next

    def accounted_for() -> bool:
        driver.publish(1)
        received, lost = (number(reports, ros, 'reception', key) for key in ('received', 'lost'))
        assert received + lost <= driver.next
        return received + lost >= last - first

    ros.until(accounted_for)
    # Said while it is recent, which on a busy machine it no longer is by now.
    assert Varying(
        '<number> messages lost in the last 30 s: the queue of 10 messages is too short for what '
        f'comes between two looks; leave {depth} out, or set it to 2.5 s of messages') in [
            one.message for report in reports for one in report.status]


def test_nothing_is_drawn_while_nobody_watches(
        shared_ros: Ros, shared_driver: Driver, node: Process) -> None:
    maps = Path(f'/proc/{node.popen.pid}/maps')
    if not maps.exists():
        pytest.skip('no /proc here')
    arrays = shared_ros.listen(DiagnosticArray, 'imu_allan/coefficients')
    shared_driver.publish(1000)
    shared_ros.until(lambda: len(arrays) > 0)
    assert 'matplotlib' not in maps.read_text()
    images = shared_ros.listen(CompressedImage, 'imu_allan/plot/compressed')
    shared_ros.until(lambda: images)
    assert 'matplotlib' in maps.read_text()
    assert shared_ros.call(Trigger, 'imu_allan/reset').success


def test_a_pause_passes_samples_over_and_counts_as_a_gap(
        shared_ros: Ros, shared_driver: Driver, shared_reports: list[DiagnosticArray]) -> None:
    ros, driver, reports = shared_ros, shared_driver, shared_reports

    before = driver.next

    def received(count: int) -> None:
        ros.until(lambda: number(reports, ros, 'reception', 'received') == before + count)

    # What the test before left under way belongs to no run of this one.
    received(0)
    assert ros.call(Trigger, 'imu_allan/reset').success
    driver.publish(600)
    received(600)
    assert ros.call(SetBool, 'imu_allan/pause', SetBool.Request(data=True)).success
    driver.publish(400)
    received(1000)
    assert number(reports, ros, 'reception', 'passed_over') == 400
    assert status(reports, ros, 'reception').message == 'paused: samples are passed over'
    assert ros.call(SetBool, 'imu_allan/pause', SetBool.Request(data=False)).success
    driver.publish(600)
    received(1600)
    timeline = save(ros)['timeline']
    assert timeline['samples'] == 1200
    assert timeline['missing'] == 400
    [gap] = timeline['gaps']
    assert gap['duration_s'] == pytest.approx(400 / RATE_HZ, rel=1e-6)


def test_messages_that_are_no_imu_are_counted_and_survived(
        shared_ros: Ros, shared_driver: Driver, shared_reports: list[DiagnosticArray]) -> None:
    ros, driver, reports = shared_ros, shared_driver, shared_reports
    assert ros.call(Trigger, 'imu_allan/reset').success
    driver.publish(300)
    good = encode_imu(1, np.zeros(6), 'imu')
    for length in (8, 100, len(good) - 9):
        driver.send(good[:length])
    driver.publish(300)
    ros.until(lambda: number(reports, ros, 'timeline', 'samples') == 600)
    assert number(reports, ros, 'reception', 'malformed') == 3
    assert save(ros)['timeline']['samples'] == 600


def test_silence_is_told_with_the_topics_that_there_are(
        shared_ros: Ros, shared_driver: Driver, node: Process) -> None:
    other = Driver(shared_ros, 'camera/imu')
    shared_ros.node.destroy_publisher(shared_driver.publisher)
    # The first complaint may have come while the publisher was still there.
    shared_ros.until(lambda: Varying(
        f'no message on {shared_driver.topic} for <number> s; Imu topics here: {other.topic}; '
        'choose one with --ros-args -r imu/data_raw:=TOPIC') in node.lines)


def test_the_shared_node_never_failed_and_ends_well(node: Process) -> None:
    assert node.stop() == 0
    assert 'Traceback' not in node.log


@pytest.mark.parametrize('program', ['imu_allan_node', 'imu_simulator'])
def test_without_ros_one_line_says_how_to_install_it(tmp_path: Path, program: str) -> None:
    (tmp_path / 'rclpy.py').write_text(
        'raise ModuleNotFoundError("No module named \'rclpy\'", name="rclpy")')
    start = (f'import sys; sys.path.insert(0, {str(tmp_path)!r}); '
             f'from imu_allan.node.{program} import main; sys.exit(main())')
    done = subprocess.run([sys.executable, '-c', start], capture_output=True, text=True,
                          check=False)
    assert done.returncode == 1
    assert done.stderr == (
        f"{program}: needs ROS 2, which {sys.executable} cannot import (No module named 'rclpy'); "
        'source a ROS 2 installation (source /opt/ros/jazzy/setup.bash) or install the wheels: '
        "pip install 'imu_allan[ros]'\n")


INTERRUPTED = """
import os, signal, sys


class Interrupt:
    def find_spec(self, name, *_):
        if name == interrupted:
            sys.meta_path.remove(self)
            os.kill(os.getpid(), signal.SIGINT)


program, interrupted = sys.argv.pop(1), sys.argv.pop(1)
sys.meta_path.insert(0, Interrupt())
if program == 'imu_simulator':
    from imu_allan.node.imu_simulator import main
else:
    from imu_allan.node.imu_allan_node import main
raise SystemExit(main())
"""


@pytest.mark.parametrize(('program', 'module', 'status'), [
    ('imu_allan_node', 'imu_allan.node.interface', 130), ('imu_allan_node', 'numpy', 130),
    ('imu_simulator', 'numpy', 130), ('imu_allan_node', 'rclpy', 0)])
def test_ctrl_c_while_a_node_starts_ends_it_without_a_traceback(
        ros: Ros, program: str, module: str, status: int) -> None:
    done = subprocess.run(
        [sys.executable, '-c', INTERRUPTED, program, module, '--ros-args', '-r',
         f'__ns:={ros.namespace}', '-p', f'state_file:={ros.folder / "state"}'],
        check=False, capture_output=True, text=True, timeout=PATIENCE_S)
    assert (done.returncode, 'Traceback' in done.stderr) == (status, False), done.stderr


def test_the_node_imports_neither_bag_readers_nor_plotting() -> None:
    names = (*NOT_FOR_THE_NODE, 'matplotlib', 'rich')
    start = ('import sys; import imu_allan.node.characterization_node; '
             'import imu_allan.node.simulator_node; '
             f'print([name for name in {names} if name in sys.modules])')
    done = subprocess.run([sys.executable, '-c', start], capture_output=True, text=True,
                          check=True)
    assert done.stdout.strip() == '[]'


def test_ticks_come_sooner_the_faster_messages_come() -> None:
    assert pace_s(0, TICK_S) == TICK_S
    assert pace_s(500, 0.5) == TICK_S
    # 25 kHz, as of a recording played fast: four times as often as the queue would need.
    assert pace_s(5000, 0.2) == pytest.approx(0.1)
    assert pace_s(10_000, 0.001) == HURRY_S
