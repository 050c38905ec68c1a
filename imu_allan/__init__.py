# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
How noisy is this IMU? Allan deviation and noise coefficients, live and from recordings.

The public names are imported when they are first used, so that importing the package costs
nothing.
"""

from __future__ import annotations

from imu_allan.version import __version__, TYPE_CHECKING

if TYPE_CHECKING:
    from typing import Any

    from imu_allan.analysis import analyze
    from imu_allan.characterization import Characterization
    from imu_allan.characterization.axis import characterize
    from imu_allan.errors import ImuAllanError
    from imu_allan.noise.record.estimator import Estimator
    from imu_allan.noise.simulate import simulate
    from imu_allan.result import AxisResult, Result
    from imu_allan.timeline import TimelineOptions
    from imu_allan.tuning.forecast import DriftForecast, predicted_drift
    from imu_allan.tuning.state_space import state_space, StateSpace
    from imu_allan.tuning.tune import assess, FilterTuning, tune
    from imu_allan.writers.plot import plot
    from imu_allan.writers.result_file import load_result

_WHERE = {
    'analyze': 'imu_allan.analysis',
    'assess': 'imu_allan.tuning.tune',
    'AxisResult': 'imu_allan.result',
    'characterize': 'imu_allan.characterization.axis',
    'Characterization': 'imu_allan.characterization',
    'DriftForecast': 'imu_allan.tuning.forecast',
    'Estimator': 'imu_allan.noise.record.estimator',
    'FilterTuning': 'imu_allan.tuning.tune',
    'ImuAllanError': 'imu_allan.errors',
    'load_result': 'imu_allan.writers.result_file',
    'plot': 'imu_allan.writers.plot',
    'predicted_drift': 'imu_allan.tuning.forecast',
    'Result': 'imu_allan.result',
    'simulate': 'imu_allan.noise.simulate',
    'state_space': 'imu_allan.tuning.state_space',
    'StateSpace': 'imu_allan.tuning.state_space',
    'TimelineOptions': 'imu_allan.timeline',
    'tune': 'imu_allan.tuning.tune',
}

__all__ = [
    'AxisResult', 'Characterization', 'DriftForecast', 'Estimator', 'FilterTuning',
    'ImuAllanError', 'Result', 'StateSpace', 'TimelineOptions', '__version__', 'analyze',
    'assess', 'characterize', 'load_result', 'plot', 'predicted_drift', 'simulate', 'state_space',
    'tune',
]


def __getattr__(name: str) -> Any:
    from importlib import import_module

    if name not in _WHERE:
        raise AttributeError(f'module {__name__!r} has no attribute {name!r}')
    value = getattr(import_module(_WHERE[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_WHERE})
