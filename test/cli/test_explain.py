# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The verb that says what a finding means."""

from imu_allan.writers.sentences import WORDS
import pytest


@pytest.mark.parametrize('given', ['not_steady', 'NOT-STEADY', 'not steady'])
def test_a_code_is_explained_however_it_is_written(given, output_of):
    lines = output_of('explain', given).splitlines()
    assert lines[0] == 'not_steady: not steady (act upon it)'
    assert lines[1].startswith('What it means: The noise was not the same all the time')


@pytest.mark.parametrize('code', WORDS)
def test_every_name_that_a_result_shows_is_explained_as_it_stands_there(code, output_of):
    title = WORDS[code].title
    said = output_of('explain', title)
    assert f'{code}: {title} (' in said
    assert output_of('explain', *title.split()) == said


def test_codes_that_share_a_name_are_both_explained(output_of):
    said = output_of('explain', 'motion').split('\n\n')
    assert [text.split(':')[0] for text in said] == ['mostly_motion', 'motion']


def test_without_a_code_all_are_listed(output_of):
    assert [line.split()[0] for line in output_of('explain').splitlines()] == [*WORDS]


@pytest.mark.parametrize(('code', 'shown', 'hint'), [
    ('bias_stop', 'bias_stop', '; did you mean bias_step?'), ('', "''", '')])
def test_a_code_that_is_none_is_one_line_with_the_nearest(fails_with, code, shown, hint):
    fails_with(f'{shown}: no finding has this code{hint} (all: imu_allan explain)',
               'explain', code)
