# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What to put into a filter's configuration.

Every consumer has its own names, its own file format and its own idea of what the numbers mean:
continuous or per sample, standard deviation or variance, a random walk or a Gauss-Markov process.
Most are templates, filled by `template`; `structured` writes the others. Each says where in the
consumer's source the meaning was read. Throughout, N is the noise density and K the rate random
walk, tuned for what corrects the consumer, f the sample rate.

A consumer that takes one value for a sensor gets that of the worst axis, the others stand beside
it in a comment.
"""

from imu_allan.writers.consumers import CONSUMERS
from imu_allan.writers.filters.chosen_numbers import Wishes
from imu_allan.writers.filters.export import (
    export,
    FilterConfig,
    left_from_before,
    left_from_earlier,
)

__all__ = ['CONSUMERS', 'FilterConfig', 'Wishes', 'export', 'left_from_before',
           'left_from_earlier']
