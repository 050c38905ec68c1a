# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""How the node starts, ends, and lives beside others; it runs nothing from its folder."""

import os
from pathlib import Path
import signal
import sys
import time

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from imu_allan.node.storage import StateFile
from imu_allan.writers.key_figures import closing_lines
from imu_allan.writers.result_files import load_result
from processes import interrupted, python
import pytest
from rclpy.qos import QoSProfile, ReliabilityPolicy
from ros_harness import Driver, ENTRY_POINTS, Health, RATE_HZ, said_in, start_repeatedly
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import CompressedImage, Imu, Temperature
from std_srvs.srv import SetBool, Trigger
from whole_lines import Varying


@pytest.fixture(scope='module')
def node(shared_ros):
    """Start a node that several tests share, without the packages that ROS does not have."""
    missing = shared_ros.folder / 'missing'
    missing.mkdir()
    for name in ('rosbags', 'mcap', 'zstandard', 'lz4', 'jinja2', 'rich'):
        (missing / f'{name}.py').write_text(
            f'raise ModuleNotFoundError("No module named {name!r}", name={name!r})')
    return shared_ros.start('imu_allan_node', {'publish_period': 0.5}, prepend_path=missing)


@pytest.fixture(scope='module')
def shared_driver(shared_ros, node):
    assert node.running
    return Driver(shared_ros).wait_for_node()


def test_several_nodes_follow_remaps_and_save_every_sample_once_at_any_signal(ros):
    topics = {signal.SIGINT: 'camera/imu', signal.SIGTERM: 'imu/data_raw',
              signal.SIGHUP: 'imu/data_raw'}
    nodes = {number: ros.start(
        'imu_allan_node', {'state_file': str(ros.folder / number.name)},
        namespace=ros.name(number.name), remaps={'imu/data_raw': topic})
        for number, topic in topics.items()}
    for number, topic in topics.items():
        driver = Driver(ros, f'{number.name}/{topic}').wait_for_node()
        driver.publish(2000, frame_id=number.name)
        assert driver.publisher.wait_for_all_acked()
    # Whoever loses patience signals again, until the end.
    while any(node.running for node in nodes.values()):
        for number, node in nodes.items():
            if node.running:
                node.popen.send_signal(number)
        time.sleep(0.02)
    for number, node in nodes.items():
        assert (node.wait(), 'Traceback' in node.log) == (0, False), node.log
        assert (ros.folder / number.name).stat().st_size > 10_000
        # Who is killed before the end keeps what cannot be made again.
        [result] = (ros.folder / 'output').glob(f'*_{number.name}_*/result.json')
        files = [ros.folder / number.name, result, result.with_name('allan_deviation.png')]
        assert files == sorted(files, key=lambda file: file.stat().st_mtime_ns)
    assert {document['source']['frame_id']: (
        document['source']['topic'], document['timeline']['samples'])
        for document in ros.results()} == {
        number.name: (ros.name(f'{number.name}/{topic}'), 2000)
        for number, topic in topics.items()}


def test_a_node_that_fits_draws_and_saves_ends_before_its_container_is_killed(ros):
    node = ros.start('imu_allan_node', {'publish_period': 0.5, 'expected_rate': 100.0})
    driver = Driver(ros).wait_for_node()
    images = ros.listen(CompressedImage, 'imu_allan/plot/compressed')
    driver.publish(20_000, frame_id='imu\n')
    ros.until(lambda: images)
    client = ros.node.create_client(Trigger, ros.name('imu_allan/save'))
    ros.until(client.service_is_ready)
    # The next fit begins within half a second, and what is drawn of it after that.
    driver.publish(2000, frame_id='imu\n')
    client.call_async(Trigger.Request())
    ros.executor.spin_once(timeout_sec=0.6)
    assert node.stop(signal.SIGTERM, within_s=10.0) == 0, node.log
    assert ros.results()[0]['timeline']['samples'] == 22_000
    wrote = 'wrote result.json, curve.csv, imu.yaml, allan_deviation.png to '
    for line in (f'characterizing the IMU on {driver.topic}',
                 f"first samples on {driver.topic}: frame_id 'imu\\n', 200 Hz, header stamps",
                 'measured 200 Hz, expected 100 Hz; check expected_rate, or the setting of the '
                 'driver',
                 Varying('observable: noise density (rad/s/sqrt(Hz)) of gyro x <number> '
                         '(<number> .. <number>); gyro y <words>'),
                 Varying(f'{wrote}{ros.folder}/output/<words>')):
        assert line in node.lines, node.log
    # The end is what was saved, not what was last published.
    [saved] = ros.folder.glob('output/*/result.json')
    closing = closing_lines(load_result(saved), 0.1, 60.0)
    assert closing[0].startswith('Gyroscope: use with care: one of two clocks runs ')
    assert closing[2].startswith('Tuned for a filter corrected every 0.1 s, up to 60 s unaided')
    assert any(line.startswith('speed of clocks: header stamps run ') for line in closing)
    assert node.lines[-len(closing):] == closing


def test_a_wrong_parameter_ends_the_start_with_one_line_and_status_1(ros):
    (ros.folder / 'broken.yaml').write_text('/**:\n  ros__parameters: [')
    reliability = f'qos_overrides.{ros.name("imu/data_raw")}.subscription.reliability'
    no_name = ('Invalid topic name: topic name must not contain characters other than '
               "alphanumerics, '_', '~', '{', or '}': ")
    twist = 'imu_type:=geometry_msgs/msg/TwistStamped'
    used = StateFile(ros.folder / 'used')
    cases = [
        ([f'state_file:={used.path}'], f'state_file {used.path}: is in use by another node; give '
         'every node a file of its own'),
        (['publish_period:=5'],
         'parameter publish_period: expected a number with a decimal point, such as 10.0'),
        (['use_sim_time:=maybe'], "Trying to set parameter 'use_sim_time' to 'maybe' of type "
         "'STRING', expecting type 'BOOL': use_sim_time"),
        # YAML takes it for false.
        (['state_file:=no'], 'parameter state_file: expected a text in quotes'),
        (['motion:=ignore'], "parameter motion: 'ignore' is not one of exclude, keep"),
        (["output_dir:=''"], 'parameter output_dir: must not be empty'),
        (['output_dir:=null'], 'parameter output_dir: must not be empty'),
        (['output_dir:=~no-such-user/x', 'state_file:=~no-such-user/x'],
         'state_file ~no-such-user/x: this user has no home folder; write the path without ~'),
        (['aiding_interval:=90.0'], 'parameter aiding_interval: 90 s is longer than coast, 60 s'),
        ([f'spec_file:={ros.folder}/none.yaml'], f'parameter spec_file: {ros.folder}/none.'
         'yaml: cannot be read (No such file or directory); give a noise model or datasheet YAML '
         'file'),
        ([f'reference:={ros.folder}/broken.yaml'],
         f'parameter reference: {ros.folder}/broken.yaml: not JSON; give a result file, written '
         'by: imu_allan analyze RECORDING --json FILE'),
        ([f'{reliability}:=sometimes'], 'qos_overrides of imu/data_raw: '
         'Unexpected QoS override for policy `reliability`: `sometimes`'),
        (['temperature_topic:=not a name'], f"parameter temperature_topic: {no_name}'not a name'"),
        (['temperature_topic:=imu/data_raw'], '<words>: cannot be subscribed to (<words>); it may '
         'be a topic of another type, or its qos_overrides may be wrong'),
        (['imu_type:=no_such_msgs/msg/Imu'], 'parameter imu_type: no_such_msgs/msg/Imu: its '
         "Python package cannot be imported (No module named 'no_such_msgs'); source the "
         'workspace that it was built in'),
        (['imu_type:=sensor_msgs/msg/Nothing'], 'parameter imu_type: sensor_msgs/msg/Nothing: '
         'the package sensor_msgs has no such message'),
        ([twist, 'gyro_field:=twist.no'], 'parameter gyro_field twist.no: '
         'geometry_msgs/msg/Twist has no field no; it has linear, angular'),
        (['accel_unit:=deg/s'],
         'parameter accel_unit deg/s: deg/s cannot be turned into m/s^2; write m/s^2 or g, '
         'of counts g/16384'),
        (['gyro_topic:=/g'],
         'parameter gyro_topic: needs accel_topic, too: an IMU on two topics has both'),
        (['accel_type:=sensor_msgs/msg/Imu'], 'parameter accel_type: needs gyro_topic and '
         'accel_topic; imu_type is the type of one topic'),
        (['--nonsense'], '<words>; check the arguments after --ros-args and the parameter file'),
        (['--params-file', '/no/such.yaml'], '--params-file /no/such.yaml: no such file'),
        (['--params-file', str(ros.folder / 'broken.yaml')],
         '<words>; check the arguments after --ros-args and the parameter file')]
    no_filter = [['export_for:=[]'], ["export_for:=['']"]]
    results = start_repeatedly(ros, [
        given if given[0].startswith('--') else [word for one in given for word in ('-p', one)]
        for given in (*(given for given, _ in cases), *no_filter)])
    used.close()
    for status, text in results[len(cases):]:
        assert (status, said_in(text)) == (
            0, [f'characterizing the IMU on {ros.name("imu/data_raw")}'])
    for (status, text), (_, line) in zip(results, cases, strict=False):
        assert status == 1, line
        # rcl complains of a broken file by itself, before it gives an error.
        own = [said for said in text.splitlines() if 'broken.yaml' not in line or said.startswith(
            'imu_allan_node: ')]
        assert own[-1:] == [Varying(f'imu_allan_node: {line}')], text
        assert len(own) == 1 or line.startswith('<words>'), text
        assert 'Traceback' not in text


def test_a_node_that_the_middleware_refuses_is_one_line(ros):
    # Without keys of its own no node is let into a secured robot.
    (ros.folder / 'enclaves').mkdir()
    node = ros.started('imu_allan_node', ['--ros-args', '--enclave', '/'], {
        'ROS_SECURITY_KEYSTORE': str(ros.folder), 'ROS_SECURITY_ENABLE': 'true',
        'ROS_SECURITY_STRATEGY': 'Enforce'})
    assert node.wait() == 1
    assert node.log.splitlines()[-1] == Varying('imu_allan_node: error creating node: <words>')
    assert 'Traceback' not in node.log


def test_shipped_parameters_simulated_time_and_too_few_samples_are_no_fault(ros, health):
    file = Path(__file__).parents[2] / 'config' / 'imu_allan.yaml'
    # The topic is in a namespace.
    override = 'qos_overrides.{}imu/data_raw.subscription.reliability'
    node = ros.start('imu_allan_node', {
        'publish_perid': 5.0, 'use_sim_time': True, override.format('/'): 'reliable'},
        files=(file,))
    driver = Driver(ros).wait_for_node()
    assert not ros.call(Trigger, 'imu_allan/save').success
    for given, meant in (('publish_perid', 'publish_period'), (
            override.format('/'), override.format(f'{ros.namespace}/'))):
        assert f'unknown parameter {given} is ignored, did you mean {meant}?' in node.lines
    # There is no clock yet, but time goes on.
    health.news()
    assert (health.level('storage'), health.stamp_s) == (b'\0', 0)
    clock = ros.node.create_publisher(Clock, '/clock', 10)
    ros.until(lambda: clock.publish(Clock(clock=Time(sec=1234))) or health.stamp_s == 1234)
    ros.node.destroy_publisher(clock)
    driver.publish(1)
    assert driver.publisher.wait_for_all_acked()
    assert node.stop(signal.SIGTERM) == 0, node.log
    assert ros.results() == []


def test_lost_messages_are_counted_by_their_numbers(ros, health):
    depth = f'qos_overrides.{ros.name("imu/data_raw")}.subscription.depth'
    node = ros.start('imu_allan_node', {depth: 10}, best_effort=True)
    driver = Driver(ros).wait_for_node()
    # Best effort: the first have to be repeated until one comes through.
    ros.until(lambda: driver.publish(1) or health.number('reception', 'received') > 0)
    first = driver.next
    # Many more between two takings than the queue holds, however slowly they are made.
    ros.until(lambda: driver.publish(500) or health.number('reception', 'lost') > 1000)
    last = driver.next

    def accounted_for():
        driver.publish(1)
        received, lost = (health.number('reception', key) for key in ('received', 'lost'))
        assert received + lost <= driver.next
        return received + lost >= last - first

    ros.until(accounted_for)
    line = Varying(
        f'<number> messages on {driver.topic} lost in the last 30 s: ask for reliable delivery '
        'and a queue for 2.5 s of messages, with qos_overrides')
    # Said while it is recent, which on a busy machine it no longer is by now.
    assert health.said('reception', line, b'\1')
    assert node.lines.count(line) >= 1
    assert health.number('reception', 'queue') == 10
    assert 'too unevenly' not in node.log


def test_who_publishes_otherwise_and_a_thermometer_are_named(
        shared_ros, node):
    ros, health, name = shared_ros, Health(shared_ros), shared_ros.name('tester')
    for kind, qos, said in (
            (Temperature, 10,
             f'{name} publishes sensor_msgs/msg/Temperature, not sensor_msgs/msg/Imu'),
            # The node of a test asks for reliable delivery, with overrides.
            (Imu, QoSProfile(depth=10, reliability=ReliabilityPolicy.BEST_EFFORT),
             f'the QoS of {name} does not go with that asked for (Best effort publisher and '
             'reliable subscription); choose another with qos_overrides')):
        other = ros.node.create_publisher(kind, ros.name('imu/data_raw'), qos)
        ros.until(lambda said=said: health.said('reception', said))
        ros.node.destroy_publisher(other)
    elsewhere, own = (ros.node.create_publisher(Temperature, ros.name(topic), 10)
                      for topic in ('motor/temperature', 'imu/temperature'))
    ros.until(own.get_subscription_count)
    assert not elsewhere.get_subscription_count()
    ros.until(lambda: f'temperature from {own.topic_name}, the only thermometer in the namespace '
              'of the IMU' in node.lines)


def test_nothing_is_drawn_while_nobody_watches(shared_ros, shared_driver, node):
    maps = Path(f'/proc/{node.popen.pid}/maps')
    if not maps.exists():
        pytest.skip('no /proc here')
    arrays = shared_ros.listen(DiagnosticArray, 'imu_allan/coefficients')
    shared_driver.publish(1000)
    shared_ros.until(lambda: len(arrays) > 0)
    assert 'matplotlib' not in maps.read_text()
    images = shared_ros.listen(CompressedImage, 'imu_allan/plot/compressed')
    [image, *_] = shared_ros.until(lambda: images)
    assert (image.format, bytes(image.data[:4])) == ('png', b'\x89PNG')
    assert 'matplotlib' in maps.read_text()
    assert shared_ros.call(Trigger, 'imu_allan/reset').success


def test_a_pause_passes_samples_over_and_counts_as_a_gap(shared_ros, shared_driver, node):
    ros, driver, health = shared_ros, shared_driver, Health(shared_ros)
    before = driver.next

    def received(count):
        ros.until(lambda: health.number('reception', 'received') == before + count)

    # What the test before left under way belongs to no run of this one.
    received(0)
    assert ros.call(Trigger, 'imu_allan/reset').success
    driver.publish(600)
    received(600)
    for data in False, True, True:
        assert ros.call(SetBool, 'imu_allan/pause', SetBool.Request(data=data)).success
    driver.publish(400)
    received(1000)
    assert health.number('reception', 'passed_over') == 400
    assert health.said('reception', 'paused: samples are passed over')
    assert ros.call(SetBool, 'imu_allan/pause', SetBool.Request(data=False)).success
    driver.publish(600)
    received(1600)
    assert ros.call(SetBool, 'imu_allan/pause').message == 'not paused'
    assert [line for line in node.lines if 'pause' in line] == [
        'paused: samples are passed over', 'going on; the pause counts as a gap']
    assert health.number('reception', 'lost') == 0
    timeline = ros.saved()['timeline']
    assert (timeline['samples'], timeline['missing']) == (1200, 400)
    [gap] = timeline['gaps']
    assert gap['duration_s'] == pytest.approx(400 / RATE_HZ, rel=1e-6)


def test_silence_is_reported_with_the_topics_that_there_are(shared_ros, shared_driver, node):
    other = Driver(shared_ros, 'camera/imu')
    # Another node waits for an Imu where only temperatures are published.
    shared_ros.start('imu_allan_node', namespace=shared_ros.name('camera'),
                     remaps={'imu/data_raw': 'temperature'})
    shared_ros.node.create_publisher(Temperature, shared_ros.name('camera/temperature'), 1)
    shared_ros.node.destroy_publisher(shared_driver.publisher)
    # The first complaint may have come while the publisher was still there.
    shared_ros.until(lambda: Varying(
        f'no message on {shared_driver.topic} for <number> s; Imu topics here: {other.topic}; '
        'choose one with --ros-args -r imu/data_raw:=TOPIC') in node.lines)
    Driver(shared_ros).wait_for_node().publish(1)
    shared_ros.until(lambda: f'messages come on {shared_driver.topic}' in node.lines)
    assert node.stop() == 0


@pytest.mark.parametrize('program', ENTRY_POINTS)
@pytest.mark.parametrize(('arguments', 'status', 'line'), [
    ([], 1, f'needs ROS 2, which {sys.executable} cannot import (No module named '
     "'rclpy'); source a ROS 2 installation (source /opt/ros/jazzy/setup.bash) or install the "
     "wheels: pip install 'imu_allan[ros]'"),
    (['publish_period=5.0'], 2, "'publish_period=5.0' is no argument; give parameters as "
     '--ros-args -p publish_period:=5.0')])
def test_without_ros_or_ros_args_a_line_says_what_to_do(
        tmp_path, program, arguments, status, line):
    (tmp_path / 'rclpy.py').write_text(
        'raise ModuleNotFoundError("No module named \'rclpy\'", name="rclpy")')
    paths = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', '')])
    done = python('-m', ENTRY_POINTS[program], *arguments, env={**os.environ, 'PYTHONPATH': paths})
    assert (done.returncode, done.stdout, done.stderr) == (status, '', f'{program}: {line}\n')


@pytest.mark.parametrize(('program', 'module'), [
    ('imu_simulator', 'numpy'), ('imu_allan_node', 'rclpy')])
def test_ctrl_c_while_a_node_starts_ends_it_without_a_traceback(ros, program, module):
    done = interrupted(ENTRY_POINTS[program], module, '--ros-args', '-r',
                       f'__ns:={ros.namespace}', '-p', f'state_file:={ros.folder / "state"}')
    assert (done.returncode, 'Traceback' in done.stderr) == (0, False), done.stderr


@pytest.mark.usefixtures('ros_context')
def test_the_node_imports_nothing_from_the_current_folder(tmp_path):
    current, trace, script = tmp_path / 'current', tmp_path / 'ran', tmp_path / 'bin' / 'node'
    current.mkdir()
    for name in ('rclpy', 'sensor_msgs', 'numpy', 'scipy', 'pickle', 'struct', 'argparse',
                 'imu_allan', 'matplotlib', 'multiprocessing', 'yaml', 'sitecustomize'):
        (current / f'{name}.py').write_text(
            f'open({str(trace)!r}, "a").write("{name}\\n")\nraise SystemExit(99)\n')
    script.parent.mkdir()
    script.write_text('import sys\nfrom imu_allan.node.imu_allan_node import main\n'
                      'sys.exit(main())\n')
    # What is wrong is said once all has been imported.
    done = python(script, '--ros-args', '-p', 'motion:=ignore', cwd=current)
    assert not trace.exists(), trace.read_text()
    assert done.stderr == ("imu_allan_node: parameter motion: 'ignore' is not one of exclude, "
                           'keep\n')
