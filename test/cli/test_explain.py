# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The verb that says what a finding means."""

from imu_allan.writers.sentences import WORDS


def test_every_finding_is_listed_and_explained_by_its_code_or_by_its_title(output_of):
    assert [line.split()[0] for line in output_of('explain').splitlines()] == [*WORDS]
    for code, words in WORDS.items():
        said = output_of('explain', words.title)
        assert f'{code}: {words.title} (' in said
        assert '\nWhat it means: ' in said
        assert output_of('explain', *words.title.split()) == said
    assert output_of('explain', 'NOT-STEADY') == output_of('explain', 'not_steady')


def test_a_code_that_is_none_is_one_line_with_the_nearest(fails_with):
    fails_with('bias_stop: no finding has this code; did you mean bias_step? (all: imu_allan '
               'explain)', 'explain', 'bias_stop')
