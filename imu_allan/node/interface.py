# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What both nodes offer, as ``--help`` tells it: without ROS, which may be what is missing."""

from collections.abc import Sequence
from dataclasses import dataclass
from textwrap import wrap

from imu_allan.node.settings import Setting, SETTINGS, SIMULATOR_SETTINGS

_WIDTH = 80
"""A terminal that nobody has made wider."""


@dataclass(frozen=True)
class Interface:
    """
    What a node is for, and the names through which it is used.

    Attributes
    ----------
    program : str
    purpose : str
    subscribed, published, services : sequence of (str, str, str)
        Name, type and meaning.
    settings : sequence of Setting

    """

    program: str
    purpose: str
    subscribed: Sequence[tuple[str, str, str]]
    published: Sequence[tuple[str, str, str]]
    services: Sequence[tuple[str, str, str]]
    settings: Sequence[Setting]


CHARACTERIZATION = Interface(
    'imu_allan_node',
    'Characterizes the noise of the IMU on a topic while it is at rest.',
    (('imu/data_raw', 'sensor_msgs/Imu', 'the IMU; another topic with -r imu/data_raw:=TOPIC; '
      'the two topics of gyro_topic and accel_topic instead, where they are set'),),
    (('~/result', 'std_msgs/String', 'the whole result as JSON'),
     ('~/coefficients', 'diagnostic_msgs/DiagnosticArray', 'every coefficient of every axis'),
     ('~/gyro/TERM, ~/accel/TERM', 'geometry_msgs/Vector3Stamped',
      'TERM is noise_density, bias_instability, rate_random_walk, or filter_random_walk'),
     ('~/SENSOR/TERM/interval/low, .../high', 'geometry_msgs/Vector3Stamped',
      '95 % interval of a measured term'),
     ('~/gyro/allan_deviation, ~/accel/allan_deviation', 'std_msgs/Float64MultiArray',
      'rows tau, x, y, z'),
     ('~/plot/compressed', 'sensor_msgs/CompressedImage', 'the plot, while somebody subscribes'),
     ('/diagnostics', 'diagnostic_msgs/DiagnosticArray', 'once a second')),
    (('~/save', 'std_srvs/Trigger', 'write result, curves, plot and filter configurations'),
     ('~/reset', 'std_srvs/Trigger', 'begin a new run'),
     ('~/pause', 'std_srvs/SetBool', 'pass samples over')),
    SETTINGS)

SIMULATOR = Interface(
    'imu_simulator',
    'Stands in for an IMU driver: publishes an IMU at rest with the noise of a model.',
    (),
    (('imu/data_raw', 'sensor_msgs/Imu', 'the samples'),
     ('~/truth', 'diagnostic_msgs/DiagnosticArray', 'the true coefficients')),
    (('~/drop', 'std_srvs/Trigger', 'leave samples out'),
     ('~/knock', 'std_srvs/Trigger', 'knock the IMU')),
    SIMULATOR_SETTINGS)


def wants_help(args: Sequence[str]) -> bool:
    """Whether a command line, without the name of the program, asks for help."""
    own = args[:args.index('--ros-args')] if '--ros-args' in args else args
    return bool({'-h', '--help'} & set(own))


def refused(args: Sequence[str]) -> str:
    """
    Say what is wrong with the arguments that are not of ROS, which would change nothing.

    Examples
    --------
    >>> refused(['publish_period=5.0'])
    "'publish_period=5.0' is no argument; give parameters as --ros-args -p publish_period:=5.0"
    >>> refused(['--ros-args', '-p', 'publish_period:=5.0'])
    ''

    """
    of_ros = False
    for argument in args:
        if of_ros or argument == '--ros-args':
            # "--" ends what is of ROS.
            of_ros = argument != '--'
            continue
        name, sign, value = argument.lstrip('-').partition('=')
        example = f'{name.rstrip(":")}:={value}' if name and sign else 'NAME:=VALUE'
        return f'{argument!r} is no argument; give parameters as --ros-args -p {example}'
    return ''


def help_text(interface: Interface) -> str:
    """Describe a node for the terminal."""
    lines = [f'usage: {interface.program} --ros-args [-p NAME:=VALUE] [--params-file FILE] '
             '[-r FROM:=TO]', '', *_folded(interface.purpose, 0)]
    for title, rows in (('subscribes to', interface.subscribed),
                        ('publishes', interface.published),
                        ('services', interface.services)):
        if rows:
            lines += ['', f'{title}:']
            for name, kind, meaning in rows:
                lines += [f'  {name} ({kind})', *_folded(meaning, 6)]
    lines += ['', 'parameters:']
    for setting in interface.settings:
        lines += [f'  {setting.name} ({_default(setting)})', *_folded(_meaning(setting), 6)]
    return '\n'.join(lines)


def _default(setting: Setting) -> str:
    if setting.default == '':
        return 'empty'
    if isinstance(setting.default, str) or not isinstance(setting.default, Sequence):
        return str(setting.default)
    return f'[{", ".join(setting.default)}]'


def _meaning(setting: Setting) -> str:
    text = setting.description
    if setting.lowest is not None and setting.highest is not None:
        text += f' ({setting.lowest:g} to {setting.highest:g})'
    if setting.choices:
        text += f' ({", ".join(setting.choices)})'
    return text


def _folded(text: str, indent: int) -> list[str]:
    return [' ' * indent + line for line in wrap(text, _WIDTH - indent)]
