# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a user reads: how numbers are worded, and that tests compare it as whole lines."""

from dataclasses import replace
from pathlib import Path
import re

from hypothesis import given, strategies as st
from imu_allan.result import Span, Timeline, Total
from imu_allan.wording import amount_of, bounded, duration, faults_of, measured, number
import pytest
from whole_lines import Varying


# The examples in the docstrings say the rest.
@pytest.mark.parametrize(('said', 'text'), [
    (duration(0.012), '12 ms'), (duration(93), '93 s'), (duration(10_800), '3 h'),
    (number(0), '0'), (number(-12345.6), '-12346'), (number(9999.6), '10000'),
    (number(1.5e9), '1.5e+09'), (bounded(99.96), '< 100'),
    (bounded(1.2345e-7, 'Q'), '< 1.23e-07')])
def test_times_numbers_and_bounds_are_said_in_three_or_four_digits(said, text):
    assert said == text


@pytest.mark.parametrize(('numbers', 'texts'), [
    ((150.0, 149.95, 150.05), ('150.00', '149.95', '150.05')),
    ((150.0, 149.0, 152.0), ('150.0', '149.0', '152.0')),
    ((4e-6, 2.8e-6, 5.2e-6), ('4.0e-06', '2.8e-06', '5.2e-06')),
    ((9.996, 9.95, 10.04), ('10.00', '9.95', '10.04')),
    ((-49.5, -64.35, -34.65), ('-50', '-64', '-35')),
    ((1234567.0, 1234000.0, 1235000.0), ('1.2346e+06', '1.2340e+06', '1.2350e+06')),
    ((3.0, 0.0, 7.0), ('3.0', '0', '7.0')),
    ((2.5, 2.5, 2.5), ('2.5', '2.5', '2.5'))])
def test_the_digits_of_a_value_follow_from_its_interval(numbers, texts):
    assert measured(*numbers) == texts


@given(st.floats(1e-12, 1e12), st.floats(1e-7, 0.9), st.floats(1e-7, 10))
def test_rounding_moves_a_value_by_far_less_than_its_interval(value, below, above):
    low, high = value * (1 - below), value * (1 + above)
    shown = [float(text) for text in measured(value, low, high)]
    nearer = min(value - low, high - value)
    for text, true in zip(shown, (value, low, high), strict=True):
        assert abs(text - true) <= max(nearer / 6, 1e-5 * abs(true))


def test_a_recording_is_summed_up_in_one_line():
    timeline = Timeline(200.0, 2_160_000, 10_800.0, missing=1200, duplicates=1,
                        gaps=(Span(1.0, 4.0), Span(9.0, 2.0)), motion=(Span(5.0, 300.0),))
    assert amount_of(timeline) == '2,160,000 samples at 200 Hz, 3 h, 2 h 55 min at rest'
    assert faults_of(timeline) == ['1,200 missing', '1 duplicate', '2 gaps (6 s)',
                                   '1 segment of motion (5 min)']
    assert amount_of(Timeline(None, 1, 0.0)) == '1 sample, 0 s'
    # Motion counts though only the first spans of it are listed.
    timeline = replace(timeline, all_motion=Total(1500, 5400.0))
    assert amount_of(timeline) == '2,160,000 samples at 200 Hz, 3 h, 90 min at rest'
    assert faults_of(timeline)[-1] == '1,500 segments of motion (90 min)'


def test_numbers_and_words_vary_only_where_the_line_says_so():
    line = Varying('<number> of 1,024 messages are lost (<words>)')
    assert line == '3 of 1,024 messages are lost (disk full)'
    assert line == '-1,200.5e-06 of 1,024 messages are lost (x)'
    assert line != '3 of 1,025 messages are lost (disk full)'
    assert line != 'about 3 of 1,024 messages are lost (disk full)'
    assert line != '3 of 1,024 messages are lost ()'
    assert line != '3 of 1,024 messages are lost (disk\nfull)'


def test_no_test_looks_for_a_part_of_what_an_error_says():
    part = re.compile(r"""match\b=(?!r?f?(['"])\^.*\$\1)|(?<!not )in str\(error(\.value)?\)"""
                      r'|str\(error(\.value)?\)\.(starts|ends)with')
    assert [(path.name, found[0]) for path in Path(__file__).parent.rglob('test_*.py')
            for found in part.finditer(path.read_text())] == []
