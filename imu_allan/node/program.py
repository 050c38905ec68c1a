# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The process of either node: start, stop on signals, and exit status."""

from collections.abc import Iterator, Sequence
import contextlib
from importlib import import_module
from itertools import pairwise
import os
from pathlib import Path
import signal
import sys
from typing import Any

from imu_allan.errors import ImuAllanError
from imu_allan.process import open_closed_streams, start_quickly


class StopRequest:
    """Whether a signal has asked to stop; the work under way is finished first."""

    requested = False

    def receive(self, *_: object) -> None:
        """Handle a signal: without a lock, on which a second signal would wait for ever."""
        self.requested = True


def run_program(program: str, node_class: str, args: Sequence[str] | None = None) -> int:
    """Run a node between the start and the shutdown of rclpy; return the exit status."""
    start_quickly()
    open_closed_streams()
    given = list(sys.argv[1:] if args is None else args)
    if given and given[0] in ('-h', '--help'):
        print(f'usage: {program} --ros-args [-p NAME:=VALUE] [--params-file FILE] [-r FROM:=TO]',
              'topics and services of a running node: ros2 node info NODE',
              'its parameters: ros2 param list NODE, ros2 param describe NODE NAME',
              'all of them are described in docs/ros_interface.md', sep='\n')
        return 0
    if wrong := _refused(given):
        return _fail(program, wrong, 2)
    stop = StopRequest()
    try:
        _do_without_shared_memory(program)
        with _stopped_by(stop), _node(given, node_class) as node:
            return int(node.serve(stop))
    except ImuAllanError as error:
        return _fail(program, str(error))
    except ImportError as error:
        if (error.name or '').partition('.')[0] not in (
                'rclpy', 'rcl_interfaces', 'builtin_interfaces', 'diagnostic_msgs',
                'geometry_msgs', 'sensor_msgs', 'std_msgs', 'std_srvs', 'rpyutils'):
            raise
        return _fail(program, f'needs ROS 2, which {sys.executable} cannot import ({error}); '
                     'source a ROS 2 installation (source /opt/ros/jazzy/setup.bash) or install '
                     "the wheels: pip install 'imu_allan[ros]'")


def _refused(args: Sequence[str]) -> str:
    """Return what is wrong with arguments that are not for ROS and would have no effect."""
    of_ros = False
    for argument in args:
        if of_ros or argument == '--ros-args':
            # "--" ends the ROS arguments.
            of_ros = argument != '--'
            continue
        name, sign, value = argument.lstrip('-').partition('=')
        example = f'{name.rstrip(":")}:={value}' if name and sign else 'NAME:=VALUE'
        return f'{argument!r} is no argument; give parameters as --ros-args -p {example}'
    return ''


def _do_without_shared_memory(program: str) -> None:
    """Keep the middleware away from a full /dev/shm, which would end the process with SIGBUS."""
    # Fast DDS can use the network alone. LTTng, which the ROS libraries link to for tracing, needs
    # a page of /dev/shm as soon as it is loaded; no setting changes that.
    try:
        shared = os.statvfs('/dev/shm')
    except OSError:
        return
    room = shared.f_bavail * shared.f_frsize
    remedy = 'remove files from it, or give it room, such as with --shm-size of docker run'
    if room < 65_536:
        raise ImuAllanError(f'/dev/shm is full, so the libraries of ROS would crash; {remedy}')
    transports = 'FASTDDS_BUILTIN_TRANSPORTS'
    if room < 8_000_000 and os.environ.get(transports, 'DEFAULT') == 'DEFAULT':
        os.environ[transports] = 'UDPv4'
        print(f'{program}: /dev/shm has only {room / 1e6:.2g} MB of room: messages come over the '
              f'network, at more cost; {remedy}', file=sys.stderr)


@contextlib.contextmanager
def _stopped_by(stop: StopRequest) -> Iterator[None]:
    # rclpy's own handlers raise KeyboardInterrupt anywhere, even half-way through an update, and
    # shut the context down before a last result can be published.
    # SIGHUP comes when the terminal closes, for example because an SSH session drops; under nohup
    # it stays ignored. A script has what it starts with & ignore SIGINT, but nodes of ROS end.
    stopping = signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT
    before = {number: signal.signal(number, stop.receive) for number in stopping
              if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN}
    try:
        yield
    finally:
        for number, handler in before.items():
            # A second signal must not end a process that has saved before it returns its status.
            signal.signal(number, signal.SIG_IGN if stop.requested else handler)


@contextlib.contextmanager
def _node(args: list[str], node_class: str) -> Iterator[Any]:
    # Imported only now: ROS may be missing.
    from imu_allan.node.rclpy_inside import RCLError, UnknownROSArgsError
    import rclpy
    from rclpy.exceptions import ParameterException
    from rclpy.signals import SignalHandlerOptions
    from rclpy.utilities import try_shutdown

    # rcl reports a missing file in two lines that name its own sources.
    for word, path in pairwise(args):
        if word == '--params-file' and not Path(path).is_file():
            raise ImuAllanError(f'--params-file {path}: no such file')
    try:
        rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    except (RCLError, UnknownROSArgsError) as error:
        raise ImuAllanError(f'{str(error).strip()}; check the arguments after --ros-args and the '
                            'parameter file') from error
    try:
        module, _, name = node_class.rpartition('.')
        try:
            node = getattr(import_module(module), name)()
        except (RCLError, ParameterException) as error:
            # For instance the keys of a secured robot do not allow it, or a parameter that every
            # node has, such as use_sim_time, is of another type: rclpy names both.
            raise ImuAllanError(str(error)) from error
        try:
            yield node
        finally:
            node.destroy_node()
    finally:
        try_shutdown()


def _fail(program: str, message: str, status: int = 1) -> int:
    print(f'{program}: {" ".join(message.split())}', file=sys.stderr)
    return status
