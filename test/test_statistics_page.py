# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""docs/statistics.md is short, and its priors are those of the code."""

from pathlib import Path
import re

from imu_allan.noise.posterior.shapes import FREE_TERMS, HIGH_PASSES, LOW_PASSES, TERMS
from imu_allan.noise.posterior.trends import TRENDS
import pytest

PAGE = (Path(__file__).parents[1] / 'docs' / 'statistics.md').read_text()
NAMES = {'bias_instability': 'B, K', 'rate_random_walk': 'B, K', 'quantization_noise': 'Q',
         'gauss_markov': 'Gauss-Markov process', 'power_law': 'exponent',
         'recursive_mean': 'recursive mean', 'output_noise': 'white noise of the output',
         'high_pass': 'high-pass', 'warm_up': 'warm-up', 'bend': 'bend', 'bias_step': 'bias step',
         'slow_cycle': 'slow cycle', 'smooth_drift': 'smooth drift'}
OTHERS = 'moving mean, Butterworth 1 to 4, Gauss'


def test_the_page_is_short():
    assert len(PAGE.splitlines()) <= 200


@pytest.mark.parametrize('shape', [
    *(shape for shape in TERMS if shape.key != 'noise_density'), *FREE_TERMS, *LOW_PASSES,
    *HIGH_PASSES, *TRENDS], ids=lambda shape: shape.key)
def test_a_prior_is_that_of_the_code(shape):
    [prior] = re.findall(rf'^\| {re.escape(NAMES.get(shape.key, OTHERS))} \| ([\d.]+)', PAGE,
                         re.MULTILINE)
    assert float(prior) == shape.density
