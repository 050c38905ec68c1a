# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Stand-ins for the part of ``launch`` and ``launch_ros`` that the launch files use.

There are no wheels of launch, so a launch file cannot be run where ROS is not installed. These
take the keyword arguments that the Jazzy versions document and no others, and build the command
line that launch_ros builds: they show what a launch file says, not that launch understands it.
"""

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


@dataclass
class LaunchContext:
    """Holds the values of arguments."""

    configurations: dict[str, str]
    folder: Path


@dataclass
class LaunchConfiguration:
    name: str

    def perform(self, context: LaunchContext) -> str:
        """Look it up: what no argument declares has no value."""
        return context.configurations[self.name]


@dataclass
class FindPackageShare:
    package: str

    def perform(self, _: LaunchContext) -> str:
        assert self.package == 'imu_allan'
        return str(ROOT)


class ThisLaunchFileDir:
    def perform(self, context: LaunchContext) -> str:
        return str(context.folder)


@dataclass
class PathJoinSubstitution:
    parts: Sequence[Any]

    def perform(self, context: LaunchContext) -> str:
        return str(Path(*(performed(part, context) for part in self.parts)))


def performed(value: Any, context: LaunchContext) -> str:
    """Give the text of a substitution, of a list of them, or of a text."""
    if isinstance(value, list):
        return ''.join(performed(part, context) for part in value)
    return value if isinstance(value, str) else str(value.perform(context))


@dataclass
class ParameterValue:
    """Gives a value the type of its parameter."""

    value: Any
    value_type: type = field(kw_only=True)


@dataclass
class DeclareLaunchArgument:
    name: str
    default_value: Any = field(default=None, kw_only=True)
    description: str = field(default='', kw_only=True)
    choices: Sequence[str] | None = field(default=None, kw_only=True)

    def visit(self, context: LaunchContext) -> list[Any]:
        """Set the default, or check what was given."""
        if self.name not in context.configurations:
            if self.default_value is None:
                raise RuntimeError(f'Required launch argument "{self.name}" was not provided.')
            context.configurations[self.name] = performed(self.default_value, context)
        value = context.configurations[self.name]
        if self.choices is not None and value not in self.choices:
            raise RuntimeError(f'Argument "{self.name}" provided value "{value}" is not valid.')
        return []


@dataclass
class OpaqueFunction:
    """Calls a function when everything before it is known."""

    function: Callable[[LaunchContext], Sequence[Any]] = field(kw_only=True)

    def visit(self, context: LaunchContext) -> list[Any]:
        return [node for entity in self.function(context) for node in entity.visit(context)]


@dataclass
class PythonLaunchDescriptionSource:
    location: Any


@dataclass
class IncludeLaunchDescription:
    """Visits another launch file, whose arguments stay set afterwards."""

    source: PythonLaunchDescriptionSource
    launch_arguments: Any = field(default=(), kw_only=True)

    def visit(self, context: LaunchContext) -> list[Any]:
        context.configurations |= {
            name: performed(value, context) for name, value in self.launch_arguments}
        return described(Path(performed(self.source.location, context))).visit(context)


@dataclass
class LaunchDescription:
    entities: Sequence[Any]

    def visit(self, context: LaunchContext) -> list[Any]:
        return [node for entity in self.entities for node in entity.visit(context)]


@dataclass(kw_only=True)
class Node:
    package: str
    executable: str
    name: Any = None
    namespace: Any = None
    parameters: Sequence[Any] = ()
    remappings: Sequence[tuple[Any, Any]] = ()
    arguments: Sequence[Any] = ()
    output: str = 'log'
    respawn: bool = False
    respawn_delay: float | None = None
    sigterm_timeout: str = '5'
    sigkill_timeout: str = '5'

    def visit(self, context: LaunchContext) -> list['Node']:
        self._context = LaunchContext(dict(context.configurations), context.folder)
        return [self]

    def command(self, folder: Path) -> list[str]:
        """Give the arguments of its command line; parameters go to files in `folder`."""
        words = [performed(word, self._context) for word in self.arguments]
        words.append('--ros-args')
        if self.name is not None:
            words += ['-r', f'__node:={performed(self.name, self._context)}']
        if self.namespace is not None:
            words += ['-r', f'__ns:=/{performed(self.namespace, self._context).lstrip("/")}']
        for number, given in enumerate(self.parameters):
            file = given
            if isinstance(given, Mapping):
                values = {name: self._evaluated(value) for name, value in given.items()}
                file = folder / f'launch_params_{number}.yaml'
                file.write_text(yaml.safe_dump({'/**': {'ros__parameters': values}}))
            words += ['--params-file', str(file)]
        for before, after in self.remappings:
            words += ['-r', ':='.join(performed(name, self._context) for name in (before, after))]
        return words

    def _evaluated(self, value: Any) -> Any:
        if isinstance(value, ParameterValue):
            return value.value_type(performed(value.value, self._context))
        if isinstance(value, (str, bool, int, float)):
            return value
        # A substitution that is not given its type is read as YAML.
        return yaml.safe_load(performed(value, self._context))


MODULES = {
    'launch': (LaunchContext, LaunchDescription),
    'launch.actions': (DeclareLaunchArgument, IncludeLaunchDescription, OpaqueFunction),
    'launch.launch_description_sources': (PythonLaunchDescriptionSource,),
    'launch.substitutions': (LaunchConfiguration, PathJoinSubstitution, ThisLaunchFileDir),
    'launch_ros': (), 'launch_ros.actions': (Node,),
    'launch_ros.parameter_descriptions': (ParameterValue,),
    'launch_ros.substitutions': (FindPackageShare,)}


def described(file: Path) -> LaunchDescription:
    """Run a launch file."""
    modules = {name: ModuleType(name) for name in MODULES}
    for name, kinds in MODULES.items():
        vars(modules[name]).update({kind.__name__: kind for kind in kinds})
    spec = importlib.util.spec_from_file_location(file.name.partition('.')[0], file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    with mock.patch.dict(sys.modules, modules):
        spec.loader.exec_module(module)
    description = module.generate_launch_description()
    assert isinstance(description, LaunchDescription)
    return description


def launched(file: Path, **given: str) -> list[Node]:
    """Give the nodes that a launch file starts with these arguments."""
    return described(file).visit(LaunchContext(given, file.parent))


def declared(file: Path) -> dict[str, DeclareLaunchArgument]:
    """Give the arguments of a launch file by name."""
    return {entity.name: entity for entity in described(file).entities
            if isinstance(entity, DeclareLaunchArgument)}
