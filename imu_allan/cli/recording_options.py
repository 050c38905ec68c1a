# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The options that say how a recording is to be read; the same for every verb that reads one.

Some belong to messages and files, others to the timeline: in one module because every verb that
characterizes takes both.
"""

import argparse
from typing import Any, TYPE_CHECKING

from imu_allan.cli.arguments import duration, positive_number, start
from imu_allan.errors import ImuAllanError

if TYPE_CHECKING:
    from imu_allan.recordings import RecordingOptions


def add_recording_options(parser: argparse.ArgumentParser) -> None:
    """Add the options to a verb."""
    parser.add_argument('--rate', metavar='HZ', type=positive_number,
                        help='sample rate, instead of the one measured from the stamps; needed '
                             'for a CSV without a time column')
    group = parser.add_argument_group('messages of other types, other units, two topics')
    group.add_argument('--definitions', metavar='PATH', nargs='+', default=[],
                       help='.msg files, or packages and workspaces that hold them, for a '
                            'recording that does not carry the definitions of its messages')
    group.add_argument('--gyro', metavar='FIELD',
                       help="field of the angular velocity and its unit: 'imu.gyro[0:3] deg/s'")
    group.add_argument('--accel', metavar='FIELD',
                       help="field of the acceleration and its unit: 'imu.acc g'")
    group.add_argument('--stamp', metavar='FIELD',
                       help="field of the time: 'imu.stamp', or a number as 'time_us us'")
    group.add_argument('--gyro-unit', metavar='UNIT', help='unit of the gyroscope (deg/s)')
    group.add_argument('--accel-unit', metavar='UNIT', help='unit of the accelerometer (g)')
    group.add_argument('--gyro-topic', metavar='NAME',
                       help='topic of the gyroscope of an IMU on two topics')
    group.add_argument('--accel-topic', metavar='NAME', help='topic of its accelerometer')
    group.add_argument('--accel-rate', metavar='HZ', type=positive_number,
                       help='sample rate of an accelerometer on a topic of its own, instead of '
                            'the one measured; --rate is that of the gyroscope then')
    group.add_argument('--temperature', metavar='NAME',
                       help='topic (sensor_msgs/Temperature), field of the messages, or column '
                            'with the temperature of the IMU; one of its namespace or frame_id '
                            'is found')
    group.add_argument('--columns', metavar='AXIS=NAME', action='append', default=[],
                       help='column of a CSV, by name or number from 1, and its unit: gyro_x=w0,'
                            "gyro_y=w1,accel_x=7,'time=t us'; other units as in --gyro-unit and "
                            '--accel-unit')


def add_timeline_options(parser: argparse.ArgumentParser) -> None:
    """Add those that say which part of the recording counts, and by which clock."""
    parser.add_argument('--force-rate', action='store_true',
                        help='use --rate even if the stamps advance at another rate')
    parser.add_argument('--clock', choices=('header', 'receive'),
                        help='stamps to trust (default: header, unless they are unusable)')
    parser.add_argument('--start', metavar='TIME', type=start, default=0.0,
                        help='leave out the beginning, as long as this (10 or 10s, 5min, 2h), or '
                             'auto: the warm-up')
    parser.add_argument('--duration', metavar='TIME', type=duration,
                        help='use only as much (30min, 3h)')
    parser.add_argument('--motion', choices=('exclude', 'keep'), default='exclude',
                        help='what to do with knocks and motion (default: %(default)s)')


def timeline_options(args: argparse.Namespace) -> dict[str, Any]:
    """Return what the arguments say of `TimelineOptions`; wrong usage ends the program."""
    if args.force_rate and args.rate is None:
        args.parser.error('--force-rate needs --rate')
    return {'clock': args.clock or 'auto', 'rate_hz': args.rate, 'force_rate': args.force_rate,
            'motion': args.motion}


def recording_options(args: argparse.Namespace) -> 'RecordingOptions':
    """
    Return what the arguments say.

    Raises
    ------
    ImuAllanError
        If a unit or a column is not one.

    """
    from imu_allan.recordings import RecordingOptions

    pairs = []
    for text in ','.join(args.columns).split(',') if args.columns else []:
        axis, equals, name = text.partition('=')
        if not equals:
            raise ImuAllanError(f'--columns {text}: not AXIS=NAME such as gyro_x=w0')
        pairs.append((axis.strip(), name.strip()))
    return RecordingOptions(
        rate_hz=args.rate, definitions=tuple(args.definitions), gyro=args.gyro, accel=args.accel,
        stamp=args.stamp, gyro_unit=args.gyro_unit, accel_unit=args.accel_unit,
        gyro_topic=args.gyro_topic, accel_topic=args.accel_topic, columns=tuple(pairs),
        accel_rate_hz=args.accel_rate, temperature=args.temperature)
