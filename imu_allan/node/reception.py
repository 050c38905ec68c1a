# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Reception of messages: taken from the queue, counted, assigned to their publishers, and decoded.

Messages that are not sensor_msgs/Imu, or contain one, are read as from a recording:
`imu_allan.recordings.messages` knows the types of drivers, finds an Imu inside other messages, and
takes fields that the user names. The fields of a type come from its Python class, which the
subscription needs anyway.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from math import ceil
import re
import time
from typing import Any

from imu_allan.arrays import Ints
from imu_allan.block import Half, HALVES, ImuBlock
from imu_allan.cdr import batches_of, IMU_TYPE, MalformedImu
from imu_allan.errors import brief, ImuAllanError, printable
from imu_allan.node.diagnostics import Facts
from imu_allan.node.drained_subscription import Batch, DrainedSubscription
from imu_allan.node.log import Log, LogOfChanges
from imu_allan.node.parameters import TOPIC
from imu_allan.recordings.messages.decoder import Decoder
from imu_allan.recordings.messages.definitions import Field, field_of, normal_name, Types
from imu_allan.recordings.messages.imus_in import imu_messages
from imu_allan.recordings.options import RecordingOptions
from imu_allan.wording import counted
import numpy as np
from rclpy.node import Node

MIXED = -1
"""Key of messages of two publishers whose numbers are too close to be distinguished."""
_TAKEOVER_NS = 1_000_000_000
"""Two publishers alternate faster than this, in bundles; a driver takes longer to restart."""
QUEUE_MESSAGES = 10_000
"""The queue holds at least this many messages: 2 s of an IMU at 5 kHz."""


@dataclass
class _Publisher:
    """One publisher or, if the numbers fell recently, several with interleaved numbers."""

    key: int
    number: int  # of its last message
    began_ns: int  # a receive time, as are the others below
    last_ns: int
    fell_ns: int | None = None


class Publishers:
    """
    The publishers of a topic that have sent messages; `offers` returns the GIDs present.

    rclpy does not report who published a message, only its sequence number. The numbers of one
    publisher increase one by one; those of another publisher lie elsewhere.
    """

    def __init__(self, offers: Callable[[], set[str]] = set) -> None:
        self._offers = offers
        self._known: list[_Publisher] = []
        # Number of publishers so far, which gives the key of the next one.
        self._begun = 0
        # GIDs present at the last check and, without numbers, when the publisher began.
        self._gids: set[str] = set()
        self._own: set[str] = set()

    def delivering(self, now_ns: int) -> int:
        """Count the publishers that send now; a driver that has restarted counts once."""
        # A publisher that has sent nothing for five seconds counts as gone.
        lately = [one for one in self._known if abs(now_ns - one.last_ns) < 5_000_000_000]
        newest = max((one.began_ns for one in lately), default=0)
        return sum(2 if one.fell_ns is not None else 1 for one in lately if one.last_ns >= newest)

    def of(self, numbers: Ints | None, receive_ns: Ints) -> tuple[Ints, int]:
        """Return the publisher of each message, `MIXED` if unknown, and how many were lost."""
        self._follow_clock(int(receive_ns[0]))
        if numbers is None:
            only = self._unnumbered(int(receive_ns[0]))
            only.last_ns = int(receive_ns[-1])
            return np.full(len(receive_ns), only.key), 0
        # The usual case. Only the latest: an earlier one may have ended with the same number.
        one = max(self._known, key=lambda one: one.last_ns, default=None)
        if (one is not None and one.fell_ns is None and numbers[0] == one.number + 1
                and (numbers[1:] - numbers[:-1] == 1).all()):
            one.number, one.last_ns = int(numbers[-1]), int(receive_ns[-1])
            return np.full(len(numbers), one.key), 0
        keys, lost = [], 0
        for number, now_ns in zip(numbers.tolist(), receive_ns.tolist(), strict=True):
            one, missed = self._sender(number, now_ns)
            keys.append(MIXED if one.fell_ns is not None else one.key)
            lost += missed
        return np.array(keys, np.int64), lost

    def _follow_clock(self, now_ns: int) -> None:
        """If the clock of the computer was set back, move earlier times to before that."""
        ahead_ns = max((one.last_ns for one in self._known), default=now_ns) - now_ns
        if ahead_ns > _TAKEOVER_NS:
            for one in self._known:
                one.began_ns -= ahead_ns + _TAKEOVER_NS
                one.last_ns -= ahead_ns + _TAKEOVER_NS

    def _sender(self, number: int, now_ns: int) -> tuple[_Publisher, int]:
        """Find who sent a message, and how many of its earlier messages were lost."""
        # Numbers this close may belong to another publisher that started in the same second.
        near_by = 64
        for one in self._known:
            if one.fell_ns is not None and abs(number - one.number) <= near_by:
                if number <= one.number:
                    one.fell_ns = now_ns
                one.number, one.last_ns = max(number, one.number), now_ns
                if now_ns - one.fell_ns > 5_000_000_000:
                    # The numbers no longer fall: one publisher is left, which is treated as new.
                    self._known.remove(one)
                    one = self._begin(number, now_ns)
                return one, 0
        newest = max((one.began_ns for one in self._known), default=0)
        before = sorted((one for one in self._known if 0 <= one.number < number),
                        key=lambda one: number - one.number)
        near = [one for one in before if number - one.number <= near_by]
        # One that was silent since another began is considered only if no other fits.
        fitting = [one for one in near or before if one.last_ns >= newest
                   or now_ns - one.last_ns < _TAKEOVER_NS] or near or before
        # Any number of messages may be lost, unless a new publisher explains the difference.
        if not fitting or (not near and self._newcomers()):
            return self._begin(number, now_ns), 0
        found = fitting[0]
        if len(fitting) > 1 and number - fitting[1].number <= near_by:
            found.fell_ns = now_ns
            self._known.remove(fitting[1])
        missed = number - found.number - 1
        found.number, found.last_ns = number, now_ns
        return found, 0 if found.fell_ns is not None else missed

    def _unnumbered(self, now_ns: int) -> _Publisher:
        """Find who sent messages without numbers, from the publishers that are present."""
        there, known = self._offers(), [one for one in self._known if one.number < 0]
        gone = bool(there and self._own and not there & self._own)
        # The GID of a driver that was killed remains for a while.
        silent = bool(known) and now_ns - known[-1].last_ns > _TAKEOVER_NS
        if not known or gone or (silent and not there <= self._gids and self._gids):
            self._known = [one for one in self._known if one.number >= 0]
            self._own, known = there - self._gids or there, [self._begin(-1, now_ns)]
        self._own, self._gids = self._own or there, there or self._gids
        return known[-1]

    def _newcomers(self) -> bool:
        """Return whether a publisher is present that was not there at the last check."""
        gids, before = self._offers(), self._gids
        self._gids = gids or before
        return not gids <= before

    def _begin(self, number: int, now_ns: int) -> _Publisher:
        self._newcomers()
        self._begun += 1
        self._known.append(_Publisher(self._begun, number, now_ns, now_ns))
        # Every restart of a driver adds a publisher.
        if len(self._known) > 16:
            self._known.remove(min(self._known, key=lambda one: one.last_ns))
        return self._known[-1]


def message_class(type_name: str) -> Any:
    """Return the Python class of a message type."""
    found = re.fullmatch(r'(?P<package>[a-z]\w*)/(?:msg/)?(?P<name>[A-Z]\w*)', type_name)
    shown = brief(type_name, 80)
    if found is None:
        raise ImuAllanError(f'{shown}: not the name of a message type, such as {IMU_TYPE}')
    try:
        return getattr(import_module(f'{found["package"]}.msg'), found['name'])
    except AttributeError:
        raise ImuAllanError(f'{shown}: the package {found["package"]} has no such message'
                            ) from None
    except ImportError as error:
        raise ImuAllanError(f'{shown}: its Python package cannot be imported '
                            f'({printable(error)}); source the workspace that it was built in'
                            ) from error


def types_of(type_name: str) -> Types:
    """Return the fields of a message type and of the types it contains, from their classes."""
    types: dict[str, tuple[Field, ...]] = {}
    waiting = [normal_name(type_name)]
    while waiting:
        name = waiting.pop()
        if name not in types:
            types[name] = tuple(_field(field, kind) for field, kind in (
                message_class(name).get_fields_and_field_types().items()))
            waiting += [field.kind for field in types[name] if '/' in field.kind]
    return types


def _field(name: str, kind: str) -> Field:
    # An element type, bounded or not, alone, in an array or in a sequence.
    found = re.match(r'(?:sequence<)?(?P<element>[\w/]+)(?:<\d+>)?(?:\[(?P<count>\d+)\])?', kind)
    assert found is not None, kind
    # Type names of Python classes that differ from those in message definitions.
    base = {'float': 'float32', 'double': 'float64', 'boolean': 'bool'}
    element = base.get(found['element'], found['element'])
    count = int(found['count']) if found['count'] else None
    return field_of(name, normal_name(element), 0 if kind.startswith('sequence') else count)


def decoder(parameter: str, half: Half | None, values: Mapping[str, Any]) -> Decoder:
    """Return the decoder that the parameters ask for, or name the one that is wrong."""
    type_name = values[parameter]
    # Fields of the other sensor, and their stamp, are not in these messages.
    options: dict[str, Any] = {part: values[f'{part}_field'] or None
                               for part in ('gyro', 'accel', 'stamp')
                               if half is None or part == half or (
                                   part == 'stamp' and values[f'{half}_field'])}
    try:
        return imu_messages(type_name, types_of(type_name), options=RecordingOptions(
            **options, gyro_unit=values['gyro_unit'] or None,
            accel_unit=values['accel_unit'] or None)).decoder()
    except ImuAllanError as error:
        # The options of a command have parameters of nearly the same name.
        text = re.sub(r'--(gyro|accel|stamp)( unit)?', lambda option: (
            f'{option[1]}_unit' if option[2] else f'{option[1]}_field'), str(error))
        # One of a field or unit begins with the name of its own parameter.
        named = text.partition(' ')[0] in values
        raise ImuAllanError(f'parameter {text}' if named else
                            f'parameter {parameter}: {text}') from error


class Reception:
    """Takes, counts and decodes the messages on one topic of the IMU."""

    def __init__(self, node: Node, log: Log, topic: str, half: Half | None,
                 values: Mapping[str, Any]) -> None:
        parameter = 'accel_type' if half == 'accel' and values['accel_type'] else 'imu_type'
        self._decode = decoder(parameter, half, values)
        expected = 0.0 if half == 'accel' else values['expected_rate']
        # 2.5 s of samples, which late ticks do not exceed.
        queue = max(QUEUE_MESSAGES, ceil(2.5 * expected))
        self.subscription = DrainedSubscription(node, message_class(values[parameter]), topic,
                                                queue, f'{half}_topic')
        self.facts = Facts(self.subscription.topic, self.subscription.depth, expected, half)
        self.changes = LogOfChanges(log, self.facts.topic)
        self._node = node
        # Of both sensors, if each has its own.
        self._given = [one for one in (topic, values['gyro_topic'], values['accel_topic']) if one]
        self._publishers = Publishers(self.subscription.publisher_gids)
        # Number of messages at the last look.
        self._seen = 0
        self._passed_over = 0
        self._mixed_until = 0.0
        self.last_take = self.last_message = time.monotonic()
        self.taken = 0  # messages at the last take

    def take(self, now: float) -> list[tuple[int, list[ImuBlock]]]:
        """Take and decode the waiting messages, by publisher; pass over those during a pause."""
        batch, facts = self.subscription.take(), self.facts
        self.taken = len(batch.messages)
        facts.longest_hold_s = max(facts.longest_hold_s, now - self.last_take)
        facts.received += self.taken
        facts.overrun += batch.full
        self.last_take = now
        if not self.taken:
            return []
        self.last_message = now
        # Messages that are passed over do not count as lost.
        keys, lost = self._publishers.of(batch.numbers, batch.receive_ns)
        facts.lost += lost
        if facts.paused:
            facts.skipped += self.taken
            return []
        return [(key, self._decoded(batch, np.flatnonzero(keys == key)))
                for key in dict.fromkeys(keys.tolist())]

    def _decoded(self, batch: Batch, rows: Ints) -> list[ImuBlock]:
        blocks = self._decode(batches_of([batch.messages[row] for row in rows.tolist()],
                                         batch.receive_ns[rows]), self._count_malformed)
        half = self.facts.half
        if half is None:
            return blocks
        return [own for block in blocks if len(own := block.only(half))]

    def _count_malformed(self, count: int, error: MalformedImu) -> None:
        self.facts.malformed += count
        self.facts.malformed_why = str(error)

    def look(self, now: float, elapsed_s: float) -> int:
        """Update what is known of the publishers; return the messages since the last look."""
        facts, subscription = self.facts, self.subscription
        new, self._seen = facts.received - self._seen, facts.received
        facts.received_hz = new / elapsed_s
        # Killed ones stay matched for a while, so they count only if none sends.
        facts.publishers = self._publishers.delivering(time.time_ns()) or subscription.publishers
        facts.refused = [] if facts.publishers else subscription.refused_publishers()
        facts.publisher_names = subscription.publisher_names() if facts.publishers > 1 else []
        if facts.mixed_samples > self._passed_over:
            # Report the condition for five seconds after the last such message.
            self._passed_over, self._mixed_until = facts.mixed_samples, now + 5.0
        facts.mixed = now < self._mixed_until
        facts.silent_s = now - self.last_message
        # Longer than a Wi-Fi dropout, yet short enough to notice a dead sensor early. Chosen by
        # judgment.
        facts.silence_why = self._cause_of_silence() if facts.silent_s > 5.0 else ''
        facts.recent.see(now, {'lost': facts.lost, 'malformed': facts.malformed,
                               'overrun': facts.overrun})
        return new

    def _cause_of_silence(self) -> str:
        facts, kind = self.facts, self.subscription.type_name
        if facts.publishers:
            # Fast DDS matches publishers of another user, but /dev/shm delivers nothing of theirs.
            return (f', though it has {counted(facts.publishers, "publisher")}; if that runs as '
                    'another user or in a container, use the same user, or '
                    'FASTDDS_BUILTIN_TRANSPORTS=UDPv4')
        if facts.refused:
            return f'; {"; ".join(facts.refused)}'
        name_of_kind = kind.rpartition('/')[2]
        own = {self._node.resolve_topic_name(topic) for topic in self._given}
        others = [name for name, types in self._node.get_topic_names_and_types()
                  if kind in types and name not in own and kind in [
                      one.topic_type for one in self._node.get_publishers_info_by_topic(name)]]
        if others:
            remedy = f'-p {facts.half}_topic' if facts.half else f'-r {TOPIC}'
            return (f'; {name_of_kind} topics here: {", ".join(sorted(others))}; choose one with '
                    f'--ros-args {remedy}:=TOPIC')
        # The other sensor may come as such messages.
        return f'; no {"other " if facts.half else ""}node publishes {name_of_kind} messages'


def receptions(node: Node, log: Log, values: Mapping[str, Any]) -> list[Reception]:
    """Return that of the topic of the IMU, or those of its gyroscope and its accelerometer."""
    gyro, accel = values['gyro_topic'], values['accel_topic']
    if gyro and accel:
        return [Reception(node, log, values[f'{half}_topic'], half, values) for half in HALVES]
    if gyro or accel:
        named, other = ('gyro', 'accel') if gyro else ('accel', 'gyro')
        raise ImuAllanError(f'parameter {named}_topic: needs {other}_topic, too: an IMU on two '
                            'topics has both')
    if values['accel_type']:
        raise ImuAllanError('parameter accel_type: needs gyro_topic and accel_topic; '
                            'imu_type is the type of one topic')
    return [Reception(node, log, TOPIC, None, values)]
