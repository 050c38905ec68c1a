# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Real nodes in processes of their own, and a node of the test's own that speaks to them."""

from collections.abc import Callable, Mapping, Sequence
import contextlib
import json
from math import sqrt
import os
from pathlib import Path
import re
import signal
import subprocess
import sys
import time
from types import MappingProxyType
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu_rows
from imu_allan.characterization import Characterization
from imu_allan.node.diagnostics import Facts
from imu_allan.node.drained_subscription import DrainedSubscription
from imu_allan.node.run import Saved
from imu_allan.node.storage import decode_state
from imu_allan.noise.terms import AXES
from imu_allan.result import Timeline
from imu_allan.state import restored
from imu_allan.timeline import TimelineSummary
import numpy as np
import pytest
from rclpy._rclpy_pybind11 import RCLError
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import Imu
from std_srvs.srv import SetBool, Trigger
from whole_lines import Varying

NOTHING: Mapping[str, Any] = MappingProxyType({})
LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                     durability=DurabilityPolicy.TRANSIENT_LOCAL)
ENTRY_POINTS = {name: f'imu_allan.node.{name}' for name in ('imu_allan_node', 'imu_simulator')}
PATIENCE_S = 300.0
"""Only what hangs takes so long, however slow or busy the computer is."""
ASKED_AGAIN_S = 5.0
"""Without an answer for so long a request may have gone to a node that was killed."""
STARVED_S = 2.0
"""A node alone with a busy core waits for tenths of a second in all."""

RATE_HZ = 200.0
HALF_RATES_HZ = {'gyro': 200.0, 'accel': 125.0}
NOISE = 0.01
"""Of a sample of a `Driver` and of a `Sensor`."""
SECOND = 1_000_000_000
START_NS = 1_700_000_000 * SECOND
_NO_SERVICES: dict[str, Any] = {'enable_rosout': False, 'start_parameter_services': False}
"""What a node of a test itself does not need, and nobody has to discover."""
LARGEST_MB = 400
"""Memory of a node, whatever is done to it."""


class Process:
    def __init__(self, program: str, args: Sequence[str], log: Path, env: Mapping[str, str],
                 polite: bool, wrapper: Sequence[str]) -> None:
        self.log_path = log
        self.polite = polite
        self.awaited = False
        start = f'import sys; from {ENTRY_POINTS[program]} import main; sys.exit(main())'
        with log.open('wb') as output:
            self.popen = subprocess.Popen([*wrapper, sys.executable, '-c', start, *args],
                                          stdout=output, stderr=subprocess.STDOUT,
                                          env={**os.environ, **env})

    @property
    def log(self) -> str:
        return self.log_path.read_text()

    @property
    def lines(self) -> list[str]:
        return said_in(self.log)

    @property
    def running(self) -> bool:
        return self.popen.poll() is None

    @property
    def failed(self) -> bool:
        """Whether it has ended by itself, and not well, though nobody waits for its end."""
        return not self.awaited and self.popen.poll() not in (
            None, 0, -signal.SIGINT, -signal.SIGTERM, -signal.SIGKILL)

    def scheduled_s(self, waiting: bool = False) -> float:
        """Time for which its threads ran, or were ready to run while others had the cores."""
        threads = Path(f'/proc/{self.popen.pid}/task').iterdir()
        return sum(int((thread / 'schedstat').read_text().split()[waiting])
                   for thread in threads) * 1e-9

    @property
    def starved_s(self) -> float:
        return self.scheduled_s(waiting=True)

    def wait(self, timeout: float = PATIENCE_S) -> int:
        self.awaited = True
        try:
            return self.popen.wait(timeout)
        except subprocess.TimeoutExpired:
            raise AssertionError(f'still running after {timeout} s:\n{self.log}') from None

    def stop(self, number: signal.Signals = signal.SIGINT, within_s: float = PATIENCE_S) -> int:
        """Send a signal and return the exit status; no traceback may have been in the log."""
        before, end = self.starved_s, time.monotonic() + within_s
        self.popen.send_signal(number)
        starved_s = before
        # For what the computer keeps it waiting the node is not to blame.
        while self.running and time.monotonic() < end + starved_s - before:
            time.sleep(0.05)
            with contextlib.suppress(OSError):
                starved_s = max(starved_s, self.starved_s)
        status = self.wait(0.1)
        assert 'Traceback' not in self.log, self.log
        return status


def lossless(topic: str) -> dict[str, str]:
    """Give parameters with which a subscriber makes a publisher that keeps all wait for it."""
    return {f'qos_overrides.{topic}.subscription.reliability': 'reliable',
            f'qos_overrides.{topic}.subscription.history': 'keep_all'}


def said_in(log: str) -> list[str]:
    """Return the lines of a log, without level, time and name of the node."""
    return [re.sub(r'^\[[A-Z]+\] \[[\d.]+\] \[[^\]]*\]: ', '', line) for line in log.splitlines()]


def too_early(response: Any) -> bool:
    """Whether a save failed because the first samples tell nothing, or no noise density, yet."""
    return ('nothing to save' in response.message
            or 'has a noise density (constant or too short)' in response.message)


class Heard:
    def __init__(self) -> None:
        self.lines: list[str] = []

    def __getattr__(self, level: str) -> Callable[[str], None]:
        return lambda text: self.lines.append(f'{level} {text}')


class Ros:
    """A test's own node, and the processes it starts in a namespace of their own."""

    def __init__(self, context: Context, folder: Path, namespace: str) -> None:
        self.folder = folder
        self.namespace = namespace
        self._context = context
        self.node = Node('tester', namespace=namespace, context=context, **_NO_SERVICES)
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)
        self._processes: list[Process] = []
        self._recorders: list[Node] = []

    def name(self, topic: str) -> str:
        return f'{self.namespace}/{topic}'

    def start(self, program: str, parameters: Mapping[str, Any] = NOTHING,
              *, remaps: Mapping[str, str] = NOTHING, files: tuple[Path, ...] = (),
              env: Mapping[str, str] = NOTHING, namespace: str = '',
              best_effort: bool = False, shared_memory: bool = False,
              prepend_path: Path | None = None, wrapper: Sequence[str] = (),
              constants: Mapping[str, float] = NOTHING) -> Process:
        """Start a node, which gets every sample unless `best_effort`; `constants` as LOOK_S."""
        # With the transports that DDS chooses by default, `shared_memory`, it is ended in peace.
        namespace, given = namespace or self.namespace, dict(parameters)
        if program == 'imu_allan_node':
            given.setdefault('output_dir', str(self.folder / 'output'))
            if not best_effort:
                given |= lossless(f'{namespace}/{remaps.get("imu/data_raw", "imu/data_raw")}')
        args = ['--ros-args', *arguments(given), *(
            word for file in files for word in ('--params-file', str(file)))]
        for names in {'__ns': namespace, **remaps}.items():
            args += ['-r', ':='.join(names)]
        environment = dict(env)
        if shared_memory:
            environment['FASTDDS_BUILTIN_TRANSPORTS'] = 'DEFAULT'
        if constants:
            prepend_path = self.folder / f'constants_{len(self._processes)}'
            prepend_path.mkdir()
            (prepend_path / 'sitecustomize.py').write_text(''.join(
                f'import imu_allan.node.{name.partition(".")[0]}\n'
                f'imu_allan.node.{name} = {value}\n' for name, value in constants.items()))
        if prepend_path is not None:
            environment['PYTHONPATH'] = f'{prepend_path}:{os.environ.get("PYTHONPATH", "")}'
        return self.started(program, args, environment, shared_memory, wrapper)

    def started(self, program: str, args: Sequence[str], env: Mapping[str, str] = NOTHING,
                polite: bool = False, wrapper: Sequence[str] = ()) -> Process:
        log = self.folder / f'{program}_{len(self._processes)}.log'
        process = Process(program, args, log, env, polite, wrapper)
        self._processes.append(process)
        return process

    def until(self, condition: Callable[[], Any], timeout: float = PATIENCE_S) -> Any:
        """Spin until `condition` gives something true, and return it."""
        end = time.monotonic() + timeout
        while not (found := condition()):
            dead = [p.log_path.name for p in self._processes if p.failed]
            if dead or time.monotonic() > end:
                logs = '\n'.join(f'-- {p.log_path.name}\n{p.log}' for p in self._processes)
                why = f'{", ".join(dead)} ended' if dead else f'did not come true in {timeout} s'
                raise AssertionError(f'{why}\n{logs}')
            self.executor.spin_once(timeout_sec=0.1)
        return found

    def listen(self, kind: type, topic: str, qos: QoSProfile | int = LATCHED,
               callback: Callable[[Any], None] | None = None) -> list[Any]:
        """Subscribe; return the list into which messages come."""
        messages: list[Any] = []
        full = topic if topic.startswith('/') else self.name(topic)
        self.node.create_subscription(kind, full, callback or messages.append, qos)
        return messages

    def saved(self, node: str = 'imu_allan') -> Any:
        """Have a node save; give the document, or None as long as there is nothing to save."""
        response = self.call(Trigger, f'{node}/save')
        if not response.success:
            assert too_early(response), response.message
            return None
        return json.loads(Path(response.message.splitlines()[0]).read_text())

    def saved_with(self, samples: int) -> Any:
        """Have the node save until it has so many samples; give the document."""
        return self.until(lambda: (document := self.saved())
                          and document['timeline']['samples'] == samples and document)

    def results(self) -> list[Any]:
        return [json.loads(path.read_text())
                for path in sorted((self.folder / 'output').rglob('result.json'))]

    def recorder(self, topic: str = 'imu/data_raw') -> DrainedSubscription:
        """Subscribe to an Imu topic so that a simulator at full speed waits for it."""
        full = self.name(topic)
        overrides = [Parameter(key, value=value) for key, value in lossless(full).items()]
        self._recorders.append(Node(
            f'recorder{len(self._recorders)}', namespace=self.namespace, context=self._context,
            parameter_overrides=overrides, **_NO_SERVICES))
        return DrainedSubscription(self._recorders[-1], Imu, full, 10_000)

    def call(self, kind: type, service: str, request: Any = None) -> Any:
        client = self.node.create_client(kind, self.name(service))
        self.until(client.service_is_ready)
        end = time.monotonic() + PATIENCE_S
        # The service of a killed node seems ready until its lease has run out: it is asked again.
        # A busy one answers late: ever less often. An answer to an earlier request is as good.
        asked: list[Any] = []

        def answered() -> list[Any]:
            return [future for future in asked if future.done()]

        while not answered() and time.monotonic() < end:
            asked.append(client.call_async(request or kind.Request()))
            with contextlib.suppress(AssertionError):
                self.until(answered, ASKED_AGAIN_S * 2**(len(asked) - 1))
        assert answered(), f'{service} does not answer'
        # What was asked twice must not happen in the middle of what comes next. Requests come in
        # order: one before the last that has no answer has gone to a node that was killed.
        with contextlib.suppress(AssertionError):
            self.until(asked[-1].done, 4 * ASKED_AGAIN_S)
        result = answered()[0].result()
        self.node.destroy_client(client)
        return result

    def close(self) -> None:
        # The test's own nodes go first: where others vanished in the same moment, Fast DDS has
        # crashed in `destroy_node` now and then.
        self.executor.shutdown()
        for node in (self.node, *self._recorders):
            node.destroy_node()
        running = [process for process in self._processes if process.running]
        for process in running:
            process.popen.send_signal(signal.SIGTERM if process.polite else signal.SIGKILL)
        for process in running:
            process.wait()


class Health:
    """What ``/diagnostics`` says of the node of a test."""

    def __init__(self, ros: Ros) -> None:
        self._ros = ros
        self.heard: list[DiagnosticStatus] = []
        self.stamp_s = -1
        ros.listen(DiagnosticArray, '/diagnostics', 10, self._hear)

    def _hear(self, report: DiagnosticArray) -> None:
        own = [status for status in report.status
               if status.name.startswith(f'{self._ros.name("imu_allan")}: ')]
        self.heard += own
        if own:
            self.stamp_s = report.header.stamp.sec

    def status(self, part: str) -> DiagnosticStatus | None:
        """Give the last status of a part, such as reception; None before it has come."""
        return next((status for status in reversed(self.heard)
                     if status.name.endswith(f': {part}')), None)

    def level(self, part: str) -> bytes:
        found = self.status(part)
        return DiagnosticStatus.STALE if found is None else bytes(found.level)

    def values(self, part: str) -> dict[str, str]:
        return entries(self.status(part) or DiagnosticStatus())

    def number(self, part: str, key: str) -> float:
        """Give one of its values; NaN before it has come."""
        return float(self.values(part).get(key, 'nan'))

    def said(self, part: str, message: 'str | Varying', level: bytes | None = None) -> bool:
        """Whether it has ever said so."""
        return any(status.name.endswith(f': {part}') and message == status.message
                   and level in (None, status.level) for status in self.heard)

    def news(self) -> None:
        """Wait for what is said from now on."""
        self.heard.clear()
        self._ros.until(lambda: self.heard)


def entries(status: DiagnosticStatus) -> dict[str, str]:
    return {entry.key: entry.value for entry in status.values}


class Driver:
    """An IMU driver; with a `depth` it does not wait for subscribers that were killed."""

    def __init__(self, ros: Ros, topic: str = 'imu/data_raw', depth: int = 0) -> None:
        self.ros = ros
        self.publisher: Publisher = ros.node.create_publisher(
            Imu, ros.name(topic), QoSProfile(
                history=HistoryPolicy.KEEP_LAST if depth else HistoryPolicy.KEEP_ALL,
                depth=depth, reliability=ReliabilityPolicy.RELIABLE))
        self.topic = ros.name(topic)
        self.dead: set[bytes] = set()
        self.random = np.random.default_rng(5)
        self.next = 0

    def subscriptions(self) -> set[bytes]:
        """Endpoints that are known on the topic, those of killed nodes among them."""
        found = self.ros.node.get_subscriptions_info_by_topic(self.topic)
        return {bytes(info.endpoint_gid) for info in found}

    def wait_for_node(self) -> 'Driver':
        """Wait until the subscription of a living node is matched; return the driver."""
        def matched() -> bool:
            known = self.subscriptions()
            return bool(known - self.dead) and (
                self.publisher.get_subscription_count() == len(known))

        self.ros.until(matched)
        return self

    def until_taken(self) -> None:
        """Wait until the node has taken all that was published."""
        assert self.publisher.wait_for_all_acked()
        # Going on, not having paused, takes what has come.
        assert self.ros.call(SetBool, 'imu_allan/pause').success

    def publish(self, count: int, frame_id: str = 'imu', shaken: float = 1.0) -> None:
        """Publish samples of white noise, `shaken` times that at rest."""
        self.replay(at_rest(count, RATE_HZ, start_s=self.next / RATE_HZ, seed=self.random,
                            noise=shaken * NOISE, frame_id=frame_id))
        self.next += count

    def replay(self, block: ImuBlock) -> None:
        for row in encode_imu_rows(block):
            self.send(row.tobytes())

    def send(self, message: bytes) -> None:
        """Publish a serialized message, as soon as there is room for it."""
        end = time.monotonic() + PATIENCE_S
        while True:
            try:
                self.publisher.publish(message)
            except RCLError:
                # A publisher that keeps all waits a tenth of a second for a subscriber; on a busy
                # computer that takes longer to come to its turn.
                if time.monotonic() > end:
                    raise
            else:
                return


def at_rest(count: int, rate_hz: float = 100.0, *, start_s: float = 0.0, seed: Any = 1,
            noise: float = NOISE, mean: Any = (0, 0, 0, 0, 0, 9.8), polled: int = 1,
            together: bool = False, frame_id: str = 'imu') -> ImuBlock:
    """Give an IMU of white noise whose samples come `polled` times each, if wanted at once."""
    index = np.arange(count * polled)
    index -= index % polled if together else 0
    stamps = START_NS + np.rint((start_s + index / rate_hz / polled) * SECOND).astype(np.int64)
    samples = np.random.default_rng(seed).normal(mean, noise, (count, 6))
    return ImuBlock(stamps, stamps, np.repeat(samples, polled, axis=0),
                    np.zeros((len(stamps), 2), bool), frame_id)


def half(name: str, seconds: float, start_s: float = 0.0, rate_hz: float = 0.0) -> ImuBlock:
    """Give messages of one sensor of an IMU on two topics; the other half of each is zero."""
    rate_hz = rate_hz or HALF_RATES_HZ[name]
    block = at_rest(round(seconds * rate_hz), rate_hz, start_s=start_s,
                    seed=len(name) + round(start_s), frame_id=f'{name}_frame')
    block.samples[:, slice(3, 6) if name == 'gyro' else slice(3)] = 0
    return block


class Sensor:
    """An IMU of white noise whose driver may come and go; time goes on all the while."""

    def __init__(self, ros: Ros, rate_hz: float = 50.0, seed: int = 1) -> None:
        self.ros = ros
        self.rate_hz = rate_hz
        self.now_s = 0.0
        self.random = np.random.default_rng(seed)
        self.bias = np.array([0, 0, 0, 0, 0, 9.8])
        self.noise = NOISE
        self.sent = 0
        self.driver: Driver | None = None

    def plug_in(self, away_s: float = 3.0) -> None:
        """Start the driver, anew if it runs."""
        self.unplug()
        self.now_s += away_s
        self.driver = Driver(self.ros).wait_for_node()

    def unplug(self) -> None:
        """End the driver, which has sent everything."""
        if self.driver is not None:
            assert self.driver.publisher.wait_for_all_acked()
            self.ros.node.destroy_publisher(self.driver.publisher)
            self.driver = None

    def measure(self, seconds: float, polled: int = 1, frame_id: str = 'imu') -> None:
        """Publish what it measures meanwhile, each sample so many times."""
        count = round(seconds * self.rate_hz)
        self.driver.replay(at_rest(
            count, self.rate_hz, start_s=self.now_s, seed=self.random, noise=self.noise,
            mean=self.bias, polled=polled, frame_id=frame_id))
        self.now_s += seconds
        self.sent += count


def assert_density(document: Mapping[str, Any], rate_hz: float, noise: float = NOISE) -> None:
    for name in AXES:
        low, high = document['axes'][name]['coefficients']['noise_density']['ci95']
        # Three intervals wide, so that chance has no say.
        assert low - (high - low) < noise / sqrt(rate_hz) < high + (high - low), (name, low, high)


def assert_kept_up(node: Process, health: Health, rate_hz: float) -> None:
    """Nothing may be lost, and reception not be held up for longer than half the queue lasts."""
    lost, queue = (health.number('reception', key) for key in ('lost', 'queue'))
    longest_hold_s = max(float(entry.value) for status in health.heard for entry in status.values
                         if entry.key == 'longest_hold_s')
    if (lost or longest_hold_s * rate_hz >= queue / 2) and node.starved_s > STARVED_S:
        pytest.skip(f'the computer kept the node waiting for {node.starved_s:.1f} s')
    assert lost == 0
    assert longest_hold_s * rate_hz < queue / 2


def kept_in(state_file: Path) -> TimelineSummary:
    """Tell what a state file holds of its messages; nothing if it is not there yet."""
    if not state_file.exists():
        return Characterization(kind='topic').summary()
    [lane] = restored(Saved, decode_state(state_file.read_bytes())).runs[0].lanes
    return lane.characterization.summary()


def resident_mb(pid: int) -> float:
    pages = Path(f'/proc/{pid}/statm').read_text().split()[1]
    return int(pages) * 4096 / 1e6


def start_repeatedly(ros: Ros, arguments: Sequence[Sequence[str]],
                     env: Mapping[str, str] = NOTHING) -> list[tuple[int, str]]:
    """Start a node with each arguments in turn, in one process; give status and output."""
    code = """
import json, sys
from imu_allan.node.characterization_node import CharacterizationNode
from imu_allan.node.program import run_program
CharacterizationNode.serve = lambda node, stop: 0
for arguments in json.loads(sys.argv[1]):
    status = run_program('imu_allan_node',
                         'imu_allan.node.characterization_node.CharacterizationNode',
                         ['--ros-args', *arguments])
    print('== status', status, file=sys.stderr, flush=True)
"""
    given = [['-r', f'__ns:={ros.namespace}', *words] for words in arguments]
    done = subprocess.run([sys.executable, '-c', code, json.dumps(given)], check=True,
                          text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                          env={**os.environ, **env})
    parts = re.split(r'== status (\d+)\n', done.stdout)
    return [(int(status), text) for text, status in zip(parts[::2], parts[1::2], strict=False)]


def facts(recent: Mapping[str, int] = NOTHING, **changes: Any) -> Facts:
    """Give what a node that is well counts, and what of it is recent."""
    made = Facts(**{'topic': '/imu', 'queue': 10_000, 'expected_rate': 0.0,
                    'publishers': 1, 'received': 100, 'received_hz': 100.0, **changes})
    made.recent.see(0.0, recent)
    return made


def summary(**changes: Any) -> TimelineSummary:
    """Give what the timeline says of ten good seconds."""
    return TimelineSummary(**{
        'timeline': Timeline(100.0, 1000, 10.0), 'clock': 'header', 'frame_id': 'imu',
        'start_time': None, 'remarks': (), 'present': (True,) * 6, 'measured_rate_hz': 100.0,
        'jitter_s': 1e-5, **changes})


def arguments(parameters: Mapping[str, Any]) -> list[str]:
    return [word for key, value in parameters.items()
            for word in ('-p', f'{key}:={json.dumps(value)}')]
