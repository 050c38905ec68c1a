# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The fields of a message that hold the samples of an IMU, their units and their times.

Fields of known types, fields found by a search and fields named by the user have the same
representation.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

TIME = ('sec', 'nanosec')


@dataclass(frozen=True)
class Vector:
    """
    A vector of three numbers in a message.

    Attributes
    ----------
    paths : tuple of str
        Paths of x, y and z; ``gyro[0]`` is an element of an array of numbers.
    factor : float
        Factor that converts the numbers to rad/s or m/s^2.
    scale : str or None
        Field with a further factor.
    per : str or None
        For increments, the field with their duration in microseconds.
    covariance : str or None
        Field that is -1 if the numbers are not provided.

    """

    paths: tuple[str, str, str]
    factor: float = 1.0
    scale: str | None = None
    per: str | None = None
    covariance: str | None = None


@dataclass(frozen=True)
class Stamp:
    """
    The time of a message.

    Attributes
    ----------
    path : str
        Path of a number, or of a message with seconds and nanoseconds.
    unit_ns : int
        Nanoseconds in one unit of the number; 0 for seconds and nanoseconds in two fields.

    """

    path: str
    unit_ns: int = 0

    @property
    def paths(self) -> tuple[str, ...]:
        """Return the paths of the fields that make up the stamp."""
        return (self.path,) if self.unit_ns else tuple(f'{self.path}.{part}' for part in TIME)


@dataclass(frozen=True)
class Burst:
    """
    Fields of a message with many samples, whose vectors consist of arrays.

    Attributes
    ----------
    samples : str
        Field with the number of valid samples.
    step_us : str
        Field with the sampling interval in microseconds; the stamp is that of the last sample.

    """

    samples: str
    step_us: str


@dataclass(frozen=True)
class ImuFields:
    """
    The fields of one message type that hold the samples of an IMU.

    Attributes
    ----------
    gyro, accel : Vector or None
        None if the message has no samples of that sensor.
    stamps : tuple of Stamp
        Candidates for the stamp: the first that is valid and mostly distinct is used. Empty if
        there is no stamp.
    frame_id : str or None
        Field that names the frame.
    burst : Burst or None
        Further fields if a message holds many samples.
    what : str
        Description for the user of the fields that are read.
    temperature : str or None
        Field with the temperature of the sensor, which is read separately, see `thermometer`.

    """

    gyro: Vector | None
    accel: Vector | None
    stamps: tuple[Stamp, ...] = ()
    frame_id: str | None = None
    burst: Burst | None = None
    what: str = ''
    temperature: str | None = None

    def thermometer(self) -> 'ImuFields | None':
        """Return fields that read the temperature alone, as the first three sample columns."""
        if self.temperature is None:
            return None
        return ImuFields(Vector((self.temperature,) * 3), None, self.stamps, self.frame_id,
                         what=f'its field {self.temperature}')

    def scaled(self, factors: tuple[float, float]) -> 'ImuFields':
        """Return these fields with further factors for the gyroscope and the accelerometer."""
        gyro, accel = (vector and replace(vector, factor=vector.factor * factor)
                       for vector, factor in zip((self.gyro, self.accel), factors, strict=True))
        return replace(self, gyro=gyro, accel=accel)

    def vectors(self) -> Iterator[tuple[int, Vector]]:
        """Yield the vectors that exist, each with its first column in the samples."""
        for first, vector in ((0, self.gyro), (3, self.accel)):
            if vector is not None:
                yield first, vector

    def needed(self) -> set[str]:
        """Return the paths of the numbers that make up the samples; in a burst some are arrays."""
        found = {path for _, vector in self.vectors() for path in (
            *vector.paths, vector.scale, vector.per, vector.covariance) if path}
        return found | ({self.burst.samples, self.burst.step_us} if self.burst else set())

    def numbers(self) -> set[str]:
        """Return the paths of all numbers that are read."""
        return self.needed() | {path for stamp in self.stamps for path in stamp.paths}

    def paths(self) -> set[str]:
        """Return the paths of all fields that are read, without array indices."""
        return {split_path(path)[0] for path in self.numbers()} | (
            set() if self.frame_id is None else {self.frame_id})


def split_path(path: str) -> tuple[str, int]:
    """Split the array index off a path: ``a.gyro[1]`` gives ``a.gyro`` and 1."""
    if path.endswith(']'):
        field, _, number = path[:-1].rpartition('[')
        return field, int(number)
    return path, 0


def _xyz(name: str, factor: float = 1.0) -> Vector:
    return Vector((f'{name}.x', f'{name}.y', f'{name}.z'), factor)


def _elements(name: str, per: str | None = None) -> Vector:
    return Vector((f'{name}[0]', f'{name}[1]', f'{name}[2]'), per=per)


_HEADER = (Stamp('header.stamp'),)
_FRAME = 'header.frame_id'
_PX4_SAMPLE = (Stamp('timestamp_sample', 1000), Stamp('timestamp', 1000))
_PX4_FIFO = Vector(('x', 'y', 'z'), scale='scale')
_APM_GYRO, _APM_ACCEL = (Vector((f'{name}X', f'{name}Y', f'{name}Z')) for name in ('Gyr', 'Acc'))
_APM_SAMPLED = (Stamp('SampleUS', 1000), Stamp('TimeUS', 1000))

IMU_FIELDS = ImuFields(
    replace(_xyz('angular_velocity'), covariance='angular_velocity_covariance[0]'),
    replace(_xyz('linear_acceleration'), covariance='linear_acceleration_covariance[0]'),
    _HEADER, _FRAME)
"""Those of sensor_msgs/Imu."""
KNOWN: Mapping[str, ImuFields] = {
    # PX4/px4_msgs: no header, microseconds since the autopilot was switched on.
    'px4_msgs/msg/SensorCombined': ImuFields(
        _elements('gyro_rad'), _elements('accelerometer_m_s2'), (Stamp('timestamp', 1000),)),
    'px4_msgs/msg/VehicleImu': ImuFields(
        _elements('delta_angle', per='delta_angle_dt'),
        _elements('delta_velocity', per='delta_velocity_dt'), _PX4_SAMPLE),
    'px4_msgs/msg/SensorGyro': ImuFields(
        Vector(('x', 'y', 'z')), None, _PX4_SAMPLE, temperature='temperature'),
    'px4_msgs/msg/SensorAccel': ImuFields(
        None, Vector(('x', 'y', 'z')), _PX4_SAMPLE, temperature='temperature'),
    'px4_msgs/msg/SensorGyroFifo': ImuFields(
        _PX4_FIFO, None, _PX4_SAMPLE, burst=Burst('samples', 'dt')),
    'px4_msgs/msg/SensorAccelFifo': ImuFields(
        None, _PX4_FIFO, _PX4_SAMPLE, burst=Burst('samples', 'dt')),
    # dawonn/vectornav: the "uncomp" fields are from before the factory calibration.
    'vectornav_msgs/msg/ImuGroup': ImuFields(
        _xyz('uncompgyro'), _xyz('uncompaccel'), _HEADER, _FRAME, temperature='temp'),
    'vectornav_msgs/msg/CommonGroup': ImuFields(
        _xyz('imu_rate'), _xyz('imu_accel'), (Stamp('timestartup', 1), *_HEADER), _FRAME),
    # SBG-Systems/sbg_ros2_driver: time_stamp is 32 bits of microseconds and wraps around every 71
    # minutes, so the header comes first.
    'sbg_driver/msg/SbgImuData': ImuFields(
        _xyz('gyro'), _xyz('accel'), (*_HEADER, Stamp('time_stamp', 1000)), _FRAME,
        temperature='temp'),
    # sbgECom, SBG_ECOM_LOG_IMU_SHORT: 1048576 LSB for 1 m/s^2, 67108864 LSB for 1 rad/s.
    'sbg_driver/msg/SbgImuShort': ImuFields(
        _xyz('delta_angle', 1 / 67108864), _xyz('delta_velocity', 1 / 1048576),
        (*_HEADER, Stamp('time_stamp', 1000)), _FRAME),
    # unitreerobotics/unitree_ros2: no stamp; the receive time is used.
    **dict.fromkeys(('unitree_go/msg/LowState', 'unitree_hg/msg/LowState'), ImuFields(
        _elements('imu_state.gyroscope'), _elements('imu_state.accelerometer'))),
    # LeoRover/leo_msgs
    'leo_msgs/msg/Imu': ImuFields(
        Vector(('gyro_x', 'gyro_y', 'gyro_z')), Vector(('accel_x', 'accel_y', 'accel_z')),
        (Stamp('stamp'),), temperature='temperature'),
    # ArduPilot, libraries/AP_InertialSensor/LogStructure.h: microseconds since start.
    'ArduPilot IMU': ImuFields(
        _APM_GYRO, _APM_ACCEL, (Stamp('TimeUS', 1000),), temperature='T'),
    'ArduPilot GYR': ImuFields(_APM_GYRO, None, _APM_SAMPLED),
    'ArduPilot ACC': ImuFields(None, _APM_ACCEL, _APM_SAMPLED),
}
"""How to read messages of other known types, by type name."""
