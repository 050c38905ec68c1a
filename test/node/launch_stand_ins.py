# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Stand-ins for what launch files use of ``launch`` and ``launch_ros``, which have no wheels."""

from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
import importlib.util
from pathlib import Path
import sys
from types import ModuleType
from typing import Any
from unittest import mock

import yaml

ROOT = Path(__file__).parents[2]
LaunchContext = dict[str, str]
# They take the keyword arguments that the Jazzy versions document and no others: they show what a
# launch file says, not that launch understands it.
FindPackageShare = namedtuple('FindPackageShare', 'package')
LaunchDescription = namedtuple('LaunchDescription', 'entities')
PythonLaunchDescriptionSource = namedtuple('PythonLaunchDescriptionSource', 'location')
ThisLaunchFileDir = namedtuple('ThisLaunchFileDir', '')


@dataclass
class LaunchConfiguration:
    name: str

    def perform(self, context: LaunchContext) -> str:
        return context[self.name]


@dataclass
class PathJoinSubstitution:
    parts: Sequence[Any]

    def perform(self, _: LaunchContext) -> str:
        first, *others = self.parts
        assert first == FindPackageShare('imu_allan')
        return str(ROOT.joinpath(*others))


@dataclass
class ParameterValue:
    value: LaunchConfiguration
    value_type: type = field(kw_only=True)


@dataclass
class DeclareLaunchArgument:
    name: str
    default_value: Any = field(default=None, kw_only=True)
    description: str = field(default='', kw_only=True)
    choices: Sequence[str] | None = field(default=None, kw_only=True)


@dataclass
class OpaqueFunction:
    function: Callable[[LaunchContext], list[Any]] = field(kw_only=True)


@dataclass
class IncludeLaunchDescription:
    source: PythonLaunchDescriptionSource
    launch_arguments: Any = field(default=(), kw_only=True)


@dataclass(kw_only=True)
class Node:
    package: str
    executable: str
    name: str | None = None
    namespace: str = ''
    parameters: Sequence[Any] = ()
    remappings: Sequence[tuple[str, str]] = ()
    arguments: Sequence[str] = ()
    output: str = 'log'
    respawn: bool = False
    respawn_delay: float | None = None
    sigterm_timeout: str = '5'
    sigkill_timeout: str = '5'

    def command(self, folder: Path) -> list[str]:
        """Give the arguments of its command line; parameters go to files in `folder`."""
        words = [*self.arguments, '--ros-args', '-r', f'__ns:=/{self.namespace.lstrip("/")}']
        words += [] if self.name is None else ['-r', f'__node:={self.name}']
        for number, given in enumerate(self.parameters):
            file = given
            if isinstance(given, Mapping):
                file = folder / f'launch_params_{number}.yaml'
                file.write_text(yaml.safe_dump({'/**': {'ros__parameters': dict(given)}}))
            words += ['--params-file', str(file)]
        for names in self.remappings:
            words += ['-r', ':='.join(names)]
        return words


MODULES = {
    'launch': {'LaunchContext': LaunchContext, 'LaunchDescription': LaunchDescription},
    'launch.actions': {kind.__name__: kind for kind in (
        DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction)},
    'launch.launch_description_sources': {
        'PythonLaunchDescriptionSource': PythonLaunchDescriptionSource},
    'launch.substitutions': {kind.__name__: kind for kind in (
        LaunchConfiguration, PathJoinSubstitution, ThisLaunchFileDir)},
    'launch_ros': {}, 'launch_ros.actions': {'Node': Node},
    'launch_ros.parameter_descriptions': {'ParameterValue': ParameterValue},
    'launch_ros.substitutions': {'FindPackageShare': FindPackageShare}}


def described(name: str) -> list[Any]:
    modules = {module: ModuleType(module) for module in MODULES}
    for module, kinds in MODULES.items():
        vars(modules[module]).update(kinds)
    spec = importlib.util.spec_from_file_location(name, ROOT / 'launch' / f'{name}.launch.py')
    assert spec is not None
    assert spec.loader is not None
    file = importlib.util.module_from_spec(spec)
    with mock.patch.dict(sys.modules, modules):
        spec.loader.exec_module(file)
    return list(file.generate_launch_description().entities)


def declared(name: str) -> dict[str, DeclareLaunchArgument]:
    return {one.name: one for one in described(name) if isinstance(one, DeclareLaunchArgument)}


def launched(file: str, /, **given: str) -> list[Any]:
    """Give what a launch file starts with these arguments."""
    context = {key: one.default_value if isinstance(one.default_value, (str, type(None)))
               else one.default_value.perform(given) for key, one in declared(file).items()}
    context |= given
    return [started for one in described(file) for started in (
        one.function(context) if isinstance(one, OpaqueFunction) else [one])
        if not isinstance(started, DeclareLaunchArgument)]
