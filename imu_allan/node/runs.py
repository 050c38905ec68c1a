# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Assignment of messages to the current run, to the run of another IMU, or to none.

When the publisher, the frame_id or the rate changes, messages are held back until they show which
IMU they are from. Those of another IMU form a run of their own, which replaces the current one
once it has lasted long enough. If the first IMU returns, its run goes on.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from imu_allan.block import ImuBlock
from imu_allan.node.checkpoint import UnusableState
from imu_allan.node.diagnostics import Facts
from imu_allan.node.log import Log
from imu_allan.node.run import Lane, new_run, Run, Setup
from imu_allan.node.same_imu import FEWEST_MESSAGES, in_parts, Known, LOOK_S, messages
from imu_allan.wording import duration


@dataclass
class _Topic:
    """What is known about the source of the messages on a topic."""

    number: int
    facts: Facts
    publisher: int | None = None  # whose messages are in use
    elsewhere: bool = False  # its messages are from another IMU than that of the run
    held: list[ImuBlock] = field(default_factory=list)  # messages whose IMU is not known yet
    holding: int | None = None  # publisher of the held messages


class Runs:
    """The current run, and one of another IMU that may replace it."""

    def __init__(self, setup: Setup, run: Run, facts: Sequence[Facts],
                 look_s: Callable[[], float], replaced: Callable[[Run, UnusableState], None],
                 log: Log, offers: Callable[[int], set[str]]) -> None:
        self.run = run
        self._setup = setup
        self._look_s = look_s
        self._replaced = replaced
        self._log = log
        self._offers = offers
        self._topics = [_Topic(number, each) for number, each in enumerate(facts)]
        self._other: Run | None = None
        self._why = UnusableState('', '')

    @property
    def unproven(self) -> Run | None:
        """Return the run of another IMU that has not replaced this one yet, or not again."""
        settled = self._other is None or (
            self._other.over and not any(topic.elsewhere for topic in self._topics))
        return None if settled else self._other

    def begin_anew(self) -> None:
        """Begin a new run and drop held messages; the publishers stay known."""
        self._other = None
        for topic in self._topics:
            topic.holding, topic.held, topic.facts.on_probation = None, [], False
        self._take_up(new_run(self._setup))

    def take(self, number: int, publisher: int, blocks: Sequence[ImuBlock]) -> None:
        """Take messages of one publisher on a topic."""
        topic = self._topics[number]
        rate_hz = self._lane(topic).known.rate_hz
        # Messages queued while the node was busy may be from one IMU first, then from another.
        most = max(round(LOOK_S * rate_hz), FEWEST_MESSAGES) if rate_hz else messages(blocks)
        for part in in_parts(blocks, most):
            ends = [number for number, (one, other) in enumerate(pairwise(part), 1)
                    if one.frame_id != other.frame_id]
            # One change is judged by what follows it; two sensors in turn are judged together.
            change = ends[0] if len(ends) == 1 else 0
            for some in filter(None, (part[:change], part[change:])):
                self._take_part(topic, publisher, some)

    def _take_part(self, topic: _Topic, publisher: int, blocks: Sequence[ImuBlock]) -> None:
        """Take messages that are judged together."""
        if topic.publisher is None and not self._lane(topic).known.frame_id:
            topic.publisher = publisher
        if topic.holding is None and publisher == topic.publisher:
            lane = self._lane(topic)
            if not (lane.leaves_out_all or lane.known.may_be_another(blocks)):
                self._feed(topic, blocks)
                return
        if topic.holding not in (None, publisher):
            # No more messages will be added to those that are held.
            self._decide(topic)
        topic.holding = publisher
        topic.held += blocks
        topic.facts.on_probation = True
        if self._lane(topic).known.suffices(topic.held, self._look_s()):
            self._decide(topic)

    def finish(self) -> None:
        """Decide on the messages that are still held; too few are passed over."""
        for topic in self._topics:
            if topic.held:
                self._decide(topic)

    def _run_of(self, topic: _Topic) -> Run:
        return self._other if topic.elsewhere and self._other is not None else self.run

    def _lane(self, topic: _Topic) -> Lane:
        return self._run_of(topic).lanes[topic.number]

    def _decide(self, topic: _Topic) -> None:
        """Give the held messages to the run of their IMU."""
        held, publisher = topic.held, topic.holding
        topic.held, topic.holding, topic.facts.on_probation = [], None, False
        if messages(held) < FEWEST_MESSAGES:
            # Too few to identify the IMU.
            topic.facts.skipped += messages(held)
            return
        was, topic.publisher = topic.publisher, publisher
        is_new = publisher != was
        lane = self.run.lanes[topic.number]
        why = lane.known.mismatch(held)
        if why is not None:
            self._give_to_another_run(topic, why, held, is_new)
            return
        if topic.elsewhere:
            topic.elsewhere = False
            self._log.info(f'the messages on {topic.facts.topic} are of the IMU of the run again: '
                           'it goes on')
            lane.power_on()
        elif self._is_started_anew(lane.known, topic) if was is None else is_new and lane.fed:
            self._log.info(f'the driver on {topic.facts.topic} was started anew: the IMU may have '
                           'been switched off and on, so its mean is another one from here on. '
                           'Call ~/reset if it is another IMU')
            lane.power_on()
        lane.known.publishers = []
        self._feed(topic, held)

    def _is_started_anew(self, known: Known, topic: _Topic) -> bool:
        """Return whether the driver, by its publishers, restarted while the node was down."""
        there = self._offers(topic.number)
        return bool(there and known.publishers) and there.isdisjoint(known.publishers)

    def _give_to_another_run(self, topic: _Topic, why: UnusableState, held: list[ImuBlock],
                             is_new: bool) -> None:
        """Give messages to the run of the other IMU, or to a new run if they are not from it."""
        number, other = topic.number, self._other
        was_there = topic.elsewhere
        if other is None or other.lanes[number].known.mismatch(held) is not None:
            was_there, other = False, new_run(self._setup)
            known = self.run.lanes[number].known.another(held)
            while len(held) > 1 and known.may_be_another(held[:1]):
                # These are from before the change.
                held = held[1:]
            other.lanes[number].known = known
        elif is_new:
            other.lanes[number].power_on()
        self._other, topic.elsewhere, self._why = other, True, why
        if not was_there:
            self._log.warning(
                f'the messages on {topic.facts.topic} are of another IMU, or it has been set '
                f'otherwise: {why}. If they go on for {duration(self._proof_s())} they begin a '
                'new run, ~/reset begins one at once', f'another IMU {number}', 0.0)
        self._feed(topic, held)

    def _feed(self, topic: _Topic, blocks: Sequence[ImuBlock]) -> None:
        number, run = topic.number, self._run_of(topic)
        lane = run.lanes[number]
        lane.update(blocks)
        if not lane.known.publishers:
            lane.known.publishers = sorted(self._offers(number))
        topic.facts.looping, topic.facts.update_error = lane.seen.looping, lane.error
        if lane.error:
            self._log.error(lane.error, f'useless samples {number}')
        if run is self._other:
            if run.span_s >= self._proof_s():
                self._replace()
        elif self._other is not None and any(one.elsewhere for one in self._topics):
            # If one sensor of the IMU begins a new run, so does the other.
            self._other.lanes[number].update(blocks)

    def _proof_s(self) -> float:
        """Return how long another IMU has to last: a tenth of the run that it replaces."""
        # A reconfigured driver settles within ten seconds; users do not wait longer than ten
        # minutes. Chosen by judgment.
        return min(max(0.1 * self.run.span_s, 10.0), 600.0)

    def _replace(self) -> None:
        """Replace the current run by that of the other IMU."""
        before, run = self.run, self._other
        assert run is not None
        begins = 'the run of before goes on' if run.over else 'a new run begins'
        self._log.warning(f'{begins}, the one before cannot go on: {self._why}', 'new run', 0.0)
        self._replaced(before, self._why)
        self._other = before
        self._take_up(run)

    def _take_up(self, run: Run) -> None:
        self.run.over = True
        self.run, run.over = run, False
        for topic in self._topics:
            topic.elsewhere = topic.facts.looping = False
