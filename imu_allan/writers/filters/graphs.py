# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""For a filter of one's own: GTSAM's parameters, and the whole drift model as a state space."""

import json

from imu_allan.errors import ImuAllanError
from imu_allan.tuning.state_space import state_space as space_of_axis, StateSpace
from imu_allan.writers.filters.chosen_numbers import K, N, Numbers
from imu_allan.writers.filters.layout import (
    heading,
    joined,
    Pair,
    real,
    UNITS,
    worst,
)

_PARTS = ('transition', 'observation', 'process', 'measurement', 'cross', 'initial')


def gtsam(numbers: Numbers) -> str:
    """
    Write GTSAM's preintegration covariances: N^2 I and K^2 I, continuous.

    PreintegrationParams.h and PreintegrationCombinedParams.h name them so. GTSAM reads no file of
    its own; the keys are the names of the fields, each a 3 x 3 matrix.
    """
    lines = [*heading(numbers),
             '# Continuous covariances N^2 I and K^2 I. For each key, with p of type '
             'PreintegrationCombinedParams:',
             '#   p->accelerometerCovariance = matrix;   (C++)   '
             'p.setAccelerometerCovariance(matrix)   (Python)']
    names: dict[Pair, str] = {
        ('accel', N): 'accelerometerCovariance', ('gyro', N): 'gyroscopeCovariance',
        ('accel', K): 'biasAccCovariance', ('gyro', K): 'biasOmegaCovariance'}

    def matrix(value: float) -> list[str]:
        return [f'  - [{", ".join(real(value if i == j else 0.0) for j in range(3))}]'
                for i in range(3)]

    for (sensor, key), name in names.items():
        entry = worst(numbers, sensor, key, lambda value: value**2, '^2',
                      f'({UNITS[sensor, key]})^2')
        lines += ['', *(f'# {remark}' for remark in entry.remarks)]
        lines += [f'# {name}:'] if entry.value is None else [f'{name}:', *matrix(entry.value)]
    return joined(lines)


def plain(numbers: Numbers) -> str:
    """
    Write N, B and K of each axis as measured, and N and K for a filter, as YAML in SI units.

    A coefficient that does not show has its 95 % upper bound, ``below95``, in place of a value.
    """
    lines = [*heading(numbers),
             '# SI units: noise_density rad/s/sqrt(Hz) and m/s^2/sqrt(Hz), bias_instability rad/s '
             'and m/s^2, rate_random_walk',
             '# rad/s^2/sqrt(Hz) and m/s^3/sqrt(Hz). Measured with 95 % intervals; filter_... are '
             'for a filter, as said above.']
    for name, axis in numbers.result.axes.items():
        own = numbers.of_axis[name]
        if not own:
            continue
        lines += ['', f'{name}:']
        for key in ('noise_density', 'bias_instability', 'rate_random_walk'):
            found = axis.coefficients[key]
            if found.value is not None:
                ends = '' if found.ci95 is None else (
                    f', low95: {real(found.ci95[0])}, high95: {real(found.ci95[1])}')
                lines.append(f'  {key}: {{value: {real(found.value)}{ends}}}')
            elif found.upper95 is not None:
                lines.append(f'  {key}: {{below95: {real(found.upper95)}}}')
            else:
                lines.append(f'  # {key}: this result has no value for it')
        for letter, number in own.items():
            word = {N: 'filter_noise_density', K: 'filter_random_walk'}.get(letter)
            if word is not None:
                bound = '   # the upper bound' if number.bound else ''
                lines.append(f'  {word}: {real(number.value)}{bound}')
    return joined(lines)


def state_space(numbers: Numbers) -> str:
    """
    Write the drift model of every axis as a state space of the mean rate over a step, as JSON.

    ``x' = transition x + w``, ``y = observation x + v``, ``process`` = E[w w'], ``measurement`` =
    E[v v], ``cross`` = E[w v], ``initial`` = covariance of x; SI units. All digits, unlike numbers
    for a configuration: a process of an hour keeps 0.99997 of itself in a step of 0.1 s.
    """
    spaces = _spaces(numbers)
    step = next(iter(spaces.values())).step_s
    document = {'imu_allan': numbers.provenance(), 'step_s': step,
                'axes': {name: {part: getattr(space, part).tolist() for part in _PARTS}
                         for name, space in spaces.items()}}
    return json.dumps(document, indent=2) + '\n'


def state_space_cpp(numbers: Numbers) -> str:
    """Write the same as a C++ header of constants, a namespace for each axis."""
    spaces = _spaces(numbers)
    lines = ['#pragma once', *heading(numbers, '//'), '//',
             "// x' = transition x + w, y = observation x + v, y the mean rate over one step;",
             "// process = E[w w'], measurement = E[v v], cross = E[w v], initial = covariance "
             'of x.', '', '#include <array>', '', 'namespace imu_allan {', '',
             'template <int Rows, int Columns>',
             'using Matrix = std::array<std::array<double, Columns>, Rows>;']
    for name, space in spaces.items():
        lines += ['', f'namespace {name} {{',
                  f'constexpr int states = {len(space.transition)};',
                  f'constexpr double step_s = {space.step_s!r};']
        for part in _PARTS:
            rows = getattr(space, part).tolist()
            cells = ', '.join(
                '{{' + ', '.join(repr(value) for value in row) + '}}' for row in rows)
            lines.append(f'constexpr Matrix<{len(rows)}, {len(rows[0])}> {part}'
                         f'{{{{{cells}}}}};')
        lines.append(f'}}  // namespace {name}')
    return joined([*lines, '', '}  // namespace imu_allan'])


def _spaces(numbers: Numbers) -> dict[str, StateSpace]:
    if numbers.wishes.conservative or numbers.wishes.inflate:
        raise ImuAllanError(f'{numbers.consumer} is the drift model as measured: neither '
                            '--conservative nor --inflate applies; scale its matrices yourself')
    known = {name: axis for name, axis in numbers.result.axes.items()
             if axis.drift_model is not None}
    # Without a wish, the first step that every axis is known for.
    step = numbers.wishes.aiding_s or max(
        [numbers.aiding_s or 0.0, *(axis.drift_model.from_s for axis in known.values()
                                    if axis.drift_model is not None)])
    spaces = {}
    for name, axis in known.items():
        try:
            spaces[name] = space_of_axis(axis, step)
        except ImuAllanError as error:
            raise ImuAllanError(f'{name}: {error}') from error
    if not spaces:
        raise ImuAllanError(f'no configuration for {numbers.consumer}: this result has no drift '
                            'model; analyze the recording again')
    return spaces
