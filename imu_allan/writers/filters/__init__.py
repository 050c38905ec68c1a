# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Configurations of filters.

Every consumer has its own names, file format and conventions: continuous or per sample, standard
deviation or variance, random walk or Gauss-Markov process. Most have a template, filled by
`template`; `structured` writes the others. Each states where in the consumer's source its meaning
was read. Throughout, N is the noise density, K the rate random walk and f the sample rate. N and K
are tuned for the measurements that correct the consumer.

A consumer with one value per sensor gets that of the worst axis; comments give the others.
"""

from imu_allan.result import Result
from imu_allan.writers.filters.chosen_numbers import ExportOptions, Numbers
from imu_allan.writers.filters.structured import WRITERS
from imu_allan.writers.filters.template import filled
from imu_allan.writers.supported_filters import CONSUMERS

__all__ = ['CONSUMERS', 'ExportOptions', 'export']


def export(result: Result, consumer: str, options: ExportOptions = ExportOptions()  # noqa: B008
           ) -> str:
    """Return the text of the configuration of a filter; `CONSUMERS` names its file."""
    return WRITERS.get(consumer, filled)(Numbers(result, consumer, options))
