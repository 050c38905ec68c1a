# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
import contextlib

from hypothesis import given, strategies as st
from imu_allan.errors import ImuAllanError
from imu_allan.sensor.units import (
    engineering,
    ENGINEERING_UNITS,
    parse,
    typeset,
    unit_of,
)
import pytest
from whole_lines import refused

GYRO_N = 'rad/s/sqrt(Hz)'
ACCEL_N = 'm/s^2/sqrt(Hz)'
COMMA = 'has a decimal comma where a point belongs'
NO_NUMBER = 'does not begin with a number'
NO_RATE = 'is not in a unit that can be turned into rad/s'
RIGHT = "write a number with its unit, such as '1 deg/h' or '1 rad/s'"


@pytest.mark.parametrize(('text', 'unit', 'expected'), [
    ('1 deg/h', 'rad/s', 4.848136811e-6), ('1 deg/sqrt(h)', GYRO_N, 2.908882087e-4),
    ('1 deg/h/sqrt(h)', 'rad/s^2/sqrt(Hz)', 8.080228018e-8),
    ('1 deg/h^2', 'rad/s^2', 1.346704670e-9), ('1 ug', 'm/s^2', 9.80665e-6),
    ('60 m/s/sqrt(h)', ACCEL_N, 1.0), ('100 ug/sqrt(Hz)', ACCEL_N, 9.80665e-4),
    ('2 min', 's', 120.0), *((text, GYRO_N, 5.235987756e-4) for text in (
        '0.03deg/s/sqrt(Hz)', '0.03 °/s/√Hz', '0.03 deg/s/rtHz', '30 mdps/sqrt(Hz)',
        '3e-2 deg/s/Hz^0.5', '0.03 deg/(s*sqrt( Hz ))', '.03 degrees sec^-1/sqrt(Hz)'))])
def test_units_of_datasheets_in_any_spelling_have_their_textbook_value(text, unit, expected):
    assert parse(text, unit) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(('text', 'complaint'), [
    ('0,005 deg/h', COMMA), ('0.03', 'has no unit'), ('deg/h', NO_NUMBER),
    ('nan deg/h', NO_NUMBER), ('1e999 deg/h', 'is too large'), ('1e308 rad/us', 'is too large'),
    *((text, NO_RATE) for text in (
        '3 deg', '3 1/s', '3 kg', '3 deg/h^99', '3 deg//h', '3 (((h^9)^9)^9)^9',
        '3 __import__("os")', '3 deg/h 5', '1 rad/s)', '1 (rad/s', '1 rad/', '1 rad/s^'))])
def test_what_is_not_an_angular_rate_is_refused_with_an_example(text, complaint):
    with refused(f'{text!r} {complaint}; {RIGHT}'):
        parse(text, 'rad/s')


def test_an_angular_rate_is_no_noise_density_and_a_long_text_is_shown_in_part():
    with refused(f"'18 deg/h' is not in a unit that can be turned into {GYRO_N}; write a number "
                 f"with its unit, such as '1 deg/sqrt(h)' or '1 {GYRO_N}'"):
        parse('18 deg/h', GYRO_N)
    text = '1 ' + 'rad/' * 200 + 's'
    with refused(f"'{text[:80]}...' {NO_RATE}; {RIGHT}"):
        parse(text, 'rad/s')


@given(st.text(max_size=60)
       | st.text(alphabet='degsqrthHzmuradg/^*()0123456789. -√°', max_size=40).map('1 '.__add__))
def test_any_text_gives_a_number_or_the_known_error(text):
    for unit in ('rad/s', ACCEL_N):
        with contextlib.suppress(ImuAllanError):
            assert isinstance(parse(text, unit), float)


@given(st.sampled_from(sorted(ENGINEERING_UNITS)),
       st.floats(1e-12, 1e6, allow_nan=False, allow_infinity=False))
def test_engineering_units_convert_back_to_the_same_value(unit, value):
    shown, name = engineering(value, unit)
    assert parse(f'{shown!r} {name}', unit) == pytest.approx(value, rel=1e-12)


def test_the_unit_of_a_value_is_what_follows_the_number_and_is_typeset():
    unit = 'rad/s^2/sqrt(Hz)'
    assert typeset(unit) == 'rad/s²/√Hz'
    assert unit_of(f'0.03 {unit}') == unit
    with refused(f'{unit!r} does not begin with a number'):
        unit_of(unit)
