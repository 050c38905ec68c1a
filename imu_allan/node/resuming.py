# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Going on with a run after a crash or a reboot: its arrays, and what it was made with."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
import json
from pathlib import Path
from typing import Any

from imu_allan.characterization import Characterization
from imu_allan.errors import ImuAllanError
from imu_allan.node.checkpoint import State, UnusableState
from imu_allan.node.imu_type import IMU
from imu_allan.node.run import Half, Lane, Run
from imu_allan.node.same_imu import Known, Seen
from imu_allan.sensor.acceleration_unit import AccelerationUnit
from imu_allan.timeline import TimelineOptions
import numpy as np
from numpy.typing import NDArray

BOOT_ID = Path('/proc/sys/kernel/random/boot_id')
_KEY = 'node'
_SEEN = 'seen/'


@dataclass(frozen=True)
class Setup:
    """What a run depends on besides its samples."""

    topic: str
    options: TimelineOptions
    messages: str = IMU
    """How the messages are read: their type, and fields and units that the user names."""
    accel_topic: str = ''
    """Of the accelerometer, where `topic` is that of the gyroscope alone."""
    finds_unit: bool = True
    """Whether the unit of the acceleration is for the samples to show."""

    @property
    def topics(self) -> str:
        """Both topics in words, or the one."""
        return ', '.join(filter(None, [self.topic, self.accel_topic]))

    @property
    def streams(self) -> list[tuple[str, Half | None]]:
        """Each topic, and the sensor that is taken from it if it is one alone."""
        if not self.accel_topic:
            return [(self.topic, None)]
        return [(self.topic, 'gyro'), (self.accel_topic, 'accel')]


def pack(run: Run, setup: Setup) -> dict[str, NDArray[Any]]:
    """Give the arrays to save of a run."""
    lanes = [{'known': lane.known.to_plain(),
              'in_g': None if lane.unit is None else lane.unit.decision} for lane in run.lanes]
    about = json.dumps({'topic': setup.topics, 'options': asdict(setup.options),
                        'messages': setup.messages, 'boot': boot_id(), 'lanes': lanes})
    return {**{f'{_prefix(number)}{key}': array for number, lane in enumerate(run.lanes)
               for key, array in {
                   **lane.characterization.to_state(),
                   **{f'{_SEEN}{name}': kept for name, kept in _remembered(lane).items()},
               }.items()},
            _KEY: np.array(about)}


def unpack(state: State, setup: Setup) -> Run:
    """
    Give the run that was saved, ready to go on: the next sample is not related to the last.

    Raises
    ------
    UnusableState
        If it was made with another setup, or its arrays do not belong together.

    """
    try:
        about = json.loads(str(state[_KEY]))
        topic, options = about['topic'], TimelineOptions(**about['options'])
        if topic != setup.topics:
            raise UnusableState('topic', f'it is of the topic {topic}')
        if about['messages'] != setup.messages:
            raise UnusableState('settings', f'its messages were read as {about["messages"]}, now '
                                f'as {setup.messages}')
        if options != setup.options:
            raise UnusableState('settings', 'it was made with other parameters '
                                f'({_difference(options, setup.options)})')
        lanes = [_lane(state, number, half, saved, setup) for number, ((_, half), saved)
                 in enumerate(zip(setup.streams, about['lanes'], strict=True))]
        boot, before = boot_id(), about['boot']
    except (ImuAllanError, ArithmeticError, ValueError, TypeError, KeyError, IndexError,
            AttributeError) as error:
        why = f'{error.args[0]} is missing' if isinstance(error, KeyError) else error
        raise UnusableState('damaged', f'its arrays do not belong together ({why})') from error
    for number, lane in enumerate(lanes):
        try:
            if boot and boot == before:
                # Whoever starts a node again on the same boot has not switched the IMU off.
                lane.characterization.break_run()
            else:
                lane.characterization.power_on()
        except ImuAllanError:
            # All that had come was of no use.
            lanes[number] = new_run(setup).lanes[number]
        except (ValueError, TypeError, IndexError, ArithmeticError) as error:
            raise UnusableState('damaged', f'its arrays do not belong together ({error})'
                                ) from error
    return Run(*lanes)


def new_run(setup: Setup) -> Run:
    """Give a run that has nothing yet."""
    return Run(*(Lane(Characterization(kind='topic', topic=topic, options=setup.options),
                      half=half, unit=AccelerationUnit() if setup.finds_unit else None)
                 for topic, half in setup.streams))


def _lane(state: State, number: int, half: Half | None, about: Mapping[str, Any], setup: Setup
          ) -> Lane:
    prefix = _prefix(number)
    own = {key[len(prefix):]: array for key, array in state.items()
           if key != _KEY and key.startswith(prefix)}
    in_g = about['in_g']
    return Lane(Characterization.from_state(own), half,
                AccelerationUnit(None if in_g is None else bool(in_g)) if setup.finds_unit
                else None, Known.from_plain(about['known']),
                Seen.from_state({key[len(_SEEN):]: array for key, array in own.items()
                                 if key.startswith(_SEEN)}))


def boot_id() -> str:
    """Return what tells one boot of this computer from another; empty where nothing does."""
    try:
        return BOOT_ID.read_text().strip()
    except OSError:
        return ''


def _remembered(lane: Lane) -> dict[str, NDArray[Any]]:
    """Give what the lane knows of messages that have come, if they are in the state."""
    waits = lane.unit is not None and lane.unit.waiting
    return {} if waits else lane.seen.to_state()


def _prefix(number: int) -> str:
    """Return what the arrays of a lane begin with: those of the first have no prefix."""
    return f'lane{number}/' if number else ''


def _difference(saved: TimelineOptions, now: TimelineOptions) -> str:
    before, after = asdict(saved), asdict(now)
    return ', '.join(f'{key} {before[key]}, now {after[key]}'
                     for key in before if before[key] != after[key])
