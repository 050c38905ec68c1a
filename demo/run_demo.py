# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The main job in about a minute: `make demo`.

A simulated MEMS IMU publishes sensor_msgs/Imu from a process of its own, faster than real time by
its header stamps. The node, in another process, characterizes it live: its coefficients converge
on the screen beside the true values. This process records what is published as a rosbag2
recording; the offline tool analyzes that recording and must find the same numbers.

`make demo RECORDING=path` analyzes a recording of yours instead.
"""

import argparse
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, ExitStack
import json
import os
from pathlib import Path
import random
import shutil
import signal
import subprocess
import sys
import time
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.cdr import batches_of
from imu_allan.errors import ImuAllanError
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.recordings.messages.imus_in import IMU_MESSAGES
from imu_allan.recordings.write import write_recording
from imu_allan.sensor.noise_model import load_model, NoiseModel
from imu_allan.sensor.units import engineering
from rich import box
from rich.console import Console, Group
from rich.live import Live
from rich.table import Table
from rich.text import Text

SHOWN_TERMS = ('noise_density', 'bias_instability', 'rate_random_walk')
AGREEMENT = 1e-9
"""The node and the recording tool may differ by no more than this, relatively."""

CONSOLE = Console(highlight=False)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the demo and return the exit status."""
    folder = Path(__file__).resolve().parents[1]
    parser = argparse.ArgumentParser(description=__doc__.partition('\n\n')[0])
    parser.add_argument('--recording', help='analyze this recording, simulate nothing')
    parser.add_argument('--topic', help='its Imu topic, where there are several')
    parser.add_argument('--output', type=Path, default=Path('demo_output'))
    parser.add_argument('--model', type=Path, default=folder / 'config' / 'consumer_mems.yaml')
    parser.add_argument('--rate', type=float, default=100.0, help='samples per simulated second')
    parser.add_argument('--hours', type=float, default=1.5, help='simulated time')
    args = parser.parse_args(argv)
    try:
        if args.recording is not None:
            return show_recording(args.recording, args.topic, args.output)
        return show_simulation(args.model, args.rate, args.hours * 3600, args.output)
    except ImuAllanError as error:
        print(f'demo: {error}', file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        return 130


def show_recording(recording: str, topic: str | None, output: Path) -> int:
    """Analyze a recording of the user's."""
    analyze(recording, output, *(('--topic', topic) if topic else ()))
    list_files(output)
    say_what_next()
    return 0


def show_simulation(model_file: Path, rate_hz: float, seconds: float, output: Path) -> int:
    """Characterize a simulated IMU live and again from its recording."""
    model = load_model(model_file)
    for stale in ('live', 'recording'):
        shutil.rmtree(output / stale, ignore_errors=True)
    output.mkdir(parents=True, exist_ok=True)
    CONSOLE.print(
        f'[bold]Live[/]: a simulated IMU ({model.name or model_file.stem}) publishes '
        f'{seconds / 3600:g} h of sensor_msgs/Imu at {rate_hz:g} Hz, as fast as it is taken.\n'
        'Every value of the node stands beside the truth; green: the truth lies within its 95 % '
        'interval.', soft_wrap=True)
    live = characterize_live(model_file, model, rate_hz, seconds, output)
    recording = output / 'recording'
    CONSOLE.print(f'\n[bold]Offline[/]: imu_allan analyze {recording} --output {output} '
                  '--clock header', soft_wrap=True)
    # The simulated clock is faster than that of the recorder.
    analyze(str(recording), output, '--clock', 'header')
    offline = json.loads((output / 'result.json').read_text())
    numbers, difference = largest_difference(estimates(live), estimates(offline))
    agree = difference <= AGREEMENT and (live['timeline']['samples']
                                         == offline['timeline']['samples'])
    CONSOLE.print(
        f'\n[bold]{"The same numbers" if agree else "NOT the same numbers"}[/]: node and '
        f'recording differ by at most {difference:.1e} (relative, {numbers:,} numbers from '
        f'{live["timeline"]["samples"]:,} and {offline["timeline"]["samples"]:,} samples).',
        soft_wrap=True)
    list_files(output, published=True)
    say_what_next()
    return 0 if agree else 1


def characterize_live(model_file: Path, model: NoiseModel, rate_hz: float, seconds: float,
                      output: Path) -> dict[str, Any]:
    """Run simulator and node, record what passes between them, return the node's result."""
    # Discovery must reach nobody else's robot, and nobody else's topics must reach the node.
    os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
    os.environ['ROS_DOMAIN_ID'] = str(random.SystemRandom().randint(1, 101))
    os.environ['ROS_LOG_DIR'] = str((output / 'live' / 'log').resolve())
    namespace = f'/imu_allan_demo_{os.getpid()}'
    topic = f'{namespace}/imu/data_raw'
    lossless = {f'qos_overrides.{topic}.subscription.reliability': 'reliable',
                f'qos_overrides.{topic}.subscription.history': 'keep_all'}
    # The clean-up: whatever happens, no process is left behind.
    with ExitStack() as stack:
        node = stack.enter_context(ros_process(
            'imu_allan_node', 'imu_allan.node.imu_allan_node', namespace, output,
            {**lossless, 'publish_period': 1.0, 'output_dir': str(output / 'live'),
             'state_file': '', 'clock': 'header'}))
        simulator = stack.enter_context(ros_process(
            'imu_simulator', 'imu_allan.node.imu_simulator', namespace, output,
            {'model': str(model_file), 'rate': rate_hz, 'duration': seconds, 'speed': 0.0,
             'wait_for_subscriptions': 2}))
        bystander = stack.enter_context(Bystander.joined(namespace, topic, lossless))
        with Screen(model, rate_hz, seconds) as screen:
            write_recording(output / 'recording', bystander.blocks(simulator, node, screen))
        if simulator.returncode:
            raise ImuAllanError(f'the simulator ended with status {simulator.returncode}; see '
                                f'{output}/live/imu_simulator.log')
        saved = bystander.save()
    result_file = next(path for path in saved if path.endswith('result.json'))
    result: dict[str, Any] = json.loads(Path(result_file).read_text())
    return result


@contextmanager
def ros_process(name: str, module: str, namespace: str, output: Path,
                parameters: Mapping[str, object]) -> Iterator['subprocess.Popen[bytes]']:
    """Run a node in a process of its own; its words go to a log file."""
    settings = [word for key, value in parameters.items()
                for word in ('-p', f'{key}:={json.dumps(value)}')]
    log = output / 'live' / f'{name}.log'
    log.parent.mkdir(parents=True, exist_ok=True)
    with log.open('wb') as words:
        process = subprocess.Popen(
            [sys.executable, '-c', f'import sys; from {module} import main; sys.exit(main())',
             '--ros-args', '-r', f'__ns:={namespace}', *settings],
            stdin=subprocess.DEVNULL, stdout=words, stderr=subprocess.STDOUT)
        try:
            yield process
        except BaseException:
            end(process)
            if process.returncode not in (0, -signal.SIGINT):
                print(f'{name} said:\n{log.read_text(errors="replace")[-2000:]}', file=sys.stderr)
            raise
        end(process)


def end(process: 'subprocess.Popen[bytes]') -> None:
    """End a process that was started here, politely first."""
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
        if process.poll() is not None:
            return
        process.send_signal(number)
        try:
            process.wait(timeout=15)
        except (subprocess.TimeoutExpired, KeyboardInterrupt):
            continue


class Bystander:
    """The third party on the topic: records the samples, watches the node's answers."""

    @classmethod
    @contextmanager
    def joined(cls, namespace: str, topic: str,
               qos: Mapping[str, str]) -> Iterator['Bystander']:
        """Join the topics for as long as the context lasts."""
        import rclpy

        rclpy.init(args=[])
        try:
            yield cls(namespace, topic, qos)
        finally:
            rclpy.try_shutdown()

    def __init__(self, namespace: str, topic: str, qos: Mapping[str, str]) -> None:
        from diagnostic_msgs.msg import DiagnosticArray
        from imu_allan.node.drained_subscription import DrainedSubscription
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node
        from rclpy.parameter import Parameter
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from sensor_msgs.msg import Imu
        from std_srvs.srv import Trigger

        self._node = Node('bystander', namespace=namespace, parameter_overrides=[
            Parameter(name, value=value) for name, value in qos.items()])
        self._samples = DrainedSubscription(self._node, Imu, topic, depth=100_000)
        self._node.create_subscription(
            DiagnosticArray, f'{namespace}/imu_allan/coefficients', self._hear,
            QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        self._saving = self._node.create_client(Trigger, f'{namespace}/imu_allan/save')
        self._request = Trigger.Request()
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._heard: dict[str, dict[str, str]] = {}
        self._heard_until_ns = 0

    def blocks(self, simulator: 'subprocess.Popen[bytes]', node: 'subprocess.Popen[bytes]',
               screen: 'Screen') -> Iterator[ImuBlock]:
        """Yield what is published until the simulator has ended; keep the screen up to date."""
        def malformed(_: int, error: Exception) -> None:
            raise error

        decode = IMU_MESSAGES.decoder()
        recorded = newest_ns = 0
        deadline = float('inf')
        while time.monotonic() < deadline:
            ended = simulator.poll() is not None
            if node.poll() is not None:
                raise ImuAllanError(f'the node ended with status {node.returncode}')
            batch = self._samples.take()
            if batch.messages:
                for block in decode(batches_of(batch.messages, batch.receive_ns), malformed):
                    yield block
                    newest_ns = int(block.header_ns[-1])
                recorded += len(batch.messages)
            elif ended:
                if not recorded or self._heard_until_ns >= newest_ns:
                    break
                # The node's last word is about the last sample; it is due within a period.
                deadline = min(deadline, time.monotonic() + 5)
            self._executor.spin_once(timeout_sec=0.05)
            screen.show(recorded, self._heard)
        screen.show(recorded, self._heard, last=True)

    def save(self) -> list[str]:
        """Let the node write its result; return the paths."""
        future = self._saving.call_async(self._request)
        self._executor.spin_until_future_complete(future, timeout_sec=60)
        answer = future.result() if future.done() else None
        if answer is None or not answer.success:
            raise ImuAllanError('the node did not save: '
                                + ('no answer' if answer is None else answer.message))
        return list(answer.message.splitlines())

    def _hear(self, array: Any) -> None:
        self._heard_until_ns = array.header.stamp.sec * 10**9 + array.header.stamp.nanosec
        for status in array.status:
            self._heard[status.name.rpartition(' ')[2]] = {
                item.key: item.value for item in status.values}


class Screen:
    """The live table on a terminal, a line now and then in a pipe."""

    def __init__(self, model: NoiseModel, rate_hz: float, seconds: float) -> None:
        self._model, self._rate, self._seconds = model, rate_hz, seconds
        self._live = (Live(console=CONSOLE, auto_refresh=False)
                      if CONSOLE.is_terminal else None)
        self._began: float | None = None
        self._said: dict[str, dict[str, str]] = {}
        self._shown = time.monotonic()
        self._every = 0.25 if self._live is not None else 5.0

    def __enter__(self) -> 'Screen':
        """Take the lower part of the terminal."""
        if self._live is not None:
            self._live.__enter__()
        return self

    def __exit__(self, *exception: Any) -> None:
        """Leave the last table standing."""
        if self._live is not None:
            self._live.__exit__(*exception)

    def show(self, samples: int, heard: Mapping[str, Mapping[str, str]], *,
             last: bool = False) -> None:
        """Show how far the simulation is and what the node says by now."""
        now = time.monotonic()
        if samples and self._began is None:
            self._began = now
        if now - self._shown < self._every and not last:
            return
        self._shown = now
        elapsed = now - self._began if self._began is not None else 0.0
        pace = f', {samples / self._rate / elapsed:,.0f} times real time' if elapsed > 1 else ''
        text = (f'{samples / self._rate / 60:6.1f} of {self._seconds / 60:g} simulated minutes'
                f'{pace if not last else ""}')
        if self._live is None:
            CONSOLE.print(f'{text}: {self._changed(heard, everything=last)}', soft_wrap=True)
        else:
            self._live.update(Group(Text(text), *self._tables(heard)), refresh=True)

    def _changed(self, heard: Mapping[str, Mapping[str, str]], *, everything: bool) -> str:
        """Say what the node says of the gyroscope otherwise than in the line before."""
        parts = []
        for key in SHOWN_TERMS:
            said = {axis: cell(heard.get(axis, {}), self._model, axis, key).plain.split('\n')[0]
                    for axis in ('gyro_x', 'gyro_y', 'gyro_z')}
            before = {} if everything else self._said.get(key, {})
            if cells := [f'{axis[-1]} {value}' for axis, value in said.items()
                         if value != before.get(axis)]:
                truth, unit = true_value(self._model, 'gyro_x', key)
                parts.append(f'{TERMS[key].symbol} {", ".join(cells)} (true {truth} {unit})')
            self._said[key] = said
        return f'gyro {"; ".join(parts)}' if parts else 'as before'

    def _tables(self, heard: Mapping[str, Mapping[str, str]]) -> Iterable[Table]:
        for sensor, title in (('gyro', 'Gyroscope'), ('accel', 'Accelerometer')):
            axes = [axis for axis in AXES if axis.startswith(sensor)]
            table = Table(title=f'{title}: {word_for([heard.get(axis, {}) for axis in axes])}',
                          title_justify='left', title_style='bold',
                          box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0))
            table.add_column('coefficient', min_width=18)
            table.add_column('true', justify='right', style='cyan', min_width=5)
            for name in 'xyz':
                table.add_column(name, justify='right', min_width=15)
            for key in SHOWN_TERMS:
                truth, unit = true_value(self._model, axes[0], key)
                name = Text(f'{TERMS[key].symbol} {key.replace("_", " ")}\n')
                name.append(f'  {unit}', style='dim')
                table.add_row(name, truth, *(cell(heard.get(axis, {}), self._model, axis, key)
                                             for axis in axes))
            yield table


def word_for(axes: Sequence[Mapping[str, str]]) -> str:
    """Say in a word how far the numbers of a sensor can be trusted by now."""
    if not all('noise_density/value' in values for values in axes):
        return 'cannot tell'
    if not all(values.get('goodness_of_fit/acceptable') == 'true' for values in axes):
        return 'does not fit'
    if not all('rate_random_walk/value' in values for values in axes):
        return 'fits, drift: cannot tell yet'
    return 'fits'


def true_value(model: NoiseModel, axis: str, key: str) -> tuple[str, str]:
    """Give what the model says, in the unit of datasheets."""
    value, unit = engineering(model.axes[axis].get(key, 0.0), TERMS[key].unit(AXES[axis]))
    return f'{value:.4g}', unit


def cell(values: Mapping[str, str], model: NoiseModel, axis: str, key: str) -> Text:
    """Give one coefficient as the node published it, coloured by whether it holds the truth."""
    unit = TERMS[key].unit(AXES[axis])

    def shown(name: str) -> str:
        digits = 4 if name == 'value' else 3
        return f'{engineering(float(values[f"{key}/{name}"]), unit)[0]:.{digits}g}'

    truth = model.axes[axis].get(key, 0.0)
    if f'{key}/value' in values:
        low, high = (float(values[f'{key}/ci95_{end}']) for end in ('low', 'high'))
        text = Text(shown('value'), style='bold green' if low <= truth <= high else 'bold yellow')
        text.append(f'\n{shown("ci95_low")} .. {shown("ci95_high")}', style='not bold')
        return text
    if f'{key}/upper95' in values:
        bound = float(values[f'{key}/upper95'])
        return Text(f'< {shown("upper95")}', style='green' if truth <= bound else 'yellow')
    return Text('...', style='dim')


def analyze(recording: str, output: Path, *options: str) -> None:
    """Run the offline tool, and the exporter on its result, as a user would."""
    command = [sys.executable, '-m', 'imu_allan']
    run([*command, 'analyze', recording, '--output', str(output), *options])
    run([*command, 'export', str(output / 'result.json'), '--for', 'kalibr',
         '--output', str(output / 'imu.yaml')], quiet=True)


def run(command: Sequence[str], *, quiet: bool = False) -> None:
    """Run a command; the demo ends with its status if it fails."""
    sys.stdout.flush()
    process = subprocess.run(command, check=False, stdin=subprocess.DEVNULL,
                             stdout=subprocess.DEVNULL if quiet else None)
    if process.returncode:
        sys.exit(process.returncode)


def largest_difference(left: object, right: object) -> tuple[int, float]:
    """
    Compare two trees of numbers.

    Returns
    -------
    numbers : int
        How many were compared.
    difference : float
        The largest relative one; infinite where the trees differ in anything but numbers.

    """
    if isinstance(left, dict) and isinstance(right, dict) and left.keys() == right.keys():
        pairs = [(left[key], right[key]) for key in left]
    elif isinstance(left, list) and isinstance(right, list) and len(left) == len(right):
        pairs = list(zip(left, right, strict=True))
    elif type(left) is float and type(right) is float:
        return 1, abs(left - right) / (max(abs(left), abs(right)) or 1.0)
    else:
        return 0, 0.0 if left == right else float('inf')
    found = [largest_difference(*pair) for pair in pairs]
    return sum(count for count, _ in found), max((worst for _, worst in found), default=0.0)


def estimates(result: Mapping[str, Any]) -> dict[str, Any]:
    """Return what both front doors estimate: a model is tested on the data of recordings alone."""
    return {name: {key: value for key, value in axis.items() if key != 'backtest'}
            for name, axis in result['axes'].items()}


def list_files(output: Path, published: bool = False) -> None:
    """Say what lies where; a recording that an earlier demo published is not of this one."""
    CONSOLE.print('\n[bold]Files[/]')
    for name, what in (
            ('report.html', 'everything on one page, open it in a browser'),
            ('allan_deviation.png', 'the plot'),
            ('imu.yaml', 'the configuration of Kalibr'),
            ('result.json', 'all numbers'),
            ('curve.csv', 'the Allan deviation'),
            ('recording', 'what was published, as a rosbag2 recording')):
        if (output / name).exists() and (published or name != 'recording'):
            CONSOLE.print(f'  {output / name}  {what}', soft_wrap=True)


def say_what_next() -> None:
    """Name the commands that a newcomer wants after this."""
    command = Path(sys.executable).with_name('imu_allan')
    if command.is_relative_to(Path.cwd()):
        command = command.relative_to(Path.cwd())
    CONSOLE.print('\n[bold]What next[/]')
    for line, what in (
            (f'{command} analyze YOUR_BAG --output results', 'a recording of your own IMU'),
            (f'{command} analyze YOUR_BAG --for kalibr', 'the numbers for a filter, at once'),
            (f'{command} report results/result.json', 'pictures as PNG, SVG and PDF')):
        CONSOLE.print(f'  {line}  [dim]{what}[/]', soft_wrap=True)


if __name__ == '__main__':
    sys.exit(main())
