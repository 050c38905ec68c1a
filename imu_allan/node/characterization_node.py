# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The node beside an IMU driver, in one class because the executor calls all of it.

The executor's one thread takes samples, feeds them to the run and answers services. Everything
that takes longer (fit, plot, files) is done by the worker's thread on a snapshot, so that the
middleware's queue never has to hold more than moments. Nothing that a driver, a listener or a disk
does lets an error out of the executor's thread; if one gets out all the same, `serve` saves first.
"""

import asyncio
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Future, wait
from dataclasses import replace
from math import ceil
from threading import RLock
import time
from typing import Any

from imu_allan.errors import ImuAllanError, printable
from imu_allan.node.announcements import Announcements
from imu_allan.node.callers import Callers, REQUESTS
from imu_allan.node.checkpoint import UnusableState
from imu_allan.node.diagnostics import Facts
from imu_allan.node.drained_subscription import DrainedSubscription
from imu_allan.node.imu_type import decoder, message_class
from imu_allan.node.interface import SETTINGS, TOPIC
from imu_allan.node.log import Log
from imu_allan.node.parameters import declare, warn_of_unknown
from imu_allan.node.process import StopRequest
from imu_allan.node.publications import Publications
from imu_allan.node.rclpy_inside import AnyExecutorNode
from imu_allan.node.reception import Reception
from imu_allan.node.reports import Reports
from imu_allan.node.results import Results
from imu_allan.node.run import Half, Run, Setup
from imu_allan.node.runs import Runs
from imu_allan.node.same_imu import LOOK_S
from imu_allan.node.storage import Storage
from imu_allan.node.thermometer import Thermometer
from imu_allan.node.worker import Worker
from imu_allan.timeline import TimelineOptions
from imu_allan.writers.verdict import findings_line, verdict_lines
from rcl_interfaces.msg import SetParametersResult
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import Executor, ExternalShutdownException, SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_srvs.srv import SetBool, Trigger

QUEUE_S = 2.5
"""The queue holds so many seconds of samples at the expected rate."""
QUEUE_MESSAGES = 10_000
"""The queue holds at least so many messages: 2 s of an IMU at 5 kHz."""
TICK_S = 0.5
"""A fifth of `QUEUE_S`, so that late ticks lose nothing; a shorter one wakes up for nothing, and
fewer messages decoded together pay the fixed price of numpy more often."""
HURRY_S = 0.05
"""Between two ticks where the queue would not hold what comes within `TICK_S`."""
TICK_MESSAGES = QUEUE_MESSAGES // 4
"""Taken together at most, as far as can be predicted from how fast the last ones came."""


class CharacterizationNode(AnyExecutorNode):
    """
    Characterizes the IMU on ``imu/data_raw``, in whichever executor spins it.

    Parameters
    ----------
    node_name : str, optional
    options
        Of `rclpy.node.Node`, such as ``namespace`` and ``parameter_overrides``.

    Raises
    ------
    ImuAllanError
        If a parameter is refused or the state file cannot be used.

    """

    def __init__(self, node_name: str = 'imu_allan', **options: Any) -> None:
        super().__init__(node_name, **options)
        # An executor of several threads calls services and timer at the same time.
        self._lock = RLock()
        self._ended = False
        self._log = Log(self.get_logger())
        values = declare(self, SETTINGS, self._apply)
        warn_of_unknown(self)
        if reason := _reason_against(values['aiding_interval'], values['coast']):
            raise ImuAllanError(f'parameter {reason}')

        self._receptions = [self._reception(topic, half, values)
                            for topic, half in _topics(values)]
        subscribed = [reception.subscription.topic for reception in self._receptions]
        if len(set(subscribed)) < len(subscribed):
            raise ImuAllanError(f'parameters gyro_topic and accel_topic: both are {subscribed[0]}')
        self._facts, name = self._receptions[0].facts, self.get_fully_qualified_name()
        self._publications = Publications(self)
        self._worker = Worker(self._log)
        self._results = Results(name, self._publications, self._worker, self._facts,
                                self._receptions[0].announcements, values)
        self.add_on_set_parameters_callback(self._check)
        self._setup = Setup(
            subscribed[0], TimelineOptions(clock=values['clock'],
                                           gap_tolerance=values['gap_tolerance'],
                                           motion=values['motion']),
            ' '.join(filter(None, [values['imu_type'], *_fields(values), *_units(values),
                                   values['accel_type']])),
            accel_topic=''.join(subscribed[1:]),
            finds_unit=not (values['accel_unit'] or values['accel_field']))
        self._thermometer = Thermometer(self, self._log, self._facts, len(subscribed),
                                        values['temperature_topic'])
        self._storage = Storage(name, self._setup, self._worker, self._facts, self._log, values)
        self._reports = Reports(self, self._receptions, self._publications, self._log)
        run = self._storage.first_run()
        # Held back means lost in a crash: no more than half of what may be lost.
        self._runs = Runs(self._setup, run, [reception.facts for reception in self._receptions],
                          lambda: min(LOOK_S, self._storage.checkpoint_period / 2),
                          self._leave, self._log,
                          lambda number: self._receptions[number].subscription.publisher_gids())

        # Services wait for the worker while samples come in: they have a group of their own.
        self._callers = Callers(self)
        for name, serve in ('~/save', self._save), ('~/reset', self._reset):
            self.serve_waiting(Trigger, name, serve, qos_profile=REQUESTS,
                               callback_group=self._callers)
        self.create_service(SetBool, '~/pause', self._pause, qos_profile=REQUESTS,
                            callback_group=self._callers)
        now = time.monotonic()
        for reception in self._receptions:
            reception.last_take = reception.last_message = now
        if self._storage.has_resumed:
            self._results.fit(self._run)
        self._storage.try_output()
        self._last_tick = now
        # With use_sim_time and no /clock a timer by the clock of ROS never ticks.
        self._timer = self.create_timer(TICK_S, self._on_timer, MutuallyExclusiveCallbackGroup(),
                                        Clock(clock_type=ClockType.STEADY_TIME))
        self._log.info(f'characterizing the IMU on {" and ".join(subscribed)}')

    def serve(self, stop: StopRequest) -> int:
        """Work until `stop` is set, then save: cheaper than an executor; return the status."""
        # A timer would wake the executor twice: once more for having been called.
        self.destroy_timer(self._timer)
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        well = True
        try:
            wait_s = TICK_S
            while not stop:
                executor.spin_once(wait_s)
                if time.monotonic() - self._last_tick >= wait_s:
                    wait_s = self._tick()
        except ExternalShutdownException:
            # ROS is gone, what was learnt is not.
            pass
        except Exception as error:
            # Whatever it was: days of samples must not go with it.
            well = False
            self._log.bug(error, 'the node ends and saves what it has learnt')
        finally:
            executor.shutdown()
        return 0 if self.finish() and well else 1

    def destroy_node(self) -> None:
        """Save what has not been saved, and end."""
        self.finish()
        super().destroy_node()

    def _reception(self, topic: str, half: Half | None, values: Mapping[str, Any]) -> Reception:
        expected = 0.0 if half == 'accel' else values['expected_rate']
        queue, (gyro_unit, accel_unit) = queue_messages(expected), _units(values)
        parameter = 'accel_type' if half == 'accel' and values['accel_type'] else 'imu_type'
        kind = values[parameter]
        try:
            decode = decoder(kind, *_fields(values, half), gyro_unit=gyro_unit,
                             accel_unit=accel_unit)
        except ImuAllanError as error:
            raise ImuAllanError(f'parameter {parameter}: {error}') from error
        subscription = DrainedSubscription(self, message_class(kind), topic, queue,
                                           f'{half}_topic')
        facts = Facts(subscription.topic, subscription.depth, expected, values['state_file'], half)
        return Reception(subscription, facts, decode, Announcements(self._log, facts.topic))

    def _check(self, parameters: Iterable[Parameter]) -> SetParametersResult:
        """Refuse together what the node would not start with; one alone may wait for the other."""
        given = {parameter.name: parameter.value for parameter in parameters}
        reason = (_reason_against(given['aiding_interval'], given['coast'])
                  if {'aiding_interval', 'coast'} <= given.keys() else '')
        return SetParametersResult(successful=not reason, reason=reason)

    def _apply(self, name: str, value: Any) -> None:
        results, storage = self._results, self._storage
        with self._lock:
            if name == 'publish_period':
                results.publish_every(value)
            elif name == 'output_dir':
                storage.write_to(value)
            elif name in ('checkpoint_period', 'export_for'):
                setattr(storage, name, value)
            elif name in ('aiding_interval', 'coast'):
                filter_of = results.filter_of = replace(results.filter_of, **{f'{name}_s': value})
                if reason := _reason_against(filter_of.aiding_interval_s, filter_of.coast_s):
                    self._log.warning(f'{reason}: filter_random_walk is NaN until they fit',
                                      'filter')

    # -- one tick: samples in, what is due started, what is done handed out ---------------------

    def _on_timer(self) -> None:
        period_ns = round(self._tick() * 1e9)
        if period_ns != self._timer.timer_period_ns:
            self._timer.timer_period_ns = period_ns

    def _tick(self) -> float:
        """Do what is due; return the time until the next tick."""
        with self._lock:
            now = time.monotonic()
            count = self._catch_up(now)
            self._worker.hand_out()
            if self._results.due(now):
                self._results.publish_or_fit(now, self._run, max(
                    reception.last_message for reception in self._receptions))
            if self._storage.checkpoint_due(now, self._run):
                self._storage.checkpoint(self._run)
            if self._reports.due(now):
                self._thermometer.look_beside()
                self._reports.report(now, self._run, self._results.latest,
                                     self._storage.checkpoint_age_s(now))
                self._results.draw_if_watched(self._run)
            elapsed_s, self._last_tick = now - self._last_tick, now
        return pace_s(count, elapsed_s)

    def _catch_up(self, now: float) -> int:
        """Take in what has come until now; return how much it was on a topic at most."""
        most = self._take(now)
        for number, lane in enumerate(self._run.lanes):
            self._thermometer.feed(number, lane.characterization)
        for number, reception in enumerate(self._receptions):
            for publisher, blocks in reception.blocks(now):
                self._runs.take(number, publisher, blocks)
        return most

    def _take(self, now: float) -> int:
        if not self.context.ok():
            # Once ROS is gone nothing more comes.
            return 0
        most = max([reception.take(now) for reception in self._receptions])
        self._thermometer.take()
        return most

    # -- one run after the other ----------------------------------------------------------------

    @property
    def _run(self) -> Run:
        return self._runs.run

    def _leave(self, run: Run, why: UnusableState) -> None:
        """Save a run whose place another takes, and keep its state aside."""
        self._storage.save(run)
        self._storage.keep_aside(run, why)
        self._storage.hurry()
        self._forget_run()

    def _forget_run(self) -> None:
        self._results.begin_run()
        for reception in self._receptions:
            reception.announcements.begin_run()

    # -- services -------------------------------------------------------------------------------

    async def _save(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        with self._lock:
            self._catch_up(time.monotonic())
            future = self._storage.save(self._run)
        failure = await self._failure(future)
        response.success = failure is None
        response.message = ('\n'.join(map(str, future.result())) if failure is None else
                            failure)
        return response

    async def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        with self._lock:
            self._take(time.monotonic())
            for reception in self._receptions:
                reception.drop()
            self._runs.begin_anew()
            self._forget_run()
            self._storage.forget_resumed()
            self._results.fit(self._run)
            future = self._storage.checkpoint(self._run) if self._storage.keeps_state else None
        response.success, response.message = True, 'a new run has begun'
        failure = None if future is None else await self._failure(future)
        if failure is not None:
            response.success = False
            response.message += f', but {failure}'
        self._log.info(response.message, 'reset')
        return response

    async def _failure(self, future: 'Future[Any]') -> str | None:
        """
        Let the executor go on until the worker is done, and it is the caller's turn.

        Return what went wrong.
        """
        executor = self.executor
        if isinstance(executor, Executor):
            future.add_done_callback(lambda _: executor.wake())
        else:
            wait([future])
        self._callers.waiting += 1
        try:
            while not (future.done() and self._callers.may_answer()):
                # It comes back when the executor wakes the next time.
                await asyncio.sleep(0)
        finally:
            # Whoever waits when the node ends comes here once there is no timer any more.
            self._callers.waiting -= 1
        error = future.exception()
        return None if error is None else printable(error)

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        with self._lock:
            self._catch_up(time.monotonic())
            changes = request.data != self._facts.paused
            for reception in self._receptions:
                reception.facts.paused = request.data
        response.success = True
        response.message = ('paused: samples are passed over' if request.data else
                            'going on; the pause counts as a gap' if changes else 'not paused')
        if changes:
            self._log.info(response.message)
        return response

    # -- the end --------------------------------------------------------------------------------

    def finish(self) -> bool:
        """Take what is still queued, write state and result; return whether all was well."""
        with self._lock:
            ended, self._ended = self._ended, True
            return ended or self._finish()

    def _finish(self) -> bool:
        # One after the other: what fails costs the others nothing.
        done = [self._attempt(step) for step in (
            lambda: self._catch_up(time.monotonic()),
            self._runs.finish,
            lambda: self._storage.save_state_at_end(self._run),
            # Drawings come last: there may be no time for them.
            lambda: (self._runs.unproven is None
                     or self._storage.save_files_at_end(self._runs.unproven, picture=False)),
            lambda: self._storage.save_files_at_end(self._run),
            # Nobody listens any more; but what became of files is reported.
            lambda: self._worker.finish({'save', 'checkpoint', 'aside'}))]
        if (result := self._results.latest) is not None:
            for line in filter(None, (*verdict_lines(result), findings_line(result))):
                self._log.info(line)
        if all(done):
            self._storage.finish_run()
        self._storage.close()
        return all(done)

    def _attempt(self, step: Callable[[], object]) -> bool:
        try:
            return step() is not False
        except ImuAllanError as error:
            self._log.error(str(error), f'at the end: {type(error).__name__}')
        except Exception as error:
            self._log.bug(error, 'the node saves the rest and ends')
        return False


def _topics(values: Mapping[str, Any]) -> list[tuple[str, Half | None]]:
    """Give the topics to subscribe to, with the sensor that comes on it if it is one alone."""
    gyro, accel = values['gyro_topic'], values['accel_topic']
    if not gyro and not accel:
        if values['accel_type']:
            raise ImuAllanError('parameter accel_type: needs gyro_topic and accel_topic; '
                                'imu_type is the type of one topic')
        return [(TOPIC, None)]
    if not (gyro and accel):
        named, other = ('gyro', 'accel') if gyro else ('accel', 'gyro')
        raise ImuAllanError(f'parameter {named}_topic: needs {other}_topic, too: an IMU on two '
                            'topics has both')
    return [(gyro, 'gyro'), (accel, 'accel')]


def _fields(values: Mapping[str, Any], half: Half | None = None) -> list[str]:
    """Give the fields that are named for the messages on a topic; the others are empty."""
    return ['' if half is not None and part not in (half, 'stamp') else values[f'{part}_field']
            for part in ('gyro', 'accel', 'stamp')]


def _units(values: Mapping[str, Any]) -> list[str]:
    return [values['gyro_unit'], values['accel_unit']]


def queue_messages(expected_rate: float) -> int:
    """Give the depth of the queue for a rate in Hz; 0 is unknown."""
    return max(QUEUE_MESSAGES, ceil(QUEUE_S * expected_rate))


def pace_s(count: int, elapsed_s: float) -> float:
    """Give the time to the next tick, in seconds, after `count` messages came in `elapsed_s`."""
    return min(TICK_S, max(HURRY_S, elapsed_s * TICK_MESSAGES / max(count, 1)))


def _reason_against(aiding_s: float, coast_s: float) -> str:
    """Why two parameters are refused together; empty if they are not."""
    return '' if aiding_s <= coast_s else (
        f'aiding_interval: {aiding_s:g} s is longer than coast, {coast_s:g} s')
