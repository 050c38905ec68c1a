# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The node that characterizes an IMU, as one class because the executor calls all of it.

The executor's thread takes samples, feeds them to the run and answers services. Everything that
takes longer (fits, plots, files) runs in a worker thread on a snapshot, so samples stay in
the middleware's queue only for moments. Faults of drivers, subscribers or disks raise no error in
the executor's thread; should one escape nevertheless, `serve` saves first.
"""

from collections.abc import Callable
from concurrent.futures import Future, wait
from threading import RLock
import time
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.node.change_of_run import Runs
from imu_allan.node.diagnostics import diagnostics_message, Facts, timeline_counts
from imu_allan.node.fitting import Fitting
from imu_allan.node.log import Log
from imu_allan.node.output_topics import OutputTopics
from imu_allan.node.parameters import CHARACTERIZATION, declare, READING, warn_of_unknown
from imu_allan.node.program import StopRequest
from imu_allan.node.rclpy_inside import AnyExecutorNode, RCLError
from imu_allan.node.reception import QUEUE_MESSAGES, Reception, receptions
from imu_allan.node.run import Lane, LOOK_S, Run, Setup, UnusableState
from imu_allan.node.storage import Storage
from imu_allan.node.thermometer import Thermometer
from imu_allan.node.worker import Worker
from imu_allan.timeline import TimelineOptions, TimelineSummary
from imu_allan.writers.key_figures import closing_lines
from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.logging import get_logger
from std_srvs.srv import SetBool, Trigger

TICK_S = 0.5
"""Time between ticks: a fifth of what the queue holds, so that late ticks lose nothing. Shorter
ones wake up needlessly, and decode fewer messages at a time, each time at numpy's fixed cost."""
REPORT_S = 1.0
"""As diagnostic_updater does; an aggregator considers a status stale after 5 s."""
UNWATCHED_S = 10.0
"""Without subscribers, examine the timeline this often for the log: it is copied each time."""


class CharacterizationNode(AnyExecutorNode):
    """
    Characterizes the IMU on ``imu/data_raw``, under any kind of executor.

    Parameters
    ----------
    node_name : str, optional
    options
        Keyword arguments of `rclpy.node.Node`, such as ``namespace`` and ``parameter_overrides``.

    Raises
    ------
    ImuAllanError
        If a parameter is refused or the state file cannot be used.

    """

    def __init__(self, node_name: str = 'imu_allan', **options: Any) -> None:
        super().__init__(node_name, **options)
        # A multithreaded executor calls services and timer concurrently.
        self._lock = RLock()
        self._ended = False
        # Once ROS is shut down, log under a name that is not on /rosout, about which rcl would
        # complain at every line.
        alone = get_logger(self.get_fully_qualified_name())
        self._log = Log(lambda: self.get_logger() if self.context.ok() else alone)
        self._values = values = declare(self, CHARACTERIZATION)
        warn_of_unknown(self)
        if values['aiding_interval'] > values['coast']:
            raise ImuAllanError(f'parameter aiding_interval: {values["aiding_interval"]:g} s is '
                                f'longer than coast, {values["coast"]:g} s')

        self._receptions = receptions(self, self._log, values)
        subscribed = [reception.facts.topic for reception in self._receptions]
        self._facts, name = self._receptions[0].facts, self.get_fully_qualified_name()
        self._outputs = OutputTopics(self)
        self._worker = Worker(self._log)
        self._facts.errors = self._worker.errors
        self._fitting = Fitting(name, self._outputs, self._worker, self._facts,
                                self._receptions[0].changes, values)
        setup = Setup(tuple(subscribed), TimelineOptions(
            clock=values['clock'], gap_tolerance=values['gap_tolerance'],
            motion=values['motion']), {name: values[name] for name in READING if values[name]})
        self._thermometer = Thermometer(self, self._log, self._facts, len(subscribed),
                                        values['temperature_topic'])
        warn_of_unknown(self, qos=True)
        self._storage = Storage(name, setup, self._worker, self._facts, self._log, values)
        run, *others = self._storage.resumed_or_new_run()
        # Messages held back are lost in a crash: hold at most half of the time that may be lost.
        self._runs = Runs(setup, run, [
            (reception.facts, reception.subscription.publisher_gids)
            for reception in self._receptions],
            lambda: min(LOOK_S, values['checkpoint_period'] / 2), self._leave, self._log, others)

        self.create_service(Trigger, '~/save', self._save)
        self.create_service(Trigger, '~/reset', self._reset)
        self.create_service(SetBool, '~/pause', self._pause)
        if run.resumed:
            self._fitting.fit(run)
        self._storage.try_output()
        self._last_tick = self._last_report = self._last_look = time.monotonic()
        self._last_cpu = time.process_time()
        # With use_sim_time but no /clock, a timer on the ROS clock would never fire.
        self._timer = self.create_timer(TICK_S, self._on_timer, MutuallyExclusiveCallbackGroup(),
                                        Clock(clock_type=ClockType.STEADY_TIME))
        self._log.info(f'characterizing the IMU on {" and ".join(subscribed)}')

    def serve(self, stop: StopRequest) -> int:
        """Run until `stop` is set, more cheaply than by spinning, then save; return the status."""
        # A timer would wake the executor twice per tick: again after its callback.
        self.destroy_timer(self._timer)
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        well = True
        try:
            wait_s = TICK_S
            while not stop.requested:
                try:
                    executor.spin_once(wait_s)
                except ExternalShutdownException:
                    # ROS has been shut down, but the run can still be saved.
                    break
                except Exception as error:
                    # Such as a request that rclpy cannot read: it must not end a run of days.
                    self._log.error(f'a request failed ({type(error).__name__}: {error}); the '
                                    'node goes on', 'failed request')
                    time.sleep(0.05)
                if time.monotonic() - self._last_tick >= wait_s:
                    wait_s = self._tick()
        except Exception as error:
            # Whatever the error, it must not lose days of samples.
            well = False
            self._log.bug(error, 'the node ends and saves what it has learnt')
        finally:
            executor.shutdown()
        return 0 if self.finish(well) and well else 1

    def destroy_node(self) -> None:
        """Save what has not been saved yet, then destroy the node."""
        self.finish()
        super().destroy_node()

    # -- one tick: take samples, start what is due, deliver what is finished ---------------------

    def _on_timer(self) -> None:
        period_ns = round(self._tick() * 1e9)
        if self.context.ok() and period_ns != self._timer.timer_period_ns:
            self._timer.timer_period_ns = period_ns

    def _tick(self) -> float:
        """Do what is due; return the time until the next tick."""
        try:
            return self._do_what_is_due()
        except RCLError:
            # Another thread of an executor may shut ROS down in the meantime.
            if self.context.ok():
                raise
            return TICK_S

    def _do_what_is_due(self) -> float:
        with self._lock:
            now = time.monotonic()
            count = self._catch_up(now)
            self._worker.hand_out()
            self._outputs.serve_newcomers()
            if self._fitting.due(now):
                self._fitting.publish_or_fit(now, self._runs.run, max(
                    reception.last_message for reception in self._receptions))
            if self._storage.checkpoint_due(now, self._runs.saved):
                self._storage.checkpoint(self._runs.saved)
            if now - self._last_report >= REPORT_S:
                self._thermometer.look_beside()
                self._report(now)
                self._fitting.draw_if_watched(self._runs.run)
            elapsed_s, self._last_tick = now - self._last_tick, now
        # Take a quarter of the queue in one tick, as far as the latest rate predicts it.
        quarter_s = elapsed_s * (QUEUE_MESSAGES // 4) / max(count, 1)
        return min(TICK_S, max(0.05, quarter_s))

    def _catch_up(self, now: float) -> int:
        """Take in all messages so far; return their number on the busiest topic."""
        taken = self._take(now)
        self._thermometer.feed([lane.characterization for lane in self._runs.run.lanes])
        for number, by_publisher in enumerate(taken):
            for publisher, blocks in by_publisher:
                self._runs.take(number, publisher, blocks)
        return max(reception.taken for reception in self._receptions)

    def _take(self, now: float) -> list[list[tuple[int, list[ImuBlock]]]]:
        """Take the messages so far, by topic and publisher; none after the shutdown of ROS."""
        if not self.context.ok():
            return []
        self._thermometer.take()
        return [reception.take(now) for reception in self._receptions]

    # -- reports ---------------------------------------------------------------------------------

    def _report(self, now: float) -> None:
        """Update the facts about each topic, write the log, and publish them."""
        cpu = time.process_time()
        received = sum([reception.look(now, now - self._last_report)
                        for reception in self._receptions])
        for reception in self._receptions:
            if received:
                reception.facts.cpu_s = (cpu - self._last_cpu) / received
            reception.changes.see_reception(reception.facts)
        self._last_report, self._last_cpu = now, cpu
        result = self._fitting.latest
        self._receptions[0].changes.see_progress(now, self._facts, result)
        watched = bool(self._outputs.diagnostics.get_subscription_count())
        waited_for = any(reception.facts.received > 0 and reception.changes.began is None
                         for reception in self._receptions)
        if watched or waited_for or now - self._last_look >= UNWATCHED_S:
            self._last_look = now
            topics = [self._look(now, *each) for each in zip(
                self._receptions, self._runs.run.lanes, strict=True)]
            if watched:
                self._outputs.diagnostics.publish(diagnostics_message(
                    self.get_fully_qualified_name(), self.get_clock().now().to_msg(), topics,
                    result))
                for reception in self._receptions:
                    reception.facts.longest_hold_s = 0.0

    def _look(self, now: float, reception: Reception, lane: Lane
              ) -> tuple[Facts, TimelineSummary]:
        """Summarize the timeline of a topic, and log what has changed."""
        facts = reception.facts
        snapshot = lane.snapshot()
        facts.update_error = snapshot.finish()
        if facts.update_error:
            self._log.error(facts.update_error, f'useless samples {facts.topic}')
        summary = snapshot.characterization.summary()
        facts.timeline = summary.timeline
        facts.recent.see(now, timeline_counts(summary), known=facts.on_probation)
        reception.changes.see_timeline(now, facts, summary)
        return facts, summary

    # -- change of runs --------------------------------------------------------------------------

    def _leave(self, run: Run, why: UnusableState) -> None:
        """Save a run that another one replaces, and keep its state aside."""
        self._storage.save(run)
        self._storage.keep_aside(run, why)
        self._forget_run()

    def _forget_run(self) -> None:
        self._fitting.begin_run()
        for reception in self._receptions:
            reception.changes.begin_run()

    # -- services -------------------------------------------------------------------------------

    def _save(self, *_: object) -> Trigger.Response:
        with self._lock:
            self._catch_up(time.monotonic())
            future = self._storage.save(self._runs.run)
        failure = self._failure(future)
        return Trigger.Response(success=not failure,
                                message=failure or '\n'.join(map(str, future.result())))

    def _reset(self, *_: object) -> Trigger.Response:
        with self._lock:
            self._take(time.monotonic())
            self._runs.begin_anew()
            self._forget_run()
            self._facts.resumed = ''
            self._fitting.fit(self._runs.run)
            future = self._storage.checkpoint(self._runs.saved)
        failure = '' if future is None else self._failure(future)
        message = 'a new run has begun' + (f', but {failure}' if failure else '')
        self._log.info(message, 'reset')
        return Trigger.Response(success=not failure, message=message)

    def _pause(self, request: SetBool.Request, _: SetBool.Response) -> SetBool.Response:
        with self._lock:
            self._catch_up(time.monotonic())
            changes = request.data != self._facts.paused
            for reception in self._receptions:
                reception.facts.paused = request.data
        message = ('paused: samples are passed over' if request.data else
                   'going on; the pause counts as a gap' if changes else 'not paused')
        if changes:
            self._log.info(message)
        return SetBool.Response(success=True, message=message)

    def _failure(self, future: 'Future[Any]') -> str:
        """Wait for the worker while samples are taken; return what went wrong, if anything."""
        wait_s = 0.0
        while not wait([future], wait_s).done:
            with self._lock:
                # `finish`, in another thread, may have waited for it, too.
                wait_s = 0.0 if future.done() else self._tick()
        error = future.exception()
        return '' if error is None else printable(error)

    # -- the end --------------------------------------------------------------------------------

    def finish(self, is_over: bool = True) -> bool:
        """
        Take in what is still queued, write state and result; return whether all succeeded.

        Without `is_over`, the next start resumes the run, as after a crash.
        """
        with self._lock:
            if self._ended:
                return True
            self._ended = True
            # Nothing is published any more, but the outcome of writing files is logged.
            self._worker.drop_all_but({'save', 'checkpoint', 'aside'})
            # Every step is attempted, even if an earlier one has failed.
            done = [self._attempt(step) for step in (
                lambda: self._catch_up(time.monotonic()),
                self._runs.finish,
                lambda: self._storage.save_state_at_end(self._runs.saved),
                # Plots come last: there may be no time for them.
                lambda: (self._runs.unproven is None
                         or self._storage.save_files_at_end(self._runs.unproven, picture=False)),
                lambda: self._storage.save_files_at_end(self._runs.run),
                self._worker.finish)]
            if (result := self._runs.run.saved or self._fitting.latest) is not None:
                for line in closing_lines(result, self._values['aiding_interval'],
                                          self._values['coast']):
                    self._log.info(line)
            self._storage.close(is_over and all(done))
            return (all(done) and not self._storage.incomplete
                    and not self._worker.errors.get('save'))

    def _attempt(self, step: Callable[[], object]) -> bool:
        try:
            return step() is not False
        except ImuAllanError as error:
            self._log.error(str(error), f'at the end: {type(error).__name__}')
        except Exception as error:
            self._log.bug(error, 'the node saves the rest and ends')
        return False
