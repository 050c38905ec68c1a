# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages are compared as whole lines: a part of one holds neither its sense nor its words."""

import ast
from pathlib import Path

from imu_allan.errors import ImuAllanError
import pytest
from whole_lines import refused, Varying


@pytest.mark.parametrize('said', ['a.csv: empty; record again', 'b/a.csv: empty', 'empty', ''])
def test_a_line_that_holds_more_or_less_is_another(said: str) -> None:
    with pytest.raises(AssertionError), refused('a.csv: empty'):
        raise ImuAllanError(said)
    with refused('a.csv: empty'):
        raise ImuAllanError('a.csv: empty')


def test_numbers_and_words_vary_only_where_the_line_says_so() -> None:
    line = Varying('<number> of 1,024 messages are lost (<words>)')
    assert line == '3 of 1,024 messages are lost (disk full)'
    assert line == '-1,200.5e-06 of 1,024 messages are lost (x)'
    assert line != '3 of 1,025 messages are lost (disk full)'
    assert line != 'about 3 of 1,024 messages are lost (disk full)'
    assert line != '3 of 1,024 messages are lost ()'
    assert line != '3 of 1,024 messages are lost (disk\nfull)'


def is_part(node: ast.AST) -> bool:
    """Tell whether a part of what an error says is looked for: as a pattern, or in its text."""
    if isinstance(node, ast.keyword):
        # Its source has the letter and the mark of a text around it.
        return node.arg == 'match' and not (
            ast.unparse(node.value).lstrip('rf')[1:].startswith('^')
            and ast.unparse(node.value)[:-1].endswith('$'))
    texts: list[ast.expr] = []
    if isinstance(node, ast.Compare) and isinstance(node.ops[0], ast.In):
        texts = node.comparators
    elif isinstance(node, ast.Attribute) and node.attr in ('startswith', 'endswith'):
        texts = [node.value]
    return any(ast.unparse(text) in ('str(error)', 'str(error.value)') for text in texts)


def test_no_test_looks_for_a_part_of_what_an_error_says() -> None:
    assert [(path.name, ast.unparse(node)) for path in Path(__file__).parent.rglob('test_*.py')
            for node in ast.walk(ast.parse(path.read_text())) if is_part(node)] == []
