# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Choice and reading of the temperature that belongs to an IMU."""

from collections.abc import Iterator
from typing import Literal

from imu_allan.arrays import Array, Ints
from imu_allan.block import ImuBlock
from imu_allan.errors import brief, error_about, ImuAllanError
from imu_allan.finding import finding
from imu_allan.recordings.recording import ImuTopic, Recording
import numpy as np


def thermometer_of(recording: Recording, topic: str) -> ImuTopic | None:
    """Return the temperature that the user names, or the only one near an IMU; None without."""
    own = [thermometer for thermometer in recording.thermometers
           if thermometer.name.startswith(f'{topic}:')]
    separate = [thermometer for thermometer in recording.thermometers
                if thermometer.name == thermometer.topic]
    named = recording.options.temperature
    if named is not None:
        chosen = [thermometer for thermometer in separate
                  if thermometer.name.strip('/') == named.strip('/')] or [
            thermometer for thermometer in own if thermometer.name == f'{topic}:{named}']
        if not chosen:
            shown = ', '.join(brief(thermometer.name) for thermometer in (*separate, *own)[:10])
            raise error_about(
                recording.path, f'--temperature {brief(named)}: no topic of type sensor_msgs/'
                'Temperature, field or column of this name'
                + (f'; there are {shown}' if shown else ''))
        return chosen[0]
    if own:
        return own[0]
    source = recording.imu(topic).topic
    near = [thermometer for thermometer in separate if share_namespace(source, thermometer.name)]
    if len(near) != 1 and separate and (frame_id := _frame_id(recording, topic)):
        near = [thermometer for thermometer in near or separate
                if _frame_id(recording, thermometer.name) == frame_id]
    return near[0] if len(near) == 1 else None


def share_namespace(topic: str, thermometer: str) -> bool:
    """Return whether two topics share a namespace; the root namespace does not count."""
    space = topic.rpartition('/')[0]
    return bool(space) and thermometer.rpartition('/')[0] == space


def temperatures(recording: Recording, topic: str, clock: Literal['header', 'receive'] | None,
                 ) -> Iterator[tuple[Ints, Array]]:
    """Yield stamps in ns on the clock of an IMU, and degrees Celsius, of its thermometer."""
    thermometer = thermometer_of(recording, topic)
    if thermometer is None or clock is None:
        return
    try:
        # Problems of the file were reported when the IMU was read, so remarks are discarded here.
        for block, _ in recording.for_another_topic().decoded(thermometer.name):
            yield readings_of(block, clock)
    except ImuAllanError as error:
        if recording.options.temperature is not None:
            raise
        recording.remarks.append(finding('thermometer', fault='unread', reason=str(error)))


def readings_of(block: ImuBlock, clock: Literal['header', 'receive']) -> tuple[Ints, Array]:
    """Return stamps in ns on the clock of an IMU, and degrees Celsius, of decoded readings."""
    # One without a stamp of its own is placed by when it came.
    own = (block.header_ns > 0) & (clock == 'header')
    return np.where(own, block.header_ns, block.receive_ns), in_celsius(block.samples[:, 0])


def in_celsius(readings: Array) -> Array:
    """
    Convert readings in kelvin, which some drivers publish, to degrees Celsius.

    Parameters
    ----------
    readings : ndarray, shape (n,)
        Readings in degrees Celsius or kelvin. The unit of each is inferred separately, so the
        result does not depend on how many come at once or which are missing.

    Examples
    --------
    >>> in_celsius(np.array([300.0, np.nan, 21.5])).tolist()
    [26.850000000000023, nan, 21.5]

    """
    # No IMU survives 180 degrees Celsius or is used at 180 K.
    return np.where(readings > 180.0, readings - 273.15, readings)


def _frame_id(recording: Recording, name: str) -> str:
    """Return the frame_id of the first message, or an empty string."""
    blocks = recording.for_another_topic().decoded(name)
    return next((block.frame_id for block, _ in blocks if len(block)), '')
