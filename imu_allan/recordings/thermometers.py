# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The temperature beside an IMU: which of a recording's thermometers is its own, and when."""

from collections.abc import Iterator
from typing import Literal

from imu_allan.errors import ImuAllanError, printable, shorten
from imu_allan.finding import finding
from imu_allan.recordings.imu_topic import ImuTopic
from imu_allan.recordings.recording import Recording
import numpy as np
from numpy.typing import NDArray


def thermometer_of(recording: Recording, topic: str) -> ImuTopic | None:
    """
    Find the temperature that belongs to an IMU.

    Parameters
    ----------
    recording : Recording
        Open.
    topic : str
        An Imu topic of it.

    Returns
    -------
    ImuTopic or None
        What the user names; else a field of the messages, the one topic in the same namespace, or
        with the same frame_id.

    Raises
    ------
    ImuAllanError
        If there is none of the name that the user gives.

    """
    own = [heat for heat in recording.thermometers if heat.name.startswith(f'{topic}:')]
    apart = [heat for heat in recording.thermometers if heat.name == heat.topic]
    named = recording.options.temperature
    if named is not None:
        chosen = [heat for heat in apart if heat.name.strip('/') == named.strip('/')] or [
            heat for heat in own if heat.name == f'{topic}:{named}']
        if not chosen:
            shown = ', '.join(printable(shorten(heat.name)) for heat in (*apart, *own)[:10])
            raise ImuAllanError(
                f'{printable(recording.path)}: --temperature {printable(shorten(named))}: no '
                'topic of type sensor_msgs/Temperature, field or column of this name; there are '
                + (shown or 'no temperatures in it'))
        return chosen[0]
    if own or not apart:
        return own[0] if own else None
    source = recording.imu(topic).topic
    near = [heat for heat in apart if beside(source, heat.name)]
    if len(near) == 1:
        return near[0]
    frame_id = _frame_id(recording, topic)
    same_frame = [heat for heat in near or apart
                  if frame_id and _frame_id(recording, heat.name) == frame_id]
    return same_frame[0] if len(same_frame) == 1 else None


def beside(topic: str, thermometer: str) -> bool:
    """
    Whether two topics lie in the same namespace; those in the root share none.

    Parameters
    ----------
    topic, thermometer : str
        Full names.

    Examples
    --------
    >>> beside('/imu/data_raw', '/imu/temperature'), beside('/imu', '/temperature')
    (True, False)

    """
    space = topic.rpartition('/')[0]
    return bool(space) and thermometer.rpartition('/')[0] == space


def temperatures(recording: Recording, topic: str, clock: Literal['header', 'receive'] | None,
                 ) -> Iterator[tuple[NDArray[np.int64], NDArray[np.float64]]]:
    """
    Read the temperature that belongs to an IMU.

    Parameters
    ----------
    recording : Recording
        Open.
    topic : str
        An Imu topic of it.
    clock : {'header', 'receive'} or None
        Which stamps of the IMU are used.

    Yields
    ------
    stamps : ndarray of int64, shape (n,)
        In nanoseconds on that clock.
    celsius : ndarray of float64, shape (n,)

    Raises
    ------
    ImuAllanError
        As `thermometer_of`.

    """
    heat = thermometer_of(recording, topic)
    if heat is None or clock is None:
        return
    try:
        # What is wrong with the file was reported when the IMU was read.
        with recording.again() as apart:
            for block, _ in apart.decoded(heat.name):
                usable = clock == 'header' and (block.header_ns > 0).all()
                yield (block.header_ns if usable else block.receive_ns,
                       in_celsius(block.samples[:, 0]))
    except ImuAllanError as error:
        if recording.options.temperature is not None:
            raise
        recording.remarks.append(finding('thermometer', fault='unread', reason=str(error)))


def in_celsius(readings: NDArray[np.float64]) -> NDArray[np.float64]:
    """
    Turn readings in kelvin, which some drivers publish, into degrees Celsius.

    Parameters
    ----------
    readings : ndarray, shape (n,)
        In degrees Celsius or kelvin. Each decides by itself in which, as no IMU is at 180 degrees
        of either; so it does not matter how many come at once, nor which of them are missing.

    Examples
    --------
    >>> in_celsius(np.array([300.0, np.nan, 21.5])).tolist()
    [26.850000000000023, nan, 21.5]

    """
    # More degrees Celsius than an IMU stands, and fewer kelvin than it meets.
    return np.where(readings > 180.0, readings - 273.15, readings)


def _frame_id(recording: Recording, name: str) -> str:
    """Return the frame_id of the first message."""
    with recording.again() as apart:
        return next((block.frame_id for block, _ in apart.decoded(name) if len(block)), '')
