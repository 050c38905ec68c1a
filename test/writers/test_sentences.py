# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Sentences for users are made by the writers, and read by nobody."""

import ast
from collections.abc import Iterator
from pathlib import Path

import imu_allan
import pytest

PACKAGE = Path(imu_allan.__file__).parent
MODULES = sorted(path for path in PACKAGE.rglob('*.py')
                 if path.name not in ('words.py', 'sentences.py'))
BELOW = [path for path in MODULES if path.relative_to(PACKAGE).parts[0] in (
    'characterization', 'fleet', 'noise', 'sensor', 'timeline', 'tuning', 'finding.py',
    'result.py', 'state.py', 'block.py', 'cdr.py')]
"""Those that know nothing of the writers."""
# Errors say them.
SAID_BY_ERRORS = {'give a noise model or datasheet YAML file',
                  'between a microsecond and a hundred years'}
MAKERS = {'says', 'advice', 'brief', 'message_of', 'title_of', 'explained', 'in_full',
          'verdict_lines', 'findings_line', 'good_to_know', 'closing_lines'}
READERS = {'startswith', 'endswith', 'find', 'index', 'split', 'partition', 'rpartition', 'count',
           'removeprefix', 'removesuffix'}


def made(node: ast.AST) -> Iterator[str]:
    """Yield what reads like a sentence: neither a docstring nor in a function that raises."""
    if isinstance(node, ast.JoinedStr):
        yield ''.join(str(part.value) if isinstance(part, ast.Constant) else '0'
                      for part in node.values)
        return
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    for child in ast.iter_child_nodes(node):
        if not (isinstance(child, ast.Expr) and isinstance(child.value, ast.Constant)) and not (
                isinstance(child, ast.FunctionDef) and any(
                    isinstance(one, ast.Raise) for one in ast.walk(child))):
            yield from made(child)


def sentences_made(tree: ast.AST) -> list[str]:
    return [text for text in made(tree) if text not in SAID_BY_ERRORS and len(
        [word for word in text.split() if word.strip('.,;:()').isalpha() and len(word) > 1]) > 3]


def sentences_read(tree: ast.AST) -> list[str]:
    """Return where a decision is made by what the words have said."""
    def is_said(node: ast.AST) -> bool:
        name = getattr(node, 'func', node)
        return (isinstance(node, ast.Call) and getattr(name, 'id', None) in MAKERS) or (
            isinstance(node, ast.Name) and node.id in said)
    said = {target.id for node in ast.walk(tree) if isinstance(node, ast.Assign)
            and isinstance(node.value, ast.Call)
            and getattr(node.value.func, 'id', None) in MAKERS
            for target in node.targets if isinstance(target, ast.Name)}
    return [ast.unparse(node) for node in ast.walk(tree) if (
        isinstance(node, ast.Compare) and any(map(is_said, [node.left, *node.comparators]))) or (
        isinstance(node, ast.Attribute) and node.attr in READERS and is_said(node.value))]


def test_no_module_below_the_writers_makes_a_sentence() -> None:
    assert len(BELOW) > 80
    assert not {path.name: found for path in BELOW
                if (found := sentences_made(ast.parse(path.read_text())))}


def test_no_module_reads_a_sentence() -> None:
    assert not {path.name: found for path in MODULES
                if (found := sentences_read(ast.parse(path.read_text())))}


@pytest.mark.parametrize(('source', 'makes', 'reads'), [
    ("WHY = 'the noise changed during the recording'", True, False),
    ("def f(x):\n    return f'the noise {x} is not steady'", True, False),
    ("def f(x):\n    'Say how it is.'\n    return 'in whole seconds'", False, False),
    ("def f(x):\n    raise E(f'the noise {x} is not steady')", False, False),
    ("if says(found).startswith('the noise'):\n    pass", False, True),
    ("text = message_of(found)\nif 'steady' in text:\n    pass", False, True),
    ("if found.code == 'not_steady':\n    text = says(found)", False, False)])
def test_a_sentence_that_is_made_or_read_elsewhere_is_found(
        source: str, makes: bool, reads: bool) -> None:
    tree = ast.parse(source)
    assert (bool(sentences_made(tree)), bool(sentences_read(tree))) == (makes, reads)
