# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Driver message types with known fields, units and clock.

Each entry was derived from the definition and the driver named beside it. The factors convert from
the units of the fields to rad/s and m/s^2.
"""

from collections.abc import Mapping

from imu_allan.recordings.messages.imu_fields import Burst, ImuFields, Stamp, Vector


def _xyz(name: str, factor: float = 1.0) -> Vector:
    return Vector((f'{name}.x', f'{name}.y', f'{name}.z'), factor)


def _elements(name: str, per: str | None = None) -> Vector:
    return Vector((f'{name}[0]', f'{name}[1]', f'{name}[2]'), per=per)


_HEADER = (Stamp('header.stamp'),)
_FRAME = 'header.frame_id'
_PX4_SAMPLE = (Stamp('timestamp_sample', 1000), Stamp('timestamp', 1000))
_PX4_FIFO = Vector(('x', 'y', 'z'), scale='scale')

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
}
"""How to read messages of known types, by type name."""
