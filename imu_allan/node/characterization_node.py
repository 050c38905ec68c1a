# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The node beside an IMU driver: samples in, noise coefficients out, for days.

The executor's one thread takes samples, feeds them to the characterization and answers services.
Everything that takes longer (fit, plot, files) is done by one worker thread on a snapshot, so
that the middleware's queue never has to hold more than moments.
"""

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass
from math import ceil, inf
from pathlib import Path
import time
import traceback
from typing import Any, TypeVar

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray
from geometry_msgs.msg import Vector3Stamped
from imu_allan.block import ImuBlock
from imu_allan.cdr import blocks_from_messages, MalformedImu
from imu_allan.characterization import Characterization
from imu_allan.errors import ImuAllanError, printable
from imu_allan.node.checkpoint import StateFile, UnusableState
from imu_allan.node.diagnostics import diagnostics_message, Facts
from imu_allan.node.drained_subscription import Batch, DrainedSubscription
from imu_allan.node.parameters import declare, Setting, warn_of_unknown
from imu_allan.node.process import give_back_memory, StopRequest
from imu_allan.node.result_messages import (
    result_messages,
    ResultMessages,
    SENSORS,
    spoken_duration,
    VECTOR_TERMS,
)
from imu_allan.node.resuming import pack, Setup, Trial, TRIAL_S, unpack
from imu_allan.node.saving import run_folder, save_run
from imu_allan.result import Result
from imu_allan.timeline import TimelineOptions
from imu_allan.writers.filters import CONSUMERS
import numpy as np
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import InvalidQosOverridesError
from sensor_msgs.msg import CompressedImage, Imu
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import SetBool, Trigger

T = TypeVar('T')

TOPIC = 'imu/data_raw'
QUEUE_S = 2.5
"""The queue holds so many seconds of samples at the expected rate."""
QUEUE_MESSAGES = 10_000
"""The queue holds at least so many messages: 2 s of an IMU at 5 kHz."""
TICK_S = 0.2
FEED_S = 0.5
SILENCE_S = 5.0

SETTINGS = (
    Setting('publish_period', 10.0, 'Seconds from one fit and publication to the next',
            0.5, 86_400.0),
    Setting('output_dir', '~/.ros/imu_allan', 'Folder in which ~/save and the end of the node '
            'write; every run gets a folder of its own in it', may_be_empty=False),
    Setting('state_file', '', 'File that keeps what was learnt over a crash or a reboot; empty '
            'keeps nothing', read_only=True),
    Setting('checkpoint_period', 60.0, 'At most so many seconds of samples are lost in a crash',
            1.0, 86_400.0),
    Setting('motion', 'exclude', 'What to do with knocks and motion', choices=('exclude', 'keep'),
            read_only=True),
    Setting('clock', 'auto', 'Stamps to trust; auto takes the header stamps unless they are '
            'unusable', choices=('auto', 'header', 'receive'), read_only=True),
    Setting('expected_rate', 0.0, 'Rate of the IMU in Hz, for the size of the queue and a warning '
            'where another is measured; 0 is unknown', 0.0, 100_000.0, read_only=True),
    Setting('gap_tolerance', 5, 'Missing samples in a row that are bridged; more of them begin a '
            'new stretch', 0, 1000, read_only=True),
    Setting('export_for', ('kalibr',), "Filters whose configuration ~/save writes; [''] writes "
            'none', choices=tuple(CONSUMERS)),
)

_LATCHED = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE,
                      durability=DurabilityPolicy.TRANSIENT_LOCAL)


class _NothingToSave(ImuAllanError):
    """A result without axes."""


class _Run:
    """What belongs to one run, and is left behind when another begins."""

    def __init__(self, characterization: Characterization, trial: Trial | None = None) -> None:
        self.characterization = characterization
        self.trial = trial
        self.stamp_ns = 0
        self.fed = 0
        self.fitted = 0
        self.checkpointed = 0


@dataclass
class _Job:
    """Work of the worker thread and what the executor's thread does once it is done."""

    kind: str
    future: Future[Any]
    done: Callable[[Future[Any]], None]


@dataclass
class _NextSave:
    """The save asked for last; `snapshot` is empty once the worker has begun with it."""

    of: tuple[_Run, str, list[str]]
    snapshot: list[Characterization]
    future: 'Future[list[Path]]'


class CharacterizationNode(Node):
    """
    Characterizes the IMU on ``imu/data_raw``.

    Raises
    ------
    ImuAllanError
        If a parameter is refused or the state file cannot be used.

    """

    def __init__(self) -> None:
        super().__init__('imu_allan')
        values = declare(self, SETTINGS, self._apply)
        warn_of_unknown(self)
        self._publish_period: float = values['publish_period']
        self._checkpoint_period: float = values['checkpoint_period']
        self._output_dir: str = values['output_dir']
        self._export_for: list[str] = list(values['export_for'])

        queue = queue_messages(values['expected_rate'])
        self._subscription = self._subscribe(queue)
        self._facts = Facts(self._subscription.topic, queue, values['expected_rate'],
                            values['state_file'])
        self._setup = Setup(self._subscription.topic, TimelineOptions(
            clock=values['clock'], gap_tolerance=values['gap_tolerance'],
            motion=values['motion']))
        self._state_file = StateFile(values['state_file']) if values['state_file'] else None
        self._run = self._first_run()
        self._waiting: list[Batch] = []
        self._result: Result | None = None
        self._plotted: Result | None = None

        self._create_publishers()
        # Services wait for the worker while samples come in: they have a group of their own.
        services = ReentrantCallbackGroup()
        self.create_service(Trigger, '~/save', self._save, callback_group=services)
        self.create_service(Trigger, '~/reset', self._reset, callback_group=services)
        self.create_service(SetBool, '~/pause', self._pause, callback_group=services)

        self._worker = ThreadPoolExecutor(1, 'imu_allan_worker')
        self._jobs: list[_Job] = []
        self._next_save: _NextSave | None = None
        self._saved_at: float | None = None
        now = time.monotonic()
        self._last_take = self._last_feed = self._last_message = now
        self._last_complaint = -inf
        self._last_checkpoint = self._last_report = self._last_fit = now
        self._last_report_cpu, self._last_report_received = time.process_time(), 0
        # The clock of ROS stands still in simulated time without /clock.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(TICK_S, self._tick, clock=self._steady)
        if self._run.trial is not None:
            self._start_fit()
        self.get_logger().info(f'characterizing the IMU on {self._subscription.topic}')

    def serve(self, stop: StopRequest) -> int:
        """
        Work until `stop` is set, then save.

        Returns
        -------
        int
            Exit status: 0, or 1 if what was learnt could not be saved.

        """
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        try:
            while not stop:
                executor.spin_once()
        except ExternalShutdownException:
            # ROS is gone, what was learnt is not.
            pass
        finally:
            executor.shutdown()
        return self._finish()

    def _subscribe(self, queue: int) -> DrainedSubscription:
        try:
            return DrainedSubscription(self, Imu, TOPIC, queue)
        except (InvalidQosOverridesError, RuntimeError) as error:
            raise ImuAllanError(f'qos_overrides of {TOPIC}: {error}') from error

    def _create_publishers(self) -> None:
        self._coefficients = self._publisher(DiagnosticArray, '~/coefficients')
        self._vectors = {f'{sensor}/{term}': self._publisher(Vector3Stamped, f'~/{sensor}/{term}')
                         for sensor in SENSORS for term in VECTOR_TERMS}
        self._curves = {name: self._publisher(Float64MultiArray, f'~/{name}')
                        for name in (f'{sensor}/allan_deviation' for sensor in SENSORS)}
        self._plot = self._publisher(CompressedImage, '~/plot/compressed')
        self._diagnostics = self.create_publisher(DiagnosticArray, '/diagnostics', 10,
                                                  event_callbacks=_no_events())

    def _publisher(self, kind: type, topic: str) -> Publisher:
        return self.create_publisher(kind, topic, _LATCHED, event_callbacks=_no_events())

    def _apply(self, name: str, value: Any) -> None:
        if name in ('publish_period', 'checkpoint_period', 'output_dir', 'export_for'):
            setattr(self, f'_{name}', value)

    # -- one tick: samples in, what is due started, what is done handed out ---------------------

    def _tick(self) -> None:
        now = time.monotonic()
        self._take(now)
        if now - self._last_feed >= FEED_S:
            self._feed(now)
        for job in [job for job in self._jobs if job.future.done()]:
            self._jobs.remove(job)
            job.done(job.future)
        if self._run.fed != self._run.fitted and self._fit_due(now):
            self._start_fit()
        if self._state_file is not None and self._checkpoint_due(now):
            self._start_checkpoint()
        if now - self._last_report >= 1.0:
            self._report(now)

    def _take(self, now: float) -> None:
        batch = self._subscription.take()
        facts = self._facts
        facts.longest_hold_s = max(facts.longest_hold_s, now - self._last_take)
        facts.received += len(batch.messages)
        facts.lost += batch.lost
        self._last_take = now
        if not batch.messages:
            return
        self._last_message = now
        if facts.paused:
            facts.skipped += len(batch.messages)
        else:
            self._waiting.append(batch)

    def _feed(self, now: float) -> None:
        self._last_feed = now
        batches, self._waiting = self._waiting, []
        if not batches:
            return
        messages = [message for batch in batches for message in batch.messages]
        receive_ns = np.concatenate([batch.receive_ns for batch in batches])
        blocks = blocks_from_messages(messages, receive_ns, on_malformed=self._on_malformed)
        run = self._run
        if run.trial is None:
            self._update(blocks)
            return
        run.trial.hold(blocks)
        if run.trial.complete:
            self._end_trial(run.trial)

    def _update(self, blocks: Sequence[ImuBlock]) -> None:
        run = self._run
        for block in blocks:
            try:
                run.characterization.update(block)
                self._facts.update_error = ''
            except ImuAllanError as error:
                self._facts.update_error = str(error)
                self._tell_error(str(error))
            run.fed += len(block)
            run.stamp_ns = int(block.header_ns[-1] or block.receive_ns[-1])

    def _on_malformed(self, count: int, error: MalformedImu) -> None:
        self._facts.malformed += count
        self._tell_error(f'{self._subscription.topic}: {error}')

    def _end_trial(self, trial: Trial) -> None:
        run, verdict = self._run, trial.verdict()
        run.trial = None
        self._facts.on_trial = False
        self._last_checkpoint = -inf
        if verdict is None:
            self._update(trial.blocks)
            return
        self._keep_aside(verdict)
        self._begin_anew()
        self._update(trial.blocks)
        self._start_fit()

    # -- results -------------------------------------------------------------------------------

    def _fit_due(self, now: float) -> bool:
        # A slow computer fits less often, so that at most a fifth of a core goes into it.
        period = max(self._publish_period, 5 * (self._facts.fit_s or 0.0))
        return now - self._last_fit >= period and not self._under_way('fit')

    def _start_fit(self) -> None:
        self._last_fit = time.monotonic()
        run = self._run
        run.fitted = run.fed
        snapshot, name = run.characterization.snapshot(), self.get_name()
        stamp = run.stamp_ns or time.time_ns()

        def fit() -> tuple[Result, ResultMessages, float]:
            began = time.monotonic()
            result = snapshot.result()
            messages = result_messages(result, name, _time(stamp))
            return result, messages, time.monotonic() - began

        def publish(future: Future[tuple[Result, ResultMessages, float]]) -> None:
            if run is not self._run:
                return
            self._facts.fit_error = self._failure(future)
            if self._facts.fit_error:
                return
            result, messages, self._facts.fit_s = future.result()
            self._result = result
            give_back_memory()
            self._publish(messages)
            self._draw_if_watched()

        self._start('fit', fit, publish)

    def _publish(self, messages: ResultMessages) -> None:
        self._coefficients.publish(messages.coefficients)
        for name, vector in messages.vectors.items():
            self._vectors[name].publish(vector)
        for name, curve in messages.curves.items():
            self._curves[name].publish(curve)

    def _draw_if_watched(self) -> None:
        result = self._result
        if (result is None or not result.axes or result is self._plotted
                or self._under_way('plot') or not self._plot.get_subscription_count()):
            return
        self._plotted = result
        stamp = _time(self._run.stamp_ns)

        def draw() -> CompressedImage:
            from imu_allan.writers.plot import overview_figure, render
            image = CompressedImage(format='png', data=render(overview_figure(result), 'png', 100))
            image.header.stamp = stamp
            image.header.frame_id = result.source.frame_id or ''
            return image

        def show(future: Future[CompressedImage]) -> None:
            if not self._failure(future):
                self._plot.publish(future.result())

        self._start('plot', draw, show)

    # -- what stays ----------------------------------------------------------------------------

    def _first_run(self) -> _Run:
        """Begin with the run of the state file, or with a new one."""
        if self._state_file is None:
            return self._new_run()
        try:
            state = self._state_file.load()
            if state is None:
                return self._new_run()
            characterization = unpack(state, self._setup)
        except UnusableState as error:
            self._keep_aside(error)
            return self._new_run()
        timeline = characterization.summary().timeline
        self._facts.resumed = (f'resumed {spoken_duration(timeline.duration_s)} of data from '
                               f'{self._state_file.path}')
        self._facts.on_trial = True
        self.get_logger().info(self._facts.resumed)
        # Held back means lost in a crash: no more than half of what may be lost.
        return _Run(characterization, Trial(
            characterization, min(TRIAL_S, self._checkpoint_period / 2)))

    def _new_run(self) -> _Run:
        return _Run(Characterization(kind='topic', topic=self._setup.topic,
                                     options=self._setup.options))

    def _begin_anew(self) -> None:
        self._run = self._new_run()
        self._result = self._plotted = None
        self._facts.on_trial = False

    def _keep_aside(self, unusable: UnusableState) -> None:
        assert self._state_file is not None
        aside = self._state_file.keep_aside(unusable.reason)
        self._facts.resumed = (f'a new run: {self._state_file.path} could not be resumed from, '
                               f'{unusable}; it is kept as {aside.name}')
        self.get_logger().warning(printable(self._facts.resumed))

    def _checkpoint_due(self, now: float) -> bool:
        run, period = self._run, self._checkpoint_period
        # Sooner than the period, so that a sample is not older when its checkpoint is on the disk.
        due = now - self._last_checkpoint >= max(period / 2, period - 2.0)
        return (due and run.trial is None and run.fed != run.checkpointed
                and not self._under_way('checkpoint'))

    def _start_checkpoint(self) -> 'Future[int]':
        assert self._state_file is not None
        self._feed(time.monotonic())
        run, state_file = self._run, self._state_file
        began = self._last_checkpoint = time.monotonic()
        fed = run.fed
        state = pack(run.characterization, self._setup)

        def note(future: 'Future[int]') -> None:
            self._facts.checkpoint_error = self._failure(future)
            if not self._facts.checkpoint_error:
                run.checkpointed = fed
                self._saved_at = began

        return self._start('checkpoint', lambda: state_file.save(state), note)

    def _start_save(self) -> 'Future[list[Path]]':
        self._feed(time.monotonic())
        snapshot = self._run.characterization.snapshot()
        name, folder = self.get_fully_qualified_name(), self._output_dir
        consumers = [name for name in self._export_for if name]
        of = self._run, folder, consumers
        if self._next_save is not None and self._next_save.of == of:
            # Whoever asks while a save of the same waits for the worker is served by that one.
            with suppress(IndexError):
                self._next_save.snapshot[0] = snapshot
                return self._next_save.future
        waiting = [snapshot]

        def save() -> list[Path]:
            result = waiting.pop().result()
            if not result.axes:
                raise _NothingToSave('nothing to save: too few usable samples have come from '
                                     f'{self._setup.topic} yet')
            return save_run(result, run_folder(folder, name, result), consumers)

        def note(future: 'Future[list[Path]]') -> None:
            self._facts.save_error = self._failure(future)

        self._next_save = _NextSave(of, waiting, self._start('save', save, note))
        return self._next_save.future

    # -- services ------------------------------------------------------------------------------

    async def _save(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._take(time.monotonic())
        future = self._start_save()
        while not future.done():
            await _AWhile()
        error = future.exception()
        response.success = error is None
        response.message = (printable(error) if error is not None else
                            '\n'.join(str(path) for path in future.result()))
        return response

    async def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._take(time.monotonic())
        self._waiting = []
        self._begin_anew()
        self._start_fit()
        response.success, response.message = True, 'a new run has begun'
        if self._state_file is not None:
            future = self._start_checkpoint()
            while not future.done():
                await _AWhile()
            error = future.exception()
            if error is not None:
                response.success = False
                response.message += f', but {printable(error)}'
        self.get_logger().info(response.message)
        return response

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        now = time.monotonic()
        self._take(now)
        self._feed(now)
        self._facts.paused = request.data
        response.success = True
        response.message = ('paused: samples are passed over' if request.data
                            else 'going on; the pause counts as a gap')
        self.get_logger().info(response.message)
        return response

    # -- diagnostics ---------------------------------------------------------------------------

    def _report(self, now: float) -> None:
        facts = self._facts
        facts.publishers = self._subscription.publishers
        facts.silent_s = now - self._last_message
        cpu, received = time.process_time(), facts.received - self._last_report_received
        if received:
            facts.cpu_s = (cpu - self._last_report_cpu) / received
        facts.received_hz = received / (now - self._last_report)
        facts.checkpoint_age_s = None if self._saved_at is None else now - self._saved_at
        self._last_report, self._last_report_cpu = now, cpu
        self._last_report_received = facts.received
        if facts.silent_s > SILENCE_S and now - self._last_complaint > 6 * SILENCE_S:
            self._last_complaint = now
            self._complain_of_silence()
        self._draw_if_watched()
        if not self._diagnostics.get_subscription_count():
            return
        snapshot = self._run.characterization.snapshot()
        snapshot.finish()
        self._diagnostics.publish(diagnostics_message(
            self.get_name(), self.get_clock().now().to_msg(), facts, snapshot.summary(),
            self._result))
        facts.longest_hold_s = 0.0

    def _complain_of_silence(self) -> None:
        others = [name for name, types in self.get_topic_names_and_types()
                  if 'sensor_msgs/msg/Imu' in types and name != self._subscription.topic
                  and self.count_publishers(name)]
        text = f'no message on {self._subscription.topic} for {self._facts.silent_s:.0f} s'
        refused = self._subscription.incompatible_publishers()
        if refused:
            text += (f'; its QoS does not go with that of {"; ".join(refused)}; choose another '
                     'with qos_overrides')
        elif self._facts.publishers:
            text += f', though {self._facts.publishers} nodes publish it'
        elif others:
            text += (f'; Imu topics here: {", ".join(sorted(others))}; choose one with '
                     f'--ros-args -r {TOPIC}:=TOPIC')
        else:
            text += '; no node publishes Imu messages'
        self.get_logger().warning(text)

    def _tell_error(self, text: str) -> None:
        self.get_logger().error(printable(text), throttle_duration_sec=10.0)

    # -- worker and end --------------------------------------------------------------------------

    def _start(self, kind: str, work: Callable[[], T],
               done: Callable[[Future[T]], None]) -> Future[T]:
        future = self._worker.submit(work)
        self._jobs.append(_Job(kind, future, done))
        return future

    def _under_way(self, kind: str) -> bool:
        return any(job.kind == kind for job in self._jobs)

    def _failure(self, future: Future[Any]) -> str:
        """Tell of what went wrong in the worker, if anything did; return it as a line."""
        error = future.exception()
        if error is None:
            return ''
        if isinstance(error, ImuAllanError):
            self._tell_error(str(error))
            return str(error)
        # A bug in one fit must not end what has been collected for days.
        lines = traceback.format_exception(error)
        self.get_logger().error(''.join(lines), throttle_duration_sec=600.0)
        return f'internal error, see the log: {printable(error)}'

    def _finish(self) -> int:
        """Take what is still queued, write state and result; return the exit status."""
        now = time.monotonic()
        if self.context.ok():
            self._take(now)
        self._feed(now)
        trial = self._run.trial
        if trial is not None and not trial.hopeless:
            self._end_trial(trial)
        status = 0
        try:
            if self._state_file is not None and self._run.fed != self._run.checkpointed:
                self._start_checkpoint().result()
            if self._run.fed:
                for path in self._start_save().result():
                    self.get_logger().info(f'wrote {path}')
        except _NothingToSave as error:
            self.get_logger().info(str(error))
        except ImuAllanError as error:
            self.get_logger().error(printable(error))
            status = 1
        self._worker.shutdown(wait=True, cancel_futures=True)
        if self._state_file is not None:
            self._state_file.close()
        return status


def queue_messages(expected_rate: float) -> int:
    """Give the depth of the queue for a rate in Hz; 0 is unknown."""
    return max(QUEUE_MESSAGES, ceil(QUEUE_S * expected_rate))


def _no_events() -> PublisherEventCallbacks:
    # Every event handler costs each turn of the executor its share.
    return PublisherEventCallbacks(use_default_callbacks=False)


class _AWhile:
    """Lets the executor go on; it comes back when it wakes the next time."""

    def __await__(self) -> Generator[None, None, None]:
        yield


def _time(stamp_ns: int) -> Time:
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    return Time(sec=seconds, nanosec=nanoseconds)
