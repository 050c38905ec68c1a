# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The YAML that rosbag2 writes into metadata.yaml, and no more of YAML than that.

A few lines of YAML can stand for gigabytes: keys merged from what was merged, aliases, integers to
the base of 60. A recorder writes none of it. What is left are plain texts, whole numbers, lists
and mappings, in a number that is bounded.
"""

import re
from typing import Any, ClassVar

import yaml

LARGEST = 1 << 20
"""Bytes: 500 topics of two publishers each, with their quality of service, take 700,000."""
_MOST_NODES = 30_000
"""Texts, lists and mappings in all: 3,000 files of a split bag take 27,000, in a second or two."""
_MAP, _SEQ, _STR, _INT, _BOOL, _NULL = (
    f'tag:yaml.org,2002:{name}' for name in ('map', 'seq', 'str', 'int', 'bool', 'null'))
_WHOLE = re.compile(r'-?(?:0|[1-9][0-9]{0,19})\Z')
"""Twenty digits hold any number of 64 bits."""
_PLAIN = [
    (_INT, _WHOLE, '-0123456789'),
    (_BOOL, re.compile(r'(?:true|false)\Z'), 'tf'),
    (_NULL, re.compile(r'~?\Z'), ['~', '']),
]


_NODES = {_MAP: yaml.MappingNode, _SEQ: yaml.SequenceNode}


class _Loader(yaml.reader.Reader, yaml.scanner.Scanner, yaml.parser.Parser,
              yaml.composer.Composer, yaml.constructor.BaseConstructor,
              yaml.resolver.BaseResolver):
    """Reads what rosbag2 writes. Not built on libyaml: deep nesting overflows its stack."""

    yaml_implicit_resolvers = {  # noqa: RUF012
        first: [(tag, expression)] for tag, expression, firsts in _PLAIN for first in firsts}
    yaml_constructors: ClassVar[dict[str | None, Any]] = {
        _MAP: lambda loader, node: loader.mapping(node),
        _SEQ: lambda loader, node: loader.sequence(node),
        _INT: lambda loader, node: loader.integer(node),
        _STR: lambda loader, node: loader.construct_scalar(node),
        _BOOL: lambda _, node: node.value == 'true',
        _NULL: lambda *_: None,
        # Anything else that is written before a value.
        None: lambda loader, node: loader.refuse(node)}

    def __init__(self, text: bytes) -> None:
        yaml.reader.Reader.__init__(self, text)
        yaml.scanner.Scanner.__init__(self)
        yaml.parser.Parser.__init__(self)
        yaml.composer.Composer.__init__(self)
        yaml.constructor.BaseConstructor.__init__(self)
        yaml.resolver.BaseResolver.__init__(self)
        self._nodes = 0

    def compose_node(self, parent: Any, index: Any) -> Any:
        """Count the nodes, and refuse those that stand for others."""
        self._nodes += 1
        if self._nodes > _MOST_NODES:
            raise ValueError(f'it has more than {_MOST_NODES} entries')
        if self.check_event(yaml.AliasEvent):
            raise ValueError('it has an alias, which rosbag2 never writes')
        return super().compose_node(parent, index)

    def construct_object(self, node: Any, deep: bool = False) -> Any:
        """Construct what a node is, unless a tag says that it is something else."""
        if not isinstance(node, _NODES.get(node.tag, yaml.ScalarNode)):
            self.refuse(node)
        return super().construct_object(node, deep)

    def mapping(self, node: yaml.MappingNode) -> dict[Any, Any]:
        """Construct a mapping whose keys are texts and stand there once."""
        found: dict[Any, Any] = {}
        for key_node, value_node in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, (str, int)):
                raise ValueError('it has a key that is no text')
            if key in found:
                raise ValueError(f'it has the key {str(key)[:60]} twice')
            found[key] = self.construct_object(value_node, deep=True)
        return found

    def sequence(self, node: yaml.SequenceNode) -> list[Any]:
        """Construct a list."""
        return [self.construct_object(item, deep=True) for item in node.value]

    def refuse(self, node: yaml.Node) -> None:
        """Construct nothing of a type that no recorder writes."""
        raise ValueError(f'it has the tag {str(node.tag)[:60]}')

    def integer(self, node: yaml.ScalarNode) -> int:
        """Construct a whole number, whatever its tag was written for."""
        if not _WHOLE.match(node.value):
            raise ValueError(f'{node.value[:60]!r} is not a whole number')
        return int(node.value)


def read_metadata_yaml(text: bytes) -> Any:
    """
    Read the content of a metadata.yaml.

    Returns
    -------
    dict, list, str, int, bool or None
        What stands in it; numbers with a point are texts.

    Raises
    ------
    yaml.YAMLError, ValueError, RecursionError
        If it is no YAML, or more than rosbag2 writes.

    """
    if len(text) > LARGEST:
        raise ValueError(f'it is larger than {LARGEST} bytes')
    loader = _Loader(text)
    try:
        return loader.get_single_data()
    finally:
        loader.dispose()
