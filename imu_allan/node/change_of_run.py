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
from itertools import groupby

from imu_allan.block import ImuBlock
from imu_allan.node.diagnostics import Facts
from imu_allan.node.log import Log
from imu_allan.node.reception import MIXED
from imu_allan.node.run import (
    FEWEST_MESSAGES,
    Lane,
    LOOK_S,
    messages,
    new_run,
    Run,
    Setup,
    UnusableState,
)
from imu_allan.wording import duration


@dataclass
class _Topic:
    """What is known about the source of the messages on a topic."""

    number: int
    facts: Facts
    offers: Callable[[], set[str]]  # returns the GIDs of the publishers that are there
    publisher: int | None = None  # whose messages are in use
    heard_ns: int = 0  # receive time of its last message
    held: list[ImuBlock] = field(default_factory=list)  # messages whose IMU is not known yet
    holding: int | None = None  # publisher of the held messages
    strangers: set[int] = field(default_factory=set)  # other publishers, heard beside this one

    def pass_over(self, blocks: Sequence[ImuBlock]) -> None:
        """Discard messages of an unknown or another publisher, and count them."""
        self.facts.mixed_samples += messages(blocks)

    def release(self) -> tuple[list[ImuBlock], int | None]:
        """Hold messages back no longer; return them and their publisher."""
        held, publisher = self.held, self.holding
        self.held, self.holding, self.facts.on_probation = [], None, False
        return held, publisher


class Runs:
    """The current run, and one of another IMU that may replace it."""

    def __init__(self, setup: Setup, run: Run,
                 topics: Sequence[tuple[Facts, Callable[[], set[str]]]],
                 look_s: Callable[[], float], replaced: Callable[[Run, UnusableState], None],
                 log: Log, others: Sequence[Run] = ()) -> None:
        self.run = run
        self._setup = setup
        self._look_s = look_s
        self._replaced = replaced
        self._log = log
        self._topics = [_Topic(number, *each) for number, each in enumerate(topics)]
        # Runs of other IMUs: the one that messages from elsewhere go to, if any do or did, and
        # those that were replaced and may come back.
        self._others = list(others)
        self._why = UnusableState('', '')

    @property
    def saved(self) -> list[Run]:
        """Return what a crash must not lose: the run, and one that may replace it."""
        return [self.run, *filter(None, [self.unproven])]

    @property
    def unproven(self) -> Run | None:
        """Return the run of another IMU that has not replaced this one yet, or not again."""
        return next((run for run in self._others[:1] if not run.over or self._any_elsewhere), None)

    @property
    def _any_elsewhere(self) -> bool:
        return any(topic.facts.elsewhere for topic in self._topics)

    def begin_anew(self) -> None:
        """
        Begin a new run and drop held messages; the publishers stay known.

        If messages are of another IMU already, its run replaces the current one, which is saved.
        """
        for topic in self._topics:
            topic.release()
        if self._any_elsewhere:
            self._replace()
            return
        self._others = []
        self._take_up(new_run(self._setup))

    def take(self, number: int, publisher: int, blocks: Sequence[ImuBlock]) -> None:
        """Take messages of one publisher on a topic."""
        topic = self._topics[number]
        # Messages queued while the node was busy may be from one IMU first, then from another.
        for part in self._lane(topic).known.parts(blocks):
            by_frame = [list(same) for _, same in groupby(part, lambda block: block.frame_id)]
            if publisher != MIXED:
                # One change is judged by what follows it, two sensors in turn together.
                for some in by_frame if len(by_frame) == 2 else [part]:
                    self._take_part(topic, publisher, some)
            elif len(by_frame) > 1:
                # The publishers have different frame_ids: the timeline keeps to the first one.
                self._feed(topic, part)
            else:
                topic.pass_over(part)

    def _take_part(self, topic: _Topic, publisher: int, blocks: Sequence[ImuBlock]) -> None:
        """Take messages that are judged together."""
        last_ns = int(blocks[-1].receive_ns[-1])
        lane = self._lane(topic)
        if topic.publisher is None and lane.known.frame_id is None:
            topic.publisher = publisher
        # Until the publisher in use has been silent for this long, any other one is a stranger.
        alone_ns = 2_000_000_000
        if topic.heard_ns - last_ns > alone_ns:
            # The clock of the computer was set back.
            topic.heard_ns = int(blocks[0].receive_ns[0]) - 1
        if publisher == topic.publisher:
            topic.heard_ns = last_ns
            if topic.holding not in (None, publisher):
                # It goes on, so the other one is a stranger.
                self._decide(topic)
            if topic.holding != publisher and not (
                    lane.leaves_out_all or lane.known.may_be_another(blocks)):
                self._feed(topic, blocks)
                return
        elif publisher in topic.strangers and last_ns - topic.heard_ns < alone_ns:
            topic.pass_over(blocks)
            return
        if topic.holding not in (None, publisher):
            silent = abs(last_ns - int(topic.held[-1].receive_ns[-1])) > alone_ns
            if not silent and topic.publisher != topic.holding:
                topic.pass_over(blocks)
                return
            # No more messages will be added to those that are held.
            self._decide(topic)
        topic.holding = publisher
        topic.held += blocks
        topic.facts.on_probation = True
        # The own driver may send bundles, of which the next one shows that it goes on.
        look_s = self._look_s() if topic.publisher in (None, publisher) else LOOK_S
        if self._lane(topic).known.suffices(topic.held, look_s):
            self._decide(topic)

    def finish(self) -> None:
        """Decide on the messages that are still held; too few are passed over."""
        for topic in self._topics:
            if topic.held:
                self._decide(topic)

    def _lane(self, topic: _Topic) -> Lane:
        """Return the lane that the messages of a topic go to."""
        return (self._others[0] if topic.facts.elsewhere else self.run).lanes[topic.number]

    def _decide(self, topic: _Topic) -> None:
        """Give the held messages to the run of their IMU."""
        held, publisher = topic.release()
        if messages(held) < FEWEST_MESSAGES:
            # Too few to identify the IMU.
            topic.pass_over(held)
            return
        is_new = publisher != topic.publisher
        if is_new and publisher is not None:
            if topic.heard_ns >= int(held[0].receive_ns[0]):
                # The one in use has gone on meanwhile.
                topic.strangers.add(publisher)
                topic.pass_over(held)
                return
            topic.strangers.discard(publisher)
        was, topic.publisher = topic.publisher, publisher
        topic.heard_ns = int(held[-1].receive_ns[-1])
        lane = self.run.lanes[topic.number]
        why = lane.known.mismatch(held)
        if why is not None:
            self._give_to_another_run(topic, why, held, is_new)
            return
        if topic.facts.elsewhere:
            topic.facts.elsewhere = False
            self._log.info(f'the messages on {topic.facts.topic} are of the IMU of the run again: '
                           'it goes on')
            lane.power_on()
        elif self._is_started_anew(topic, lane) if was is None else is_new and lane.fed:
            self._log.info(f'the driver on {topic.facts.topic} was started anew: the IMU may have '
                           'been switched off and on, so its mean is another one from here on')
            lane.power_on()
        lane.known.publishers = []
        self._feed(topic, held)

    def _is_started_anew(self, topic: _Topic, lane: Lane) -> bool:
        """Return whether the driver, by its publishers, restarted while the node was down."""
        there, before = topic.offers(), lane.known.publishers
        return bool(there and before) and there.isdisjoint(before)

    def _give_to_another_run(self, topic: _Topic, why: UnusableState, held: list[ImuBlock],
                             is_new: bool) -> None:
        """Give messages to the run of the other IMU, or to a new run if they are not from it."""
        number = topic.number
        other = next((run for run in self._others
                      if run.lanes[number].known.mismatch(held) is None), None)
        is_latest = other in self._others[:1]
        if other is None:
            other = new_run(self._setup)
            known = self.run.lanes[number].known.another(held)
            while len(held) > 1 and known.may_be_another(held[:1]):
                # These are from before the change.
                held = held[1:]
            other.lanes[number].known = known
        elif is_new or not is_latest:
            other.lanes[number].power_on()
        was_there = topic.facts.elsewhere and is_latest
        topic.facts.elsewhere, self._why = True, why
        # Each takes some megabytes.
        self._others = [other, *[run for run in self._others if run.over and run is not other][:3]]
        if not was_there:
            self._log.warning(
                f'the messages on {topic.facts.topic} are of another IMU, or it has been set '
                f'otherwise: {why}. If they go on for {duration(self._proof_s())} they begin a '
                'new run, ~/reset begins one at once', f'another IMU {number}', 0.0)
        self._feed(topic, held)

    def _feed(self, topic: _Topic, blocks: Sequence[ImuBlock]) -> None:
        lane = self._lane(topic)
        lane.update(blocks)
        if not lane.known.publishers:
            lane.known.publishers = sorted(topic.offers())
        topic.facts.looping = lane.seen.looping
        if lane.error:
            self._log.error(lane.error, f'useless samples {topic.facts.topic}')
        if topic.facts.elsewhere:
            if self._others[0].span_s >= self._proof_s():
                self._replace()
        elif self._any_elsewhere:
            # If one sensor of the IMU begins a new run, so does the other.
            self._others[0].lanes[topic.number].update(blocks)

    def _proof_s(self) -> float:
        """Return how long another IMU has to last: a tenth of the run that it replaces."""
        # A reconfigured driver settles within ten seconds; users do not wait longer than ten
        # minutes. Chosen by judgment.
        return min(max(0.1 * self.run.span_s, 10.0), 600.0)

    def _replace(self) -> None:
        """Replace the current run by that of the other IMU."""
        before, run = self.run, self._others[0]
        begins = 'the earlier run goes on' if run.over else 'a new run begins'
        self._log.warning(f'{begins}, the last one cannot go on: {self._why}', 'new run', 0.0)
        self._replaced(before, self._why)
        self._others[0] = before
        self._take_up(run)

    def _take_up(self, run: Run) -> None:
        self.run.over = True
        self.run, run.over = run, False
        for topic in self._topics:
            topic.facts.elsewhere = topic.facts.looping = False
