# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Conversion of units as engineers write them, to SI and back.

One table has the units in which inertial sensors are described, and no others. An angle has its
own dimension here, so that ``0.03 1/s/sqrt(Hz)`` is not taken for an angular rate. ``g`` is the
standard acceleration, not a gram.
"""

import ast
from functools import lru_cache
from math import isfinite, pi
import re

from imu_allan.errors import ImuAllanError

STANDARD_GRAVITY = 9.80665
"""m/s^2 in one g, by definition; an accelerometer at rest measures it upwards."""

ENGINEERING_UNITS: dict[str, str] = {
    'rad': 'deg',
    'rad/s/sqrt(Hz)': 'deg/sqrt(h)',
    'rad/s': 'deg/h',
    'rad/s^2/sqrt(Hz)': 'deg/h/sqrt(h)',
    'rad/s^2': 'deg/h^2',
    'm/s': 'mm/s',
    'm/s^2/sqrt(Hz)': 'ug/sqrt(Hz)',
    'm/s^2': 'ug',
    'm/s^3/sqrt(Hz)': 'ug/sqrt(h)',
    'm/s^3': 'ug/h',
    'rad/s/K': 'deg/h/K',
    'm/s^2/K': 'ug/K',
    's': 's',
}
"""The unit that datasheets use for each SI unit of a coefficient or of an Allan deviation."""

_Size = tuple[float, tuple[float, ...]]
_UNITS: dict[str, _Size] = {
    name: (factor, powers)
    for powers, sizes in {
        (1.0, 0.0, 0.0, 0.0): {
            'rad radian radians': 1.0, 'deg degree degrees': pi / 180,
            'arcmin arcminute': pi / 10_800, 'arcsec arcsecond': pi / 648_000},
        (0.0, 1.0, 0.0, 0.0): {'m metre meter': 1.0, 'ft': 0.3048},
        (0.0, 0.0, 1.0, 0.0): {
            's sec second seconds': 1.0, 'min minute minutes': 60.0, 'h hr hour hours': 3600.0},
        (0.0, 0.0, -1.0, 0.0): {'Hz hertz': 1.0},
        (1.0, 0.0, -1.0, 0.0): {'dps': pi / 180, 'dph': pi / 648_000},
        (0.0, 1.0, -2.0, 0.0): {'g': STANDARD_GRAVITY, 'Gal': 1e-2},
        # For temperature differences: a degree Celsius is as large as a kelvin.
        (0.0, 0.0, 0.0, 1.0): {'K kelvin degC': 1.0},
    }.items()
    for names, factor in sizes.items()
    for name in names.split()
}
"""Size in SI units, and powers of angle, length, time and temperature, of every known unit."""

_NUMBER = re.compile(r'\s*([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{1,4})?)(?![\d.])\s*(.*)\Z',
                     re.DOTALL)
# PDFs of datasheets and Spanish keyboards give other circles than the sign of a degree.
_SPELLINGS = str.maketrans({
    '°': 'deg', 'º': 'deg', '˚': 'deg', 'µ': 'u', 'μ': 'u', '·': '*', '²': '^2', '³': '^3',
    '√': 'sqrt', '½': '^0.5'})
_LONGEST = 80
"""In characters, twice any unit in use; the rest of a longer text is neither parsed nor shown."""


def parse(text: str, to: str) -> float:
    """Read a value such as ``0.03 deg/s/sqrt(Hz)`` or ``18 deg/h``, in the unit `to`."""
    known = dict.fromkeys((ENGINEERING_UNITS.get(to, to), to))
    right = ' or '.join(repr(f'1 {unit}') for unit in known)
    examples = f'write a number with its unit, such as {right}'
    shown = repr(text if len(text) <= _LONGEST else text[:_LONGEST] + '...')
    match = _NUMBER.match(text)
    if match is None:
        raise ImuAllanError(f'{shown} does not begin with a number; {examples}')
    unit = match[2].strip()
    if re.match(r',\d', unit):
        raise ImuAllanError(f'{shown} has a decimal comma where a point belongs; {examples}')
    if not unit:
        raise ImuAllanError(f'{shown} has no unit; {examples}')
    factor = _factor(unit, to)
    if factor is None:
        raise ImuAllanError(f'{shown} is not in a unit that can be turned into {to}; {examples}')
    value = float(match[1]) * factor
    if not isfinite(value):
        raise ImuAllanError(f'{shown} is too large; {examples}')
    return value


def unit_of(text: str) -> str:
    """Return the unit of a value that `parse` reads, as it is written."""
    match = _NUMBER.match(text)
    if match is None:
        raise ImuAllanError(f'{text[:_LONGEST]!r} does not begin with a number')
    return match[2].strip()


def convert(value: float, unit: str, to: str) -> float:
    """Return `value` given in `unit` in the unit `to`."""
    factor = _factor(unit, to)
    if factor is None:
        raise ImuAllanError(f'{unit} cannot be turned into {to}')
    return value * factor


MEAN_UNITS = {'rad/s': 'deg/s', 'm/s^2': 'm/s^2'}
"""Unit in which the mean of an axis is shown: a degree per second is easy to imagine."""


def engineering(value: float, unit: str) -> tuple[float, str]:
    """Return an SI value in the unit that datasheets use for it, and that unit."""
    to = ENGINEERING_UNITS[unit]
    return convert(value, unit, to), to


def typeset(unit: str) -> str:
    """Return `unit` with typographic symbols: ``°/√h`` for ``deg/sqrt(h)``, ``µg`` for ``ug``."""
    unit = re.sub(r'sqrt\((\w+)\)', r'√\1', unit)
    unit = re.sub(r'\bdeg\b', '°', re.sub(r'\bug\b', 'µg', unit))
    return unit.replace('^2', '²').replace('^3', '³')


@lru_cache(maxsize=256)
def _factor(unit: str, to: str) -> float | None:
    """Return how many `to` are in one `unit`; None if it is unknown or of another dimension."""
    try:
        size, powers = _size(unit)
        to_size, to_powers = _size(to)
    except (ValueError, SyntaxError, ArithmeticError):
        return None
    return size / to_size if powers == to_powers else None


def _size(text: str) -> _Size:
    """Return the size of a unit in SI, and its powers of angle, length, time and temperature."""
    if len(text) > _LONGEST:
        raise ValueError('too long for a unit')
    text = text.translate(_SPELLINGS)
    text = re.sub(r'\b(?:sqrt|rt|root)[\s-]*(?:\(\s*([A-Za-z]+)\s*\)|([A-Za-z]+))',
                  lambda m: f'({m[1] or m[2]})^0.5', text).strip()
    # Two units side by side, or with a dot, are multiplied. The rest has the syntax of Python.
    text = re.sub(r'(?<=[\w)])\s*(?=\()|(?<=\))\s*(?=[A-Za-z])|(?<=\w)[\s.]+(?=[A-Za-z])', '*',
                  text)
    return _size_of(ast.parse(text.replace('^', '**'), mode='eval').body)


def _size_of(node: ast.expr) -> _Size:
    """Return the size and the powers of a part of a unit."""
    match node:
        case ast.Name(name):
            return _named(name)
        case ast.BinOp(base, ast.Pow(), power):
            exponent = ast.literal_eval(power)
            # No text leads to an enormous power.
            if isinstance(exponent, (int, float)) and abs(exponent) < 10:
                size, powers = _size_of(base)
                return size**float(exponent), tuple(exponent * power for power in powers)
        case ast.BinOp(ast.Constant(1), ast.Div(), right):
            size, powers = _size_of(right)
            return size**-1.0, tuple(-power for power in powers)
        case ast.BinOp(left, ast.Div(), ast.Constant(int() | float() as count)):
            # Counts in a unit: g/16384.
            size, powers = _size_of(left)
            return size * float(count)**-1.0, powers
        case ast.BinOp(left, ast.Mult() | ast.Div() as sign, right):
            exponent = -1.0 if isinstance(sign, ast.Div) else 1.0
            size, powers = _size_of(left)
            other, its_powers = _size_of(right)
            return size * other**exponent, tuple(
                a + exponent * b for a, b in zip(powers, its_powers, strict=True))
    raise ValueError('not a unit')


def _named(name: str) -> _Size:
    if name in _UNITS:
        return _UNITS[name]
    prefixes = {'n': 1e-9, 'nano': 1e-9, 'u': 1e-6, 'micro': 1e-6, 'm': 1e-3, 'milli': 1e-3}
    for prefix, factor in prefixes.items():
        if name.startswith(prefix) and name[len(prefix):] in _UNITS:
            size, powers = _UNITS[name[len(prefix):]]
            return factor * size, powers
    raise ValueError(f'{name} is not a unit')
