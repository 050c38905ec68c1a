# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Stand-ins for `launch`, which has no wheels: they show what a launch file says, no more."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, make_dataclass
import importlib.util
from pathlib import Path
import sys
from types import ModuleType
from typing import Any
from unittest import mock

import yaml

ROOT = Path(__file__).parents[2]
LaunchContext = dict[str, str]


def taking(kind: str, *positional: str, **keywords: Any) -> Any:
    """Give a class of the arguments, with defaults, that the Jazzy version documents alone."""
    return make_dataclass(kind, [*positional, *(
        (name, Any, field(default=default, kw_only=True)) for name, default in keywords.items())])


DeclareLaunchArgument = taking('DeclareLaunchArgument', 'name', default_value=None,
                               description='', choices=None)
FindPackageShare = taking('FindPackageShare', 'package')
IncludeLaunchDescription = taking('IncludeLaunchDescription', 'source', launch_arguments=())
LaunchDescription = taking('LaunchDescription', 'entities')
OpaqueFunction = taking('OpaqueFunction', function=None)
ParameterValue = taking('ParameterValue', 'value', value_type=None)
PythonLaunchDescriptionSource = taking('PythonLaunchDescriptionSource', 'location')
ThisLaunchFileDir = taking('ThisLaunchFileDir')


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
