# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Going on with a run after a crash or a reboot: its arrays, and what it was made with."""

from dataclasses import asdict, dataclass
import json
from typing import Any

from imu_allan.characterization import Characterization
from imu_allan.errors import ImuAllanError
from imu_allan.node.checkpoint import State, UnusableState
from imu_allan.node.imu_type import IMU
from imu_allan.node.power_ons import PowerOns
from imu_allan.node.run import Run
from imu_allan.timeline import TimelineOptions
import numpy as np
from numpy.typing import NDArray

_KEY = 'node'


@dataclass(frozen=True)
class Setup:
    """What a run depends on besides its samples."""

    topic: str
    options: TimelineOptions
    messages: str = IMU
    """How the messages are read: their type, and fields that the user names."""


def pack(run: Run, setup: Setup) -> dict[str, NDArray[Any]]:
    """Give the arrays to save of a run."""
    about = json.dumps({'topic': setup.topic, 'options': asdict(setup.options),
                        'messages': setup.messages,
                        'power_ons': run.power_ons.to_dict()})
    return {**run.characterization.to_state(), _KEY: np.array(about)}


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
        if topic != setup.topic:
            raise UnusableState('topic', f'it is of the topic {topic}')
        if about['messages'] != setup.messages:
            raise UnusableState('settings', f'its messages were read as {about["messages"]}, now '
                                f'as {setup.messages}')
        if options != setup.options:
            raise UnusableState('settings', 'it was made with other parameters '
                                f'({_difference(options, setup.options)})')
        power_ons = PowerOns.from_dict(about['power_ons'])
        saved = Characterization.from_state({key: array for key, array in state.items()
                                             if key != _KEY})
    except (ImuAllanError, ArithmeticError, ValueError, TypeError, KeyError, IndexError,
            AttributeError) as error:
        raise UnusableState('damaged', f'its arrays do not belong together ({error})') from error
    try:
        saved.break_run()
    except ImuAllanError:
        # All that had come was of no use.
        return new_run(setup)
    try:
        return Run(saved, power_ons=power_ons.resumed(saved))
    except (ImuAllanError, ValueError, TypeError, IndexError, ArithmeticError) as error:
        raise UnusableState('damaged', f'its arrays do not belong together ({error})') from error


def new_run(setup: Setup) -> Run:
    """Give a run that has nothing yet."""
    return Run(Characterization(kind='topic', topic=setup.topic, options=setup.options))


def _difference(saved: TimelineOptions, now: TimelineOptions) -> str:
    before, after = asdict(saved), asdict(now)
    return ', '.join(f'{key} {before[key]}, now {after[key]}'
                     for key in before if before[key] != after[key])
