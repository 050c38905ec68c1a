# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Services and parameters in any order and at any pace, while samples come in."""

import random
import time

import pytest
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import GetParameters, SetParameters
from repeated import slow
from ros_harness import assert_kept_up, Driver, Health, too_early
from sensor_msgs.msg import CompressedImage
from std_srvs.srv import SetBool, Trigger

NAMES = ('publish_period', 'output_dir', 'state_file', 'checkpoint_period', 'motion', 'clock',
         'expected_rate', 'gap_tolerance', 'export_for', 'use_sim_time', 'no_such_parameter', '',
         'qos_overrides./imu/data_raw.subscription.depth')
NUMBERS = (0, 1, -1, 5, 2**31, 2**63 - 1, -2**63)
DOUBLES = (0.0, -0.0, 0.5, 1.0, 1e-300, 1e300, -1.0, float('nan'), float('inf'))
TEXTS = ('', 'keep', 'header', 'kalibr', '/', '\0', '\x1b[2J', 'ü' * 50, '../..', 'a\nb', '%s{}')
AT_A_TIME = 5
"""Requests to one service that wait for their answer; the queue of a client holds ten answers."""


def any_value(draw):
    kind = draw.randrange(10)
    texts = [draw.choice(TEXTS) for _ in range(draw.randrange(4))]
    return ParameterValue(
        type=kind, bool_value=draw.random() < 0.5, integer_value=draw.choice(NUMBERS),
        double_value=draw.choice(DOUBLES), string_value=draw.choice(TEXTS).replace('\0', ''),
        byte_array_value=[b'\0', b'\xff'], bool_array_value=[True, False],
        integer_array_value=[draw.choice(NUMBERS)], double_array_value=[draw.choice(DOUBLES)],
        string_array_value=[text.replace('\0', '') for text in texts])


class Client:
    """Asks without waiting for every answer, and keeps what was answered."""

    def __init__(self, ros):
        self._ros = ros
        self._clients = {}
        self._asked = []

    def ask(self, kind, service, request=None):
        if service not in self._clients:
            client = self._ros.node.create_client(kind, self._ros.name(f'imu_allan/{service}'))
            self._ros.until(client.service_is_ready)
            self._clients[service] = client
        self._ros.until(lambda: self.has_room(service))
        self._asked.append((service, self._clients[service].call_async(request or kind.Request())))

    def has_room(self, service):
        """Whether a further request to the service need not wait."""
        return sum(not future.done() for name, future in self._asked
                   if name == service) < AT_A_TIME

    def answers(self, *services):
        self._ros.until(lambda: all(future.done() for _, future in self._asked))
        return [future.result() for name, future in self._asked if name in services]

    def ask_anything(self, draw):
        # Not where the node writes: these tests leave nothing outside of their folder.
        names = [draw.choice([name for name in NAMES if name != 'output_dir'])
                 for _ in range(draw.randrange(3))]
        self.ask(*draw.choice((
            (Trigger, 'save'), (Trigger, 'reset'),
            (SetBool, 'pause', SetBool.Request(data=draw.random() < 0.5)),
            (GetParameters, 'get_parameters', GetParameters.Request(names=[draw.choice(NAMES)])),
            *[(SetParameters, 'set_parameters', SetParameters.Request(parameters=[
                Parameter(name=name, value=any_value(draw)) for name in names]))] * 2)))


def assert_well(node):
    assert node.running, node.log
    assert 'Traceback' not in node.log, node.log


@pytest.mark.parametrize(('requests', 'seed'), [(60, 1), slow(10_000, 2)])
def test_services_in_any_order_leave_a_node_that_works(ros, requests, seed):
    node = ros.start('imu_allan_node', {'publish_period': 0.5, 'checkpoint_period': 1.0,
                                        'state_file': str(ros.folder / 'state')})
    driver = Driver(ros).wait_for_node()
    draw, client = random.Random(seed), Client(ros)
    for _ in range(requests):
        client.ask_anything(draw)
        if draw.random() < 0.5:
            driver.publish(draw.randrange(200))
        if draw.random() < 0.1:
            ros.executor.spin_once(timeout_sec=draw.random() * 0.2)
        assert_well(node)
    assert all(answer.message for answer in client.answers('save', 'reset', 'pause'))
    assert all(result.successful or result.reason
               for answer in client.answers('set_parameters') for result in answer.results)
    # After all that it still does what it is for.
    assert ros.call(SetParameters, 'imu_allan/set_parameters', SetParameters.Request(
        parameters=[Parameter(name='export_for', value=ParameterValue(
            type=ParameterType.PARAMETER_STRING_ARRAY, string_array_value=['kalibr']))]
    )).results[0].successful
    assert ros.call(SetBool, 'imu_allan/pause').success
    assert ros.call(Trigger, 'imu_allan/reset').success
    driver.publish(3000)
    assert ros.until(ros.saved)
    assert node.stop() == 0


def test_a_request_that_rclpy_cannot_read_ends_no_run(ros):
    node = ros.start('imu_allan_node')
    driver = Driver(ros).wait_for_node()
    driver.publish(1000)
    client = ros.node.create_client(SetParameters, ros.name('imu_allan/set_parameters'))
    ros.until(client.service_is_ready)
    # No parameter has such a type. There is no answer.
    client.call_async(SetParameters.Request(parameters=[
        Parameter(name='publish_period', value=ParameterValue(type=200))]))
    ros.until(lambda: 'a request failed (ValueError: 200 is not a valid Parameter.Type); the node '
              'goes on' in node.lines)
    driver.publish(1000)
    driver.until_taken()
    assert ros.saved()['timeline']['samples'] == 2000
    assert node.stop() == 0


def test_a_save_that_waits_keeps_what_it_was_asked_for_over_a_reset(ros):
    node = ros.start('imu_allan_node', {'publish_period': 86_400.0})
    driver, client = Driver(ros), Client(ros)
    driver.wait_for_node()
    driver.publish(3000)
    # None may come after the reset.
    assert ros.saved_with(3000)
    # Once the first is answered, both sides know of the client: no request is sent twice.
    client.ask(Trigger, 'save')
    assert client.answers('save')
    # Nothing orders requests to different services, but what was asked several requests ago has
    # been taken.
    for _ in range(2):
        client.ask(Trigger, 'save')
    for _ in range(10):
        ros.call(GetParameters, 'imu_allan/get_parameters', GetParameters.Request())
    assert ros.call(Trigger, 'imu_allan/reset').success
    client.ask(Trigger, 'save')
    answers = client.answers('save')
    assert sorted(answer.success for answer in answers) == [False, True, True, True], answers
    assert_well(node)


@pytest.mark.parametrize('seconds', [2.0, slow(60.0)])
def test_saves_and_other_calls_beside_a_1_khz_imu_lose_no_sample(ros, seconds):
    node = ros.start('imu_allan_node', {'publish_period': 2.0}, best_effort=True,
                     shared_memory=True)
    health, client = Health(ros), Client(ros)
    images = ros.listen(CompressedImage, 'imu_allan/plot/compressed')
    simulator = ros.start('imu_simulator', {
        'rate': 1000.0, 'wait_for_subscriptions': 1}, shared_memory=True)
    ros.until(lambda: 'publishing' in simulator.log)
    began = time.monotonic()
    for number in range(round(100 * seconds)):
        if number % 50 or not client.has_room('save'):
            client.ask(*((SetBool, 'pause'), (GetParameters, 'get_parameters'))[number % 2])
        else:
            client.ask(Trigger, 'save')
        while time.monotonic() < began + number / 100:
            ros.executor.spin_once(timeout_sec=0.002)
    saves = client.answers('save')
    ros.until(lambda: images and health.number('reception', 'received') >= seconds * 1000)
    assert simulator.running
    assert_kept_up(node, health, 1000.0)
    assert not [answer for answer in saves if not answer.success and not too_early(answer)]
    assert node.stop() == 0
