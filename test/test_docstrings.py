# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The examples in docstrings give what they say; docs/statistics.md has the priors of the code."""

import doctest
from importlib import import_module
import re

import imu_allan
from imu_allan.noise.posterior.shapes import FREE_SHAPES, HIGH_PASSES, LOW_PASSES, TERM_SHAPES
from imu_allan.noise.trends.kinds import TRENDS
import pytest
from sources import MODULES, PACKAGE

PAGE = (PACKAGE.parent / 'docs' / 'statistics.md').read_text()
NAMES = {'bias_instability': 'B, K', 'rate_random_walk': 'B, K', 'quantization_noise': 'Q',
         'gauss_markov': 'Gauss-Markov process', 'power_law': 'exponent',
         'exponential_average': 'exponential average', 'output_noise': 'white noise of the output',
         'high_pass': 'high-pass', 'warm_up': 'warm-up', 'bend': 'bend', 'bias_step': 'bias step',
         'slow_cycle': 'slow cycle', 'smooth_drift': 'smooth drift'}
OTHERS = '1 to 3 moving averages, two poles, Butterworth 1 to 4, Gauss'


@pytest.mark.parametrize('module', sorted(
    name for name, path in MODULES.items() if '>>>' in path.read_text()))
def test_examples_give_what_they_say(module):
    failed, _ = doctest.testmod(import_module(module), optionflags=doctest.NORMALIZE_WHITESPACE)
    assert not failed


def test_the_page_is_short_and_its_equations_are_numbered_in_turn_and_there_if_they_are_named():
    assert len(PAGE.splitlines()) <= 200
    equations = re.findall(r'\\tag\{(\d+)\}', PAGE)
    assert equations == [str(number) for number in range(1, len(equations) + 1)]
    sources = ' '.join(' '.join(path.read_text().split()) for path in PACKAGE.rglob('*.py'))
    named = {before or behind for before, behind in re.findall(
        r'\((\d\d?)\) (?:of|in) docs/statistics|docs/statistics\.md \((\d\d?)\)', sources)}
    assert len(named) > 5
    assert named <= {*equations}


@pytest.mark.parametrize('name', [
    'assess', 'characterize', 'Characterization', 'Estimator', 'predicted_drift', 'simulate',
    'state_space', 'tune'])
def test_public_numerics_name_an_equation_and_show_an_example(name):
    docstring = getattr(imu_allan, name).__doc__
    assert re.search(r'\(\d\d?\)', docstring)
    assert '>>>' in docstring


@pytest.mark.parametrize('shape', [
    *(shape for shape in TERM_SHAPES if shape.key != 'noise_density'), *FREE_SHAPES, *LOW_PASSES,
    *HIGH_PASSES, *TRENDS], ids=lambda shape: shape.key)
def test_a_prior_is_that_of_the_code(shape):
    [prior] = re.findall(rf'^\| {re.escape(NAMES.get(shape.key, OTHERS))} \| ([\d.]+)', PAGE,
                         re.MULTILINE)
    assert float(prior) == shape.prior
