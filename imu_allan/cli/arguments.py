# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Types of command line arguments, and the options for reading a recording that several verbs share.

Values out of range are reported as wrong usage at once.
"""

import argparse
from collections.abc import Mapping
import math
import re
from typing import Any, TYPE_CHECKING

from imu_allan.errors import ImuAllanError, LONGEST_S, SHORTEST_S
from imu_allan.writers.supported_filters import consumer_called

if TYPE_CHECKING:
    from imu_allan.analysis import Choice
    from imu_allan.recordings import RecordingOptions

_META = ('serial', 'operator', 'station')


class Shown(argparse.Action):
    """Prints what the function `const` returns, and exits as --help does."""

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        """Print the text and exit."""
        print(self.const(), end='')
        parser.exit()


def rate(text: str) -> float:
    """Read a rate above zero, in Hz or with a unit (``100``, ``100Hz``, ``2kHz``); return Hz."""
    value = _with_unit(text.casefold(), {'': 1.0, 'hz': 1.0, 'khz': 1e3},
                       f'{text!r} is no rate: write Hz (100), or a number with Hz or kHz (2kHz)')
    # From thirty times the rate of the fastest IMUs down to times of many days in nanoseconds.
    if value > 0 and not 1e-3 <= value <= 1e6:
        raise argparse.ArgumentTypeError(f'{text}: no IMU has such a rate; give the rate in Hz')
    return _above_zero(value, text)


def duration(text: str) -> float:
    """Read a time above zero, in seconds or with a unit (``90``, ``50ms``, ``10min``, ``3h``)."""
    value = _above_zero(moment(text), text)
    if value < SHORTEST_S:
        raise argparse.ArgumentTypeError(f'{text} is less than a microsecond')
    return value


def moment(text: str) -> float:
    """Read a time of zero or above, in seconds or with a unit; return seconds."""
    value = _with_unit(text, {'': 1.0, 'ms': 1e-3, 's': 1.0, 'm': 60.0, 'min': 60.0, 'h': 3600.0,
                              'd': 86_400.0},
                       f'{text!r} is not a length of time: write seconds (90), or a number with '
                       'ms, s, m or min, h or d (10min)')
    if value < 0:
        raise argparse.ArgumentTypeError(f'{text} is below zero')
    if value > LONGEST_S:
        raise argparse.ArgumentTypeError(f'{text} is more than a hundred years')
    return value


def count(text: str) -> int:
    """Read a whole number, one or above."""
    value = whole_number(text)
    if value < 1:
        raise argparse.ArgumentTypeError(f'{text} is below one')
    return value


def whole_number(text: str) -> int:
    """Read a whole number, zero or above."""
    try:
        value = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not a whole number') from None
    if value < 0:
        raise argparse.ArgumentTypeError(f'{text} is below zero')
    return value


def add_inspection(parser: argparse.ArgumentParser) -> None:
    """Add the option that says which unit is measured, by whom and where."""
    parser.add_argument('--meta', metavar='KEY=VALUE', type=_meta, action='append', default=[],
                        help='which unit is measured, by whom and where: serial=A-0017, '
                             'operator=NAME, station=NAME; may be repeated')
    parser.add_argument('--serial', type=lambda text: ('serial', text), dest='meta',
                        action='append', help=argparse.SUPPRESS)


def _meta(text: str) -> tuple[str, str]:
    key, equals, value = (part.strip() for part in text.partition('='))
    if key not in _META or not equals:
        raise argparse.ArgumentTypeError(f'{text!r} is not of the form KEY=VALUE with a KEY of '
                                         f'{", ".join(_META)}')
    return key, value


def consumer(text: str) -> str:
    """Read the name of a consumer that `imu_allan.writers.supported_filters` knows."""
    try:
        return consumer_called(text)
    except KeyError as error:
        raise argparse.ArgumentTypeError(error.args[0]) from None


def _with_unit(text: str, units: Mapping[str, float], complaint: str) -> float:
    """Read a number with one of the units; the unit may be omitted if `units` has ''."""
    match = re.fullmatch(rf'(.*?)\s*({"|".join(units)})', text.strip(), re.DOTALL)
    assert match is not None
    try:
        return _number(match[1]) * units[match[2]]
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(complaint) from None


def _above_zero(value: float, text: str) -> float:
    if value <= 0:
        raise argparse.ArgumentTypeError(f'{text} is not above zero')
    return value


def _number(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f'{text!r} is not a number') from None
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError(f'{text} is not a finite number')
    return value


def factors(text: str) -> dict[str, float]:
    """Read factors for N and K, such as ``N=2,K=5``."""
    found: dict[str, float] = {}
    for part in text.split(','):
        name, equals, value = (text.strip() for text in part.partition('='))
        if name not in ('N', 'K') or not equals or name in found:
            raise argparse.ArgumentTypeError(
                f'{text!r} is not of the form N=2,K=5: a factor for N, for K, or for both')
        found[name] = _above_zero(_number(value), value)
    return found


def add_recording_options(parser: argparse.ArgumentParser) -> None:
    """Add the options about messages and files to a verb."""
    parser.add_argument('--rate', metavar='RATE', type=rate,
                        help='sample rate (100Hz, 2kHz) in place of the measured one; needed '
                             'for a CSV without a time column')
    parser.add_argument('--no-progress', action='store_true', help='show no progress bar')
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


def refuse_reading_options(args: argparse.Namespace, needed: str) -> None:
    """End the program if an option about reading a recording is given, though none is read."""
    reading = argparse.ArgumentParser()
    reading.set_defaults(topic=None, live=False)
    add_recording_options(reading)
    add_timeline_options(reading)
    for name, default in vars(reading.parse_args([])).items():
        # Without a recording there is no progress to show.
        if name != 'no_progress' and getattr(args, name, default) != default:
            args.parser.error(f'--{name.replace("_", "-")} needs {needed}')


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
