# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Allan deviation and noise coefficients of IMUs, live and from recordings.

Public names are imported on first use, so that importing the package is fast.
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
    from imu_allan.writers.result_files import load_result

_WHERE = {name: f'imu_allan.{module}' for module, names in {
    'analysis': 'analyze', 'characterization': 'Characterization',
    'characterization.axis': 'characterize', 'errors': 'ImuAllanError',
    'noise.record.estimator': 'Estimator', 'noise.simulate': 'simulate',
    'result': 'AxisResult Result', 'timeline': 'TimelineOptions',
    'tuning.forecast': 'DriftForecast predicted_drift',
    'tuning.state_space': 'state_space StateSpace', 'tuning.tune': 'assess FilterTuning tune',
    'writers.plot': 'plot', 'writers.result_files': 'load_result',
}.items() for name in names.split()}

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
