# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Options for how to read a recording, the same for every verb that reads one.

Some are about messages and files, others about the timeline. They share a module because every
verb that characterizes takes both.
"""

import argparse
from typing import TYPE_CHECKING

from imu_allan.cli.arguments import duration, moment, rate
from imu_allan.errors import ImuAllanError

if TYPE_CHECKING:
    from imu_allan.analysis import Choice
    from imu_allan.recordings import RecordingOptions


def add_recording_options(parser: argparse.ArgumentParser) -> None:
    """Add the options about messages and files to a verb."""
    parser.add_argument('--rate', metavar='RATE', type=rate,
                        help='sample rate (100Hz, 2kHz) in place of the measured one; needed '
                             'for a CSV without a time column')
    group = parser.add_argument_group('messages of other types, other units, two topics')
    group.add_argument('--definitions', metavar='PATH', nargs='+', default=[],
                       help='.msg files, or packages and workspaces with them, for a recording '
                            'without definitions of its messages')
    group.add_argument('--gyro', metavar='FIELD[:UNIT]',
                       help='field of the angular velocity and its unit: imu.gyro[0:3]:deg/s; or '
                            'the unit alone: :deg/s')
    group.add_argument('--accel', metavar='FIELD[:UNIT]',
                       help='field of the acceleration and its unit: imu.acc:g; or the unit '
                            'alone: :g')
    group.add_argument('--stamp', metavar='FIELD',
                       help="field of the time: 'imu.stamp', or a number as 'time_us us'")
    group.add_argument('--gyro-topic', metavar='NAME',
                       help='topic of the gyroscope of an IMU on two topics')
    group.add_argument('--accel-topic', metavar='NAME', help='topic of its accelerometer')
    group.add_argument('--accel-rate', metavar='RATE', type=rate,
                       help='sample rate of an accelerometer on a topic of its own; --rate is '
                            'that of the gyroscope then')
    group.add_argument('--temperature', metavar='NAME',
                       help='topic (sensor_msgs/Temperature), field or column of the '
                            'temperature; one of its namespace or frame_id is found')
    group.add_argument('--columns', metavar='AXIS=NAME', action='append', default=[],
                       help='column of a CSV, by name or number from 1, and its unit: '
                            "gyro_x=w0,accel_x=7,'time=t us'; other units by --gyro :deg/s and "
                            '--accel :g')


def add_timeline_options(parser: argparse.ArgumentParser) -> None:
    """Add the options about the clock, and about the part of a recording to use."""
    parser.add_argument('--clock', choices=('header', 'receive', 'none'), default='auto',
                        help='stamps to trust (default: header, unless unusable); none counts '
                             'samples and needs --rate')
    parser.add_argument('--start', metavar='TIME', type=moment, default=0.0,
                        help='leave out the beginning (10 or 10s, 5min, 2h)')
    parser.add_argument('--duration', metavar='TIME', type=duration,
                        help='use only as much (30min, 3h)')
    parser.add_argument('--motion', choices=('exclude', 'keep'), default='exclude',
                        help='what to do with knocks and motion (default: %(default)s)')


def choice_of(args: argparse.Namespace) -> 'Choice':
    """Return how to read a recording, from the arguments; wrong usage ends the program."""
    from imu_allan.analysis import Choice
    from imu_allan.timeline import TimelineOptions

    counted = args.clock == 'none'
    if counted and args.rate is None:
        args.parser.error('--clock none needs --rate')
    return Choice(args.topic, TimelineOptions(
        clock='auto' if counted else args.clock, rate_hz=args.rate, force_rate=counted,
        motion=args.motion), recording_options(args), args.start, args.duration)


def recording_options(args: argparse.Namespace) -> 'RecordingOptions':
    """Return the reading options that the arguments give."""
    from imu_allan.recordings import RecordingOptions

    pairs = []
    for text in ','.join(args.columns).split(',') if args.columns else []:
        axis, equals, name = text.partition('=')
        if not equals:
            raise ImuAllanError(f'--columns {text}: not AXIS=NAME such as gyro_x=w0')
        pairs.append((axis.strip(), name.strip()))
    gyro, gyro_unit = _field(args.gyro)
    accel, accel_unit = _field(args.accel)
    return RecordingOptions(
        rate_hz=args.rate, definitions=tuple(args.definitions), gyro=gyro, accel=accel,
        stamp=args.stamp, gyro_unit=gyro_unit, accel_unit=accel_unit,
        gyro_topic=args.gyro_topic, accel_topic=args.accel_topic, columns=tuple(pairs),
        accel_rate_hz=args.accel_rate, temperature=args.temperature)


def _field(text: str | None) -> tuple[str | None, str | None]:
    """Return a field and its unit in the notation of the library, or a unit alone."""
    field, colon, unit = (text or '').rpartition(':')
    if not colon or ']' in unit:
        # It is the colon of imu.gyro[0:3].
        return text, None
    return (f'{field.strip()} {unit.strip()}', None) if field.strip() else (None, unit.strip())
