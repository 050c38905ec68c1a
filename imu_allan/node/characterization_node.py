# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The node beside an IMU driver, in one class because it is one object to ROS (more than 300 lines).

The executor's one thread takes samples, feeds them to the run and answers services. Everything
that takes longer (fit, plot, files) is done by the worker's thread on a snapshot, so that the
middleware's queue never has to hold more than moments. Nothing that a driver, a listener or a disk
does lets an error out of the executor's thread; if one gets out all the same, `serve` saves first.
"""

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future
from contextlib import suppress
from dataclasses import dataclass
from math import ceil
from pathlib import Path
import time
from typing import Any

from builtin_interfaces.msg import Time
from imu_allan.block import ImuBlock
from imu_allan.cdr import MalformedImu
from imu_allan.characterization import Characterization
from imu_allan.errors import ImuAllanError, printable
from imu_allan.node.announcements import Announcements, SILENCE_S
from imu_allan.node.checkpoint import StateFile, UnusableState
from imu_allan.node.diagnostics import diagnostics_message, Facts
from imu_allan.node.drained_subscription import DrainedSubscription
from imu_allan.node.log import Log
from imu_allan.node.parameters import declare, warn_of_unknown
from imu_allan.node.process import give_back_memory, StopRequest
from imu_allan.node.publications import Publications
from imu_allan.node.reception import Reception
from imu_allan.node.result_messages import Filter, result_messages, ResultMessages
from imu_allan.node.resuming import pack, Setup, unpack
from imu_allan.node.run import Run
from imu_allan.node.same_imu import Signature, Trial, TRIAL_S
from imu_allan.node.saving import (
    claimed,
    IncompleteSave,
    NothingToSave,
    other_folders,
    run_folder,
    save_run,
    try_folder,
)
from imu_allan.node.settings import SETTINGS
from imu_allan.node.standards import Finding, Standards
from imu_allan.node.worker import Worker
from imu_allan.result import Result
from imu_allan.timeline import TimelineOptions
from imu_allan.wording import counted, duration
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos_overriding_options import InvalidQosOverridesError
from sensor_msgs.msg import CompressedImage, Imu
from std_srvs.srv import SetBool, Trigger

TOPIC = 'imu/data_raw'
QUEUE_S = 2.5
"""The queue holds so many seconds of samples at the expected rate."""
QUEUE_MESSAGES = 10_000
"""The queue holds at least so many messages: 2 s of an IMU at 5 kHz."""
TICK_S = 0.2
FEED_S = 0.5
REPORT_S = 1.0
LOOK_S = 5.0
"""The log looks at the timeline so often where no report does: a copy each time."""
FIT_SHARE = 5.0
"""On a slow computer a fit is followed by so many times its own duration without one."""
FIT_GROWTH = 0.03
"""The next fit waits until the record is longer by this: it narrows an interval by 1.5 %."""
SETTLED_S = 2.0
"""Where no further sample comes for so long, what has come is fitted to the end."""


@dataclass
class _NextSave:
    """The save asked for last; `snapshot` is empty once the worker has begun with it."""

    of: tuple[Run, str, list[str]]
    snapshot: list[Characterization]
    future: 'Future[list[Path]]'


@dataclass(frozen=True)
class _Fitted:
    """What the worker makes of a snapshot."""

    result: Result
    messages: ResultMessages
    findings: list[Finding]
    took_s: float


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
        self._log = Log(self.get_logger())
        values = declare(self, SETTINGS, self._apply)
        warn_of_unknown(self)
        self._publish_period: float = values['publish_period']
        self._checkpoint_period: float = values['checkpoint_period']
        self._output_dir: str = values['output_dir']
        self._export_for: list[str] = list(values['export_for'])
        self._aiding_interval: float = values['aiding_interval']
        self._coast: float = values['coast']
        if self._aiding_interval > self._coast:
            raise ImuAllanError(f'parameter aiding_interval: {self._aiding_interval:g} s is '
                                f'longer than coast, {self._coast:g} s')
        self._standards = Standards(values['spec_file'], values['reference'])

        queue = queue_messages(values['expected_rate'])
        self._subscription = self._subscribe(queue)
        topic = self._subscription.topic
        self._facts = Facts(topic, queue, values['expected_rate'], values['state_file'])
        self._reception = Reception(self._subscription, self._facts, self._on_malformed)
        self._announcements = Announcements(self._log, topic)
        self._setup = Setup(topic, TimelineOptions(
            clock=values['clock'], gap_tolerance=values['gap_tolerance'],
            motion=values['motion']))
        self._state_file = StateFile(values['state_file']) if values['state_file'] else None
        self._run = self._first_run()
        self._result: Result | None = None
        self._messages: ResultMessages | None = None
        self._plotted: Result | None = None

        self._publications = Publications(self)
        # Services wait for the worker while samples come in: they have a group of their own.
        services = ReentrantCallbackGroup()
        self.create_service(Trigger, '~/save', self._save, callback_group=services)
        self.create_service(Trigger, '~/reset', self._reset, callback_group=services)
        self.create_service(SetBool, '~/pause', self._pause, callback_group=services)

        self._worker = Worker(self._log)
        self._next_save: _NextSave | None = None
        self._saved_at: float | None = None
        now = time.monotonic()
        self._reception.last_take = self._reception.last_message = self._last_feed = now
        self._last_checkpoint = self._last_report = self._last_look = now
        self._next_publication, self._next_fit = now + self._publish_period, now
        self._last_complaint = now - 6 * SILENCE_S
        self._last_report_cpu, self._last_report_received = time.process_time(), 0
        # The clock of ROS stands still in simulated time without /clock.
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(TICK_S, self._tick, clock=self._steady)
        if self._run.trial is not None:
            self._start_fit()
        self._start_trying_output()
        self._log.info(f'characterizing the IMU on {topic}')

    def serve(self, stop: StopRequest) -> int:
        """
        Work until `stop` is set, then save.

        Returns
        -------
        int
            Exit status: 0, or 1 if something went wrong or could not be saved.

        """
        executor = SingleThreadedExecutor()
        executor.add_node(self)
        well = True
        try:
            while not stop:
                executor.spin_once()
        except ExternalShutdownException:
            # ROS is gone, what was learnt is not.
            pass
        except Exception as error:
            # Whatever it was: days of samples must not go with it.
            well = False
            self._log.bug(error, 'the node ends and saves what it has learnt')
        finally:
            executor.shutdown()
        return 0 if self._finish() and well else 1

    def _subscribe(self, queue: int) -> DrainedSubscription:
        try:
            return DrainedSubscription(self, Imu, TOPIC, queue)
        except (InvalidQosOverridesError, RuntimeError) as error:
            raise ImuAllanError(f'qos_overrides of {TOPIC}: {error}') from error

    def _apply(self, name: str, value: Any) -> None:
        if name in ('publish_period', 'checkpoint_period', 'output_dir', 'export_for',
                    'aiding_interval', 'coast'):
            setattr(self, f'_{name}', value)
        if name == 'publish_period':
            self._next_publication = time.monotonic() + value
        elif name == 'output_dir':
            self._start_trying_output()
        elif self._aiding_interval > self._coast:
            self._log.warning('aiding_interval is longer than coast: no filter_random_walk is '
                              'published')

    # -- one tick: samples in, what is due started, what is done handed out ---------------------

    def _tick(self) -> None:
        now = time.monotonic()
        self._reception.take(now)
        if now - self._last_feed >= FEED_S:
            self._feed(now)
        self._worker.hand_out()
        if now >= self._next_publication:
            self._publish_or_fit(now)
        if self._state_file is not None and self._checkpoint_due(now):
            self._start_checkpoint()
        if now - self._last_report >= REPORT_S:
            self._report(now)

    def _feed(self, now: float) -> None:
        self._last_feed = now
        blocks = self._reception.blocks(now)
        run = self._run
        if not blocks:
            return
        if run.trial is not None:
            run.trial.hold(blocks)
            if run.trial.complete:
                self._end_trial(run.trial)
            return
        self._update(blocks)
        # Where two publishers take turns, neither has changed.
        changed = run.changed(blocks) if self._facts.publishers <= 1 else None
        if changed is not None:
            self._start_save(self._output_dir)
            self._begin_because(*changed)

    def _update(self, blocks: Sequence[ImuBlock]) -> None:
        run = self._run
        run.update(blocks)
        self._facts.looping = run.looping
        self._facts.update_error = run.error
        if run.error:
            self._log.error(run.error)

    def _on_malformed(self, error: MalformedImu) -> None:
        self._log.error(f'{self._subscription.topic}: {error}')

    def _end_trial(self, trial: Trial) -> None:
        verdict = trial.verdict()
        self._run.trial = None
        self._facts.on_trial = False
        self._last_checkpoint = time.monotonic() - self._checkpoint_period
        if verdict is None:
            self._update(trial.blocks)
        else:
            self._begin_because(verdict, trial.blocks)

    def _begin_because(self, verdict: UnusableState, blocks: Sequence[ImuBlock]) -> None:
        """Leave the run, its state kept aside, and begin another with these messages."""
        self._log.warning(f'a new run begins: the one before cannot be gone on with, {verdict}')
        if self._state_file is not None:
            self._start_keeping_aside(self._state_file, verdict)
        self._begin_anew()
        self._update(blocks)
        self._start_fit()

    # -- results -------------------------------------------------------------------------------

    def _publish_or_fit(self, now: float) -> None:
        """Publish every period: a new result if one is due, else the last one again."""
        # On a fixed grid: a period that is no multiple of the tick is kept on average.
        periods = (now - self._next_publication) // self._publish_period + 1
        self._next_publication += periods * self._publish_period
        self._feed(now)
        settled = now - self._reception.last_message > SETTLED_S
        if self._worker.under_way('fit'):
            return
        if self._run.fed != self._run.fitted and (now >= self._next_fit or settled):
            self._start_fit()
        elif self._messages is not None:
            # A volatile subscription that came late waits for no more than a period.
            self._publications.publish(self._messages)

    def _start_fit(self) -> None:
        began = time.monotonic()
        run, standards = self._run, self._standards
        run.fitted = run.fed
        snapshot, name = run.characterization.snapshot(), self.get_fully_qualified_name()
        stamp = run.stamp_ns or time.time_ns()
        filter_of = Filter(self._aiding_interval, self._coast)

        def fit() -> _Fitted:
            started = time.monotonic()
            result = snapshot.result()
            messages = result_messages(result, name, _time(stamp), filter_of)
            return _Fitted(result, messages, standards.judge(result),
                           time.monotonic() - started)

        def publish(future: Future[_Fitted]) -> None:
            if run is not self._run:
                return
            self._facts.fit_error = self._worker.failure(future)
            if self._facts.fit_error:
                return
            fitted = future.result()
            self._facts.fit_s, self._facts.findings = fitted.took_s, fitted.findings
            self._result, self._messages = fitted.result, fitted.messages
            run.learn(fitted.result)
            self._next_fit = began + max(FIT_SHARE * fitted.took_s,
                                         FIT_GROWTH * run.duration_s)
            give_back_memory()
            self._publications.publish(fitted.messages)
            self._announcements.see_result(fitted.result)
            self._announcements.see_standing(self._facts)
            self._draw_if_watched()

        self._worker.start('fit', fit, publish)

    def _draw_if_watched(self) -> None:
        result, plot = self._result, self._publications.plot
        if (result is None or not result.axes or result is self._plotted
                or self._worker.under_way('plot') or not plot.get_subscription_count()):
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
            if not self._worker.failure(future):
                plot.publish(future.result())

        self._worker.start('plot', draw, show)

    # -- what stays ----------------------------------------------------------------------------

    def _first_run(self) -> Run:
        """Begin with the run of the state file, or with a new one."""
        if self._state_file is None:
            return self._new_run()
        try:
            state = self._state_file.load()
            if state is None:
                return self._new_run()
            characterization = unpack(state, self._setup)
        except UnusableState as error:
            self._note_aside(error, self._state_file.keep_aside(error.reason))
            return self._new_run()
        summary = characterization.summary()
        self._facts.resumed = (f'resumed {duration(summary.timeline.duration_s)} of data from '
                               f'{self._state_file.path}')
        self._facts.on_trial = True
        self._log.info(self._facts.resumed)
        # Held back means lost in a crash: no more than half of what may be lost.
        return Run(characterization, Trial(
            Signature.of(summary), min(TRIAL_S, self._checkpoint_period / 2)))

    def _new_run(self) -> Run:
        return Run(Characterization(kind='topic', topic=self._setup.topic,
                                    options=self._setup.options))

    def _begin_anew(self) -> None:
        self._run = self._new_run()
        self._result = self._messages = self._plotted = None
        self._facts.on_trial = self._facts.looping = False
        self._facts.findings = []
        self._next_fit = time.monotonic()
        self._announcements.begin_run()

    def _start_keeping_aside(self, state_file: StateFile, verdict: UnusableState) -> None:
        """Give the state of the run another name, so that the next one cannot overwrite it."""
        run = self._run
        state = (pack(run.characterization, self._setup) if run.fed != run.checkpointed else None)

        def keep() -> Path:
            if state is not None:
                state_file.save(state)
            return state_file.keep_aside(verdict.reason)

        def note(future: 'Future[Path]') -> None:
            self._facts.checkpoint_error = self._worker.failure(future)
            if not self._facts.checkpoint_error:
                self._note_aside(verdict, future.result())

        self._worker.start('aside', keep, note)

    def _note_aside(self, unusable: UnusableState, aside: Path) -> None:
        assert self._state_file is not None
        self._facts.resumed = (f'a new run: {self._state_file.path} could not be resumed from, '
                               f'{unusable}; it is kept as {aside.name}')
        self._log.warning(self._facts.resumed)

    def _checkpoint_due(self, now: float) -> bool:
        run, period = self._run, self._checkpoint_period
        # Sooner than the period, so that a sample is not older when its checkpoint is on the disk.
        due = now - self._last_checkpoint >= max(period / 2, period - 2.0)
        return (due and run.trial is None and run.fed != run.checkpointed
                and not self._worker.under_way('checkpoint'))

    def _start_checkpoint(self) -> 'Future[int]':
        assert self._state_file is not None
        self._feed(time.monotonic())
        run, state_file = self._run, self._state_file
        began = self._last_checkpoint = time.monotonic()
        fed = run.fed
        state = pack(run.characterization, self._setup)

        def note(future: 'Future[int]') -> None:
            self._facts.checkpoint_error = self._worker.failure(future)
            if not self._facts.checkpoint_error:
                run.checkpointed = fed
                self._saved_at = began

        return self._worker.start('checkpoint', lambda: state_file.save(state), note)

    def _start_trying_output(self) -> None:
        folder = self._output_dir

        def note(future: 'Future[None]') -> None:
            if folder == self._output_dir:
                self._facts.output_error = self._worker.failure(future)

        self._worker.start('try', lambda: try_folder(folder), note)

    def _start_save(self, folder: str) -> 'Future[list[Path]]':
        self._feed(time.monotonic())
        snapshot = self._run.characterization.snapshot()
        name = self.get_fully_qualified_name()
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
                raise NothingToSave('nothing to save: too few usable samples have come from '
                                    f'{self._setup.topic} yet')
            return save_run(result, claimed(run_folder(folder, name, result)), consumers)

        def note(future: 'Future[list[Path]]') -> None:
            if isinstance(future.exception(), NothingToSave):
                # Whoever asked too early has the answer; nothing is wrong with the storage.
                return
            self._facts.save_error = self._worker.failure(future)
            if self._facts.save_error:
                return
            if folder == self._output_dir:
                self._facts.output_error = ''
            paths = future.result()
            self._log.info(f'wrote {", ".join(path.name for path in paths)} to {paths[0].parent}')

        self._next_save = _NextSave(of, waiting, self._worker.start('save', save, note))
        return self._next_save.future

    # -- services ------------------------------------------------------------------------------

    async def _save(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._reception.take(time.monotonic())
        future = self._start_save(self._output_dir)
        while not future.done():
            await _AWhile()
        error = future.exception()
        response.success = error is None
        response.message = (printable(error) if error is not None else
                            '\n'.join(str(path) for path in future.result()))
        return response

    async def _reset(self, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._reception.take(time.monotonic())
        self._reception.drop()
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
        self._log.info(response.message)
        return response

    def _pause(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        now = time.monotonic()
        self._reception.take(now)
        self._feed(now)
        self._facts.paused = request.data
        response.success = True
        response.message = ('paused: samples are passed over' if request.data
                            else 'going on; the pause counts as a gap')
        self._log.info(response.message)
        return response

    # -- diagnostics and log --------------------------------------------------------------------

    def _report(self, now: float) -> None:
        facts = self._facts
        facts.publishers = self._subscription.publishers
        facts.silent_s = now - self._reception.last_message
        cpu, received = time.process_time(), facts.received - self._last_report_received
        if received:
            facts.cpu_s = (cpu - self._last_report_cpu) / received
        facts.received_hz = received / (now - self._last_report)
        facts.checkpoint_age_s = None if self._saved_at is None else now - self._saved_at
        self._last_report, self._last_report_cpu = now, cpu
        self._last_report_received = facts.received
        if not facts.publishers:
            facts.refused = self._subscription.refused_publishers()
        names = self._subscription.publisher_names() if facts.publishers > 1 else []
        self._announcements.see_reception(facts, names)
        if facts.silent_s > SILENCE_S and now - self._last_complaint > 6 * SILENCE_S:
            self._last_complaint = now
            self._complain_of_silence()
        self._announcements.see_progress(now, facts, self._result)
        self._draw_if_watched()
        watched = bool(self._publications.diagnostics.get_subscription_count())
        waited_for = facts.received > 0 and not self._announcements.has_begun
        if watched or waited_for or now - self._last_look >= LOOK_S:
            self._last_look = now
            self._look(now, watched)

    def _look(self, now: float, watched: bool) -> None:
        """Look at the timeline, for the log and for who listens to /diagnostics."""
        facts = self._facts
        own = self.get_name(), self.get_namespace()
        facts.namesakes = self.get_node_names_and_namespaces().count(own) - 1
        snapshot = self._run.characterization.snapshot()
        try:
            snapshot.finish()
        except ImuAllanError as error:
            # The samples that the timeline holds back are of no use; the next ones may be.
            facts.update_error = str(error)
            self._log.error(facts.update_error)
        else:
            facts.update_error = ''
        summary = snapshot.summary()
        facts.moved_s = summary.excluded_s
        self._announcements.see_timeline(now, facts, summary)
        if watched:
            self._publications.diagnostics.publish(diagnostics_message(
                self.get_fully_qualified_name(), self.get_clock().now().to_msg(), facts, summary,
                self._result))
            facts.longest_hold_s = 0.0

    def _complain_of_silence(self) -> None:
        topic, facts = self._subscription.topic, self._facts
        others = [name for name, types in self.get_topic_names_and_types()
                  if 'sensor_msgs/msg/Imu' in types and name != topic
                  and self.count_publishers(name)]
        text = f'no message on {topic} for {facts.silent_s:.0f} s'
        if facts.publishers:
            text += f', though there is {counted(facts.publishers, "publisher")}'
        elif facts.refused:
            text += f'; {"; ".join(facts.refused)}'
        elif others:
            text += (f'; Imu topics here: {", ".join(sorted(others))}; choose one with '
                     f'--ros-args -r {TOPIC}:=TOPIC')
        else:
            text += '; no node publishes Imu messages'
        self._log.warning(text)

    # -- the end ---------------------------------------------------------------------------------

    def _finish(self) -> bool:
        """Take what is still queued, write state and result; return whether all was well."""
        # One after the other: what fails costs the others nothing.
        done = [self._attempt(step) for step in (self._take_rest, self._save_state,
                                                 self._save_files)]
        done.append(self._attempt(self._end_worker))
        if self._state_file is not None:
            self._state_file.close()
        return all(done)

    def _attempt(self, step: Callable[[], bool]) -> bool:
        try:
            return step()
        except ImuAllanError as error:
            self._log.error(str(error), f'at the end: {error}')
        except Exception as error:
            self._log.bug(error, 'the node saves the rest and ends')
        return False

    def _take_rest(self) -> bool:
        now = time.monotonic()
        if self.context.ok():
            self._reception.take(now)
        self._feed(now)
        trial = self._run.trial
        if trial is not None and not trial.hopeless:
            self._end_trial(trial)
        return True

    def _save_state(self) -> bool:
        if self._state_file is not None and self._run.fed != self._run.checkpointed:
            self._start_checkpoint().result()
        return True

    def _save_files(self) -> bool:
        if not self._run.fed:
            return True
        try:
            self._start_save(self._output_dir).result()
        except NothingToSave as error:
            self._log.info(str(error))
        except IncompleteSave:
            raise
        except ImuAllanError as error:
            self._log.error(str(error), f'at the end: {error}')
            state = None if self._state_file is None else self._state_file.path
            for folder in other_folders(state):
                with suppress(ImuAllanError):
                    self._start_save(folder).result()
                    break
            return False
        return True

    def _end_worker(self) -> bool:
        # Nobody listens any more; but what became of files is told.
        self._worker.finish({'save', 'checkpoint', 'aside'})
        return True


def queue_messages(expected_rate: float) -> int:
    """Give the depth of the queue for a rate in Hz; 0 is unknown."""
    return max(QUEUE_MESSAGES, ceil(QUEUE_S * expected_rate))


class _AWhile:
    """Lets the executor go on; it comes back when it wakes the next time."""

    def __await__(self) -> Generator[None, None, None]:
        yield


def _time(stamp_ns: int) -> Time:
    # The nanoseconds of a broken stamp can carry its seconds beyond what a message can hold.
    seconds, nanoseconds = divmod(min(stamp_ns, 2**31 * 1_000_000_000 - 1), 1_000_000_000)
    return Time(sec=seconds, nanosec=nanoseconds)
