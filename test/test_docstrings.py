# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The examples in docstrings give what they say."""

import doctest
from importlib import import_module
from pathlib import Path
import re

import imu_allan
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


EQUATIONS = [int(number) for number in re.findall(
    r'\\tag\{(\d+)\}', (PACKAGE.parent / 'docs' / 'statistics.md').read_text())]
NO_NUMERICS = {'AxisResult', 'DriftForecast', 'FilterTuning', 'ImuAllanError', 'Result',
               'StateSpace', 'TimelineOptions', '__version__', 'analyze', 'load_result', 'plot'}
"""Public names that hold numbers, read files or state options."""
NUMERICS = [
    *((name, getattr(imu_allan, name)) for name in sorted({*imu_allan.__all__} - NO_NUMERICS)),
    *((name, getattr(import_module(f'imu_allan.{module}'), name)) for module, name in (
        ('noise.curve', 'edf'), ('noise.curve', 'octaves'), ('noise.drift_model', 'drift_avar'),
        ('noise.drift_model', 'fit_drift_model'), ('noise.axis_fit', 'fit_axes'),
        ('noise.fitted_model', 'FittedModel'), ('noise.joint', 'joint_fit'),
        ('noise.posterior.maximum', 'maximise'), ('noise.sequential', 'decide'),
        ('noise.spectrum', 'flicker'), ('noise.spectrum', 'quantization'),
        ('noise.spectrum', 'random_walk'), ('noise.spectrum', 'white'),
        ('noise.terms', 'allan_variance'), ('tuning.kalman', 'unaided_variance')))]


def test_the_equations_of_the_statistics_are_numbered_in_turn():
    assert list(range(1, len(EQUATIONS) + 1)) == EQUATIONS
    assert len(EQUATIONS) >= 10


@pytest.mark.parametrize(('name', 'public'), NUMERICS)
def test_public_numerics_name_an_equation_that_there_is_and_show_an_example(name, public):
    numbers = {int(number) for number in re.findall(r'(?<!\w)\((\d\d?)\)', public.__doc__)}
    assert numbers, f'{name} names no equation'
    assert numbers <= set(EQUATIONS), name
    assert '>>>' in public.__doc__, f'{name} has no example'
