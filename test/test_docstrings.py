# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The examples in docstrings give what they say."""

import doctest
from importlib import import_module
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parents[1] / 'imu_allan'
MODULES = sorted('.'.join(('imu_allan', *path.relative_to(PACKAGE).with_suffix('').parts))
                 for path in PACKAGE.rglob('*.py')
                 if path.stem != '__init__' and '>>>' in path.read_text())


@pytest.mark.parametrize('module', MODULES)
def test_examples_give_what_they_say(module):
    failed, _ = doctest.testmod(import_module(module),
                                optionflags=doctest.NORMALIZE_WHITESPACE)
    assert not failed
