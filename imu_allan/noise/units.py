# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Units as engineers write them, to SI and back.

One registry, of the units that inertial sensors are described in and no others. An angle is a
dimension of its own here, so that ``0.03 1/s/sqrt(Hz)`` is not taken for an angular rate; ``g`` is
the standard acceleration, not a gram.
"""

from functools import lru_cache
from math import isfinite
import re
from tokenize import TokenError
from typing import Any

from imu_allan.errors import ImuAllanError

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
    's': 's',
}
"""The unit that datasheets use for each SI unit of a coefficient or of an Allan deviation."""

_DEFINITIONS = (
    'nano- = 1e-9 = n-',
    'micro- = 1e-6 = u-',
    'milli- = 1e-3 = m-',
    'radian = [angle] = rad = radians',
    'metre = [length] = m = meter',
    'second = [time] = s = sec = seconds',
    'minute = 60 * second = min',
    'hour = 3600 * second = h = hr = hours',
    'degree = 3.141592653589793 / 180 * radian = deg = degrees',
    'arcminute = degree / 60 = arcmin',
    'arcsecond = degree / 3600 = arcsec',
    'degree_per_second = degree / second = dps',
    'hertz = 1 / second = Hz',
    'standard_gravity = 9.80665 * metre / second ** 2 = g',
)

_NUMBER = re.compile(r'\s*([+-]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d{1,4})?)(?![\d.])\s*(.*)\Z',
                     re.DOTALL)
_SPELLINGS = (
    ('°', 'deg'), ('µ', 'u'), ('μ', 'u'), ('·', '*'), ('²', '^2'), ('³', '^3'), ('√', 'sqrt'),
)
# Exponents have one digit and no exponent of their own: no text asks for an enormous power. One
# character a round, so that no text takes long to refuse either.
_UNIT = re.compile(r'(?:[A-Za-z_]|1(?=\s*/)|\*(?!\*)|/(?!\s*/)|\(|\)|\s'
                   r'|(?:\^|\*\*)\s?-?\d(?:\.5)?(?![\d.]|\s*(?:\^|\*\*)))+\Z')
_ROOT = re.compile(r'\b(?:sqrt|rt)\s*(?:\(\s*([A-Za-z]+)\s*\)|([A-Za-z]+))')
_LONGEST = 80


def parse(text: str, to: str) -> float:
    """
    Read a value with its unit.

    Parameters
    ----------
    text : str
        A number and a unit, such as ``0.03 deg/s/sqrt(Hz)``, ``18 deg/h`` or ``100 ug/sqrt(Hz)``.
        The signs of datasheets (``°``, ``µ``, ``√``, ``²``) are understood.
    to : str
        Unit of the result, which is one of the keys of `ENGINEERING_UNITS`.

    Returns
    -------
    float
        In the unit `to`.

    Raises
    ------
    ImuAllanError
        If the number, the unit or its dimension is not right; the message gives a right example.

    """
    examples = f"write it with a unit, such as '1 {ENGINEERING_UNITS.get(to, to)}' or '1 {to}'"
    shown = repr(text if len(text) <= _LONGEST else text[:_LONGEST] + '...')
    match = _NUMBER.match(text)
    if match is None:
        raise ImuAllanError(f'{shown} does not begin with a number; {examples}')
    number, unit = float(match[1]), match[2].strip()
    if not unit:
        raise ImuAllanError(f'{shown} has no unit; {examples}')
    if not isfinite(number):
        raise ImuAllanError(f'{shown} is not a finite number; {examples}')
    factor = _factor(unit, to)
    if factor is None:
        raise ImuAllanError(f'{shown} is not in a unit that can be turned into {to}; {examples}')
    value = number * factor
    if not isfinite(value):
        raise ImuAllanError(f'{shown} is not a finite number; {examples}')
    return value


def unit_of(text: str) -> str:
    """
    Return the unit of a value that `parse` reads, as it is written.

    Raises
    ------
    ImuAllanError
        If `text` does not begin with a number.

    """
    match = _NUMBER.match(text)
    if match is None:
        raise ImuAllanError(f'{text[:_LONGEST]!r} does not begin with a number')
    return match[2].strip()


def convert(value: float, unit: str, to: str) -> float:
    """
    Return `value` given in `unit` in the unit `to`.

    Raises
    ------
    ImuAllanError
        If the two units are not of one dimension.

    """
    factor = _factor(unit, to)
    if factor is None:
        raise ImuAllanError(f'{unit} cannot be turned into {to}')
    return value * factor


def engineering(value: float, unit: str) -> tuple[float, str]:
    """
    Return an SI value in the unit that datasheets use for it.

    Parameters
    ----------
    value : float
        In the SI unit `unit`.
    unit : str
        One of the keys of `ENGINEERING_UNITS`.

    Returns
    -------
    value : float
    unit : str
        For instance ``deg/sqrt(h)`` for an angle random walk.

    """
    to = ENGINEERING_UNITS[unit]
    return convert(value, unit, to), to


def typeset(unit: str) -> str:
    """Return `unit` with the signs of print: ``°/√h`` for ``deg/sqrt(h)``, ``µg`` for ``ug``."""
    unit = re.sub(r'sqrt\((\w+)\)', r'√\1', unit)
    unit = re.sub(r'\bdeg\b', '°', re.sub(r'\bug\b', 'µg', unit))
    return unit.replace('^2', '²').replace('^3', '³')


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint

    registry: Any = pint.UnitRegistry(None)
    for definition in _DEFINITIONS:
        registry.define(definition)
    return registry


@lru_cache(maxsize=256)
def _factor(unit: str, to: str) -> float | None:
    """Units of `to` in one `unit`; None where `unit` is unknown or of another dimension."""
    import pint

    parsed = []
    for text in (unit, to):
        for sign, spelling in _SPELLINGS:
            text = text.replace(sign, spelling)
        text = _ROOT.sub(lambda m: f'(({m[1] or m[2]})^0.5)', text)
        if len(text) > _LONGEST or not _UNIT.match(text):
            return None
        parsed.append(text.replace('^', '**'))
    try:
        return float(_registry().Quantity(1.0, parsed[0]).to(parsed[1]).magnitude)
    except (pint.errors.PintError, TokenError, SyntaxError, TypeError, ValueError,
            ArithmeticError, AttributeError, AssertionError):
        return None
