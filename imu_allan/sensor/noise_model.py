# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Noise models and datasheets as YAML files whose values carry units.

One format serves the simulator (the noise of the sensor) and the datasheet check (its upper
limits)::

    name: My IMU
    gyro: {noise_density: 0.03 deg/s/sqrt(Hz), bias_instability: 18 deg/h}
    accel:
      noise_density: 100 ug/sqrt(Hz)
      z: {noise_density: 150 ug/sqrt(Hz)}

Entries under a sensor hold for its three axes. Entries under ``x``, ``y`` or ``z`` hold for that
axis and take precedence. A coefficient is given by its key or by its name in tables
(``angle_random_walk``). A datasheet may also limit what is not noise (`LIMITS`), which a
simulation ignores.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
import os
from pathlib import Path
from typing import Any

from imu_allan.errors import ImuAllanError, printable, shorten
from imu_allan.noise.terms import AXES, Quantity, TERMS
from imu_allan.result import GaussMarkov
from imu_allan.sensor.units import parse

LIMITS = {'zero_bias': '', 'temperature_drift': '/K', 'turn_on_bias': ''}
"""
Limits in a datasheet besides the noise terms, with what their SI unit adds to that of a sample.
They are the distance of the mean from `mean`, its change with temperature, and its spread between
power-ons.
"""
_WANTED = 'give a noise model or datasheet YAML file'


@dataclass(frozen=True)
class NoiseModel:
    """
    Noise coefficients per axis: a model to simulate or the limits of a datasheet.

    Attributes
    ----------
    name : str or None
        Name of the sensor in the file.
    axes : dict of axis name to dict of term key to float
        Coefficients in SI units; axes and terms that the file does not name are missing.
    gauss_markov : dict of axis name to GaussMarkov
    mean : dict of axis name to float
        Constant part of the signal, in rad/s or m/s^2.
    as_written : dict of axis name to dict of key to str
        Text of each coefficient and limit in the file.
    limits : dict of axis name to dict of key to float
        Further limits of a datasheet, by key of `LIMITS`, in SI units.

    """

    name: str | None
    axes: dict[str, dict[str, float]] = field(default_factory=dict)
    gauss_markov: dict[str, GaussMarkov] = field(default_factory=dict)
    mean: dict[str, float] = field(default_factory=dict)
    as_written: dict[str, dict[str, str]] = field(default_factory=dict)
    limits: dict[str, dict[str, float]] = field(default_factory=dict)


def find_model(name: str) -> Path:
    """Find the file of a noise model, by its path or by the name of one that is shipped."""
    try:
        path = Path(name).expanduser()
    except RuntimeError as error:
        raise ImuAllanError(f'{printable(name)}: this user has no home folder; write the path '
                            'without ~') from error
    if path.is_file():
        return path
    if path.name == name:
        # The checkout, or the folder into which pip and colcon install files.
        for parent in Path(__file__).resolve().parents[1:]:
            for folder in ('config', 'share/imu_allan/config'):
                shipped = parent / folder / f'{path.stem}.yaml'
                if shipped.is_file() and (shipped.parents[1] / 'package.xml').is_file():
                    return shipped
    if path.exists():
        # A pipe; a folder is refused where it is read.
        return path
    raise ImuAllanError(f'{printable(name)}: no such file, and no model of that name is shipped; '
                        'give the path of a noise model YAML file')


def load_model(path: str | os.PathLike[str]) -> NoiseModel:
    """Read a model or datasheet file; errors name the file and the key, with an example."""
    # A model has 1 KB, and a YAML parser takes seconds for 1000 KB.
    longest = 1_000_000
    try:
        with Path(path).open('rb') as file:
            data = file.read(longest + 1)
    except OSError as error:
        raise ImuAllanError(f'{path}: cannot be read ({error.strerror or error}); {_WANTED}'
                            ) from error
    if len(data) > longest:
        raise ImuAllanError(f'{path}: too large; {_WANTED}')
    try:
        text = data.decode()
    except UnicodeDecodeError as error:
        raise ImuAllanError(f'{path}: not a text file; {_WANTED}') from error
    return parse_model(text, str(path))


def parse_model(text: str, name: str = 'model') -> NoiseModel:
    """Read the text of a model or datasheet, which has `name` in errors."""
    document = _yaml(text, name)
    sensors = ('gyro', 'accel')
    if not isinstance(document, dict) or not any(sensor in document for sensor in sensors):
        raise ImuAllanError(f"{name}: names neither 'gyro' nor 'accel'; write for instance "
                            'gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}')
    model = NoiseModel(document.get('name'))
    for key, value in document.items():
        if key == 'name':
            if not isinstance(value, str):
                raise ImuAllanError(f'{name}: name: expected a text, such as My IMU')
        elif key in sensors:
            _read_sensor(model, key, value, f'{name}: {key}')
        else:
            raise _unknown(name, key, ('name', *sensors))
    return model


def _unknown(where: str, key: str, known: Sequence[str]) -> ImuAllanError:
    near = get_close_matches(key, known, n=1)
    return ImuAllanError(f'{where}: unknown key {shorten(repr(key), 60)}'
                         f'{f", did you mean {near[0]}?" if near else ";"} '
                         f'known are {", ".join(known)}')


def _yaml(text: str, name: str) -> Any:
    import yaml

    class Loader(yaml.BaseLoader):
        """Keeps every scalar as text, so that a value without unit stays as it was typed."""

        def construct_mapping(self, node: Any, deep: bool = False) -> dict[Any, Any]:
            """Refuse a key that is given twice, of which YAML would use only the last."""
            seen: set[str] = set()
            for key, _ in node.value:
                if str(key.value) in seen:
                    raise yaml.MarkedYAMLError(
                        problem=f'{shorten(repr(key.value), 60)} is given twice; keep one',
                        problem_mark=key.start_mark)
                seen.add(str(key.value))
            found: dict[Any, Any] = super().construct_mapping(node, deep)
            return found

    try:
        return yaml.load(text, Loader=Loader)
    except yaml.YAMLError as error:
        mark = getattr(error, 'problem_mark', None)
        line = f'line {mark.line + 1} is ' if mark is not None else ''
        problem = getattr(error, 'problem', None) or 'unreadable'
        raise ImuAllanError(f'{name}: {line}not YAML ({" ".join(problem.split())})') from error
    except (RecursionError, ValueError) as error:
        raise ImuAllanError(f'{name}: cannot be read as YAML; {_WANTED}') from error


def _read_sensor(model: NoiseModel, sensor: str, value: Any, where: str) -> None:
    """Read the entries of a sensor for all axes, then those for single axes."""
    entries = _mapping(value, where)
    for letter in 'xyz':
        own = _mapping(entries[letter], f'{where}.{letter}') if letter in entries else {}
        shared = {key: item for key, item in entries.items()
                  if key not in ('x', 'y', 'z') and key not in own}
        if shared or letter in entries:
            name = f'{sensor}_{letter}'
            for of_axes in (model.axes, model.as_written, model.limits):
                of_axes[name] = {}
            _read_axis(model, name, shared, where)
            _read_axis(model, name, own, f'{where}.{letter}')


def _read_axis(model: NoiseModel, axis: str, entries: Mapping[str, Any], where: str) -> None:
    quantity = AXES[axis]
    for written, value in entries.items():
        here = f'{where}.{written}'
        key = _key(written, quantity)
        for other in entries:
            if other != written and _key(other, quantity) == key:
                raise ImuAllanError(f'{where}: {written} and {other} are the same; keep one')
        if key in TERMS:
            model.axes[axis][key] = _value(value, TERMS[key].unit(quantity), here,
                                           signed=key == 'rate_ramp')
            model.as_written[axis][key] = value.strip()
        elif key in LIMITS:
            model.limits[axis][key] = _value(value, quantity.unit + LIMITS[key], here)
            model.as_written[axis][key] = value.strip()
        elif key == 'gauss_markov':
            model.gauss_markov[axis] = _gauss_markov(value, quantity, here)
        elif key == 'mean':
            model.mean[axis] = _value(value, quantity.unit, here, signed=True)
        else:
            raise _unknown(where, written, (*TERMS, 'gauss_markov', 'mean', *LIMITS, *'xyz'))


def _key(written: str, quantity: Quantity) -> str:
    """Return the key of a term given by its symbol or name; anything else unchanged."""
    words = written.replace('_', ' ').replace('-', ' ')
    return next((key for key, term in TERMS.items()
                 if words in (term.symbol, term.name(quantity))), written)


def _gauss_markov(value: Any, quantity: Quantity, where: str) -> GaussMarkov:
    entries = _mapping(value, where)
    if set(entries) != {'sigma', 'correlation_time'}:
        example = '{sigma: 10 deg/h, correlation_time: 100 s}' \
            if quantity is Quantity.ANGULAR_VELOCITY else '{sigma: 50 ug, correlation_time: 100 s}'
        raise ImuAllanError(f'{where}: expected sigma and correlation_time, such as {example}')
    time = _value(entries['correlation_time'], 's', f'{where}.correlation_time')
    if time == 0:
        raise ImuAllanError(f'{where}.correlation_time: must be greater than zero')
    return GaussMarkov(_value(entries['sigma'], quantity.unit, f'{where}.sigma'), time)


def _value(text: Any, unit: str, where: str, *, signed: bool = False) -> float:
    if not isinstance(text, str):
        raise ImuAllanError(f"{where}: expected a value with its unit, such as '1 {unit}'")
    try:
        value = parse(text, unit)
    except ImuAllanError as error:
        raise ImuAllanError(f'{where}: {error}') from error
    if value < 0 and not signed:
        raise ImuAllanError(f'{where}: {text!r} is negative; a noise coefficient is zero or '
                            'greater')
    return value


def _mapping(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict) or not all(isinstance(key, str) for key in value):
        example = ('100 ug/sqrt(Hz)' if 'accel' in where.rsplit(': ', 1)[-1] else
                   '0.03 deg/s/sqrt(Hz)')
        raise ImuAllanError(f'{where}: expected keys with values, such as '
                            f'{{noise_density: {example}}}')
    return value
