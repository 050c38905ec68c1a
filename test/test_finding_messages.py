# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Findings are data; their words stand in one table, which nothing else makes or reads."""

import ast
from dataclasses import replace
from pathlib import Path
import re

import imu_allan
from imu_allan.finding import CODES, finding, is_optional
from imu_allan.finding_messages import advice, brief, for_display, message_of, sentence_of
from imu_allan.finding_texts import WORDS
from on_terminal import assert_as_before
import pytest

PACKAGE = Path(imu_allan.__file__).parent


def test_every_code_that_is_found_has_words_and_every_value_a_type():
    # Calls that make a finding with a code that is written there.
    calls = [node for path in sorted(PACKAGE.rglob('*.py'))
             if path.name not in ('finding_messages.py', 'finding_texts.py')
             for node in ast.walk(ast.parse(path.read_text()))
             if isinstance(node, ast.Call) and node.args and isinstance(node.args[0], ast.Constant)
             and getattr(node.func, 'id', getattr(node.func, 'attr', '')) in ('finding', 'remark')]
    assert len({ast.unparse(call.args[0]) for call in calls}) > 40
    for call in calls:
        code = ast.literal_eval(call.args[0])
        # Those of `**values` are checked where the finding is made.
        names = {keyword.arg for keyword in call.keywords} - {
            'severity', 'recording', 'lost_share'}
        assert names - {None} <= set(CODES[code].values), ast.unparse(call)
        if None not in names:
            assert {name for name, kind in CODES[code].values.items()
                    if not is_optional(kind)} <= names, ast.unparse(call)
    assert list(WORDS) == list(CODES)


@pytest.mark.parametrize(('code', 'values'), [
    *(('clock_speed', values) for values in (
        {}, {'ratio': 'ten'}, {'ratio': float('nan')}, {'ratio': 10.0, 'speed': 1.0})),
    ('saturated', {'share': 0.5, 'value': 1.0, 'unit': 'rad/s', 'end': 'last'}),
    ('noise_level_changed', {'at_s': ['300'], 'ratios': [2.0]})])
def test_a_value_that_is_not_as_the_table_has_it_is_a_bug(code, values):
    with pytest.raises(TypeError, match=f'^{code}: ({"|".join(values) or "ratio"})=.*$'):
        finding(code, (), severity=None, recording=None, **values)


@pytest.mark.parametrize('value', [None, [None, 1.0], {'of': 'the future'}], ids=str)
def test_a_figure_that_a_file_does_not_have_is_not_said(value):
    for found in SAID:
        for name in found.values:
            lacking = replace(found, values={**found.values, name: value}, message='as stored')
            for live in (False, True):
                said = message_of(lacking, live=live)
                assert not re.search(r'\bNone\b|future', said), lacking
    unread = finding('thermometer', fault='unread', reason=None)
    assert message_of(replace(unread, message='as stored')) == 'as stored'


def of_all(code, name, figures, **values):
    """Return a finding about three axes, of which one figure differs."""
    [one] = for_display([finding(code, (axis,), severity=None, recording=None,
                                 **{name: figure}, **values)
                         for axis, figure in zip(ALL, figures, strict=True)])
    return one


GYRO, ALL = ('gyro_x',), ('gyro_x', 'gyro_y', 'gyro_z')
IMU, RECORDING = '/imu', {'recording': 'a.mcap'}
LOST = {'lost': 30, 'of': 1000, 'topic': IMU}
SAID = [
    finding('stood_still', GYRO, start_s=120.0, duration_s=80.0),
    of_all('constant_axis', 'value', [0.0, 0.0, 0.25], unit='rad/s'),
    finding('saturated', GYRO, share=0.5, value=9.81, unit='m/s^2', end='highest'),
    finding('deadband', GYRO, share=0.93, width=1e-4, unit='rad/s'),
    finding('high_passed', GYRO, corner_hz=0.031),
    finding('filtered', **RECORDING),
    finding('axis_not_finite', GYRO), finding('axis_not_finite', GYRO, no_column=True),
    finding('frozen', messages=1500, since_s=67.5),
    finding('unknown_rate'), finding('mostly_motion', share=0.8),
    *(finding('slow_motion', GYRO, size=0.0102, unit='rad/s', start_s=60.0, duration_s=28.0,
              count=count) for count in (1, 3)),
    finding('noise_level_changed', at_s=[300.0], ratios=[2.01]),
    finding('bias_step', GYRO, size=4.8e-4, unit='rad/s', after_s=4000.0),
    finding('not_steady', GYRO, low_hz=120.0, spread_share=0.05, segment_s=600.0),
    finding('not_steady', GYRO, low_hz=0.1, high_hz=3.0, spread_share=0.5, segment_s=60.0),
    finding('warm_up', GYRO, amplitude=0.02, unit='rad/s', time_constant_s=600.0,
            start_s=1800.0, time_constant_factor=1.1, exponentials=2, steady_after_s=1800.0),
    finding('warm_up', GYRO, amplitude=0.02, unit='rad/s', time_constant_s=600.0,
            time_constant_factor=7.0, exponentials=1, steady_after_s=1800.0),
    finding('several_publishers'),
    finding('several_frames', frame_id='imu_link', others=['base_link'], rejected=[2000]),
    finding('rate_changed', from_hz=100.0, to_hz=50.0, at_s=300.0, left_out=20_000,
            most_left_out=False),
    finding('rate_changed', from_hz=200.0, to_hz=100.0, at_s=None, left_out=200,
            most_left_out=True),
    finding('clock_changed', flaw='constant', since_s=120.0), finding('clock_speed', ratio=10.0),
    finding('gravity', mean=0.02), finding('gravity', mean=1.0), finding('gravity', mean=5.0),
    finding('implausible', GYRO, what='mean', value=60.0, unit='rad/s', limit=0.5,
            likely='degrees'),
    finding('many_missing', share=0.1, density_error_share=None),
    finding('many_missing', share=0.6, density_error_share=0.25),
    finding('spikes', messages=1), finding('spikes', messages=29),
    finding('field_absent', messages=12),
    finding('interpolated', topic=IMU, half='accel', **RECORDING),
    finding('damaged_recording', fault='places', places=1, first='at byte 90: cut', **LOST,
            **RECORDING),
    finding('damaged_recording', fault='database', read=4980, topic=IMU, reason='bad'),
    finding('damaged_recording', fault='bytes', bytes=7000),
    finding('damaged_recording', fault='file', reason='b.mcap: empty'),
    finding('damaged_recording', fault='unread', severity='act', **LOST),
    finding('truncated_recording', fault='ends', end='the rest is missing', whole_chunks=4),
    finding('truncated_recording', fault='compressed', reason='9 of 10 bytes are missing'),
    finding('truncated_recording', fault='database', missing_bytes=9, bytes=10),
    finding('truncated_recording', fault='log', bytes=77),
    finding('lost_messages', found=90, counted=100, topic=IMU),
    finding('missing_file', missing=1, listed=3, files='b.mcap'),
    finding('malformed_messages', what='line', count=4, first='line 3: x,6'),
    finding('malformed_messages', what='message', count=1, topic=IMU, type='a/msg/B', first='8'),
    finding('short_recording', samples=20, duration_s=0.2, needed=57),
    finding('short_recording', GYRO, coefficient='rate_random_walk', duration_s=600.0),
    finding('poor_fit', GYRO, misfit_share=0.12), finding('poor_fit', GYRO, misfit_share=4.7e15),
    finding('poor_fit', GYRO, misfit_share=None),
    finding('recordings_disagree', GYRO, coefficient='noise_density', value=1e-4,
            of_recording='b', usual_value=8e-5, others=['a', 'c'], unit='rad/s/sqrt(Hz)'),
    finding('thermometer', fault='short', covered_share=0.64),
    finding('thermometer', fault='constant'),
    finding('thermometer', fault='unread', reason='line 2'), finding('trend_or_walk', GYRO),
    finding('power_law', GYRO, exponent=0.7, exponent_low=0.68, exponent_high=0.72),
    of_all('band_limited', 'window_s', [0.0148, 0.02, 0.0152]),
    finding('band_limited', GYRO, edge_hz=20.0),
    finding('gauss_markov', GYRO, sigma=1e-3, unit='rad/s', correlation_time_s=9.0),
    finding('temperature', GYRO, per_kelvin=2e-3, per_kelvin_low=1.9e-3, per_kelvin_high=2.1e-3,
            unit='rad/s', lowest_c=24.0, highest_c=37.0, lag_s=240.0),
    finding('slow_cycle', GYRO, period_s=1200.0),
    finding('coarse_resolution', GYRO, step=0.03, unit='rad/s', ratio=3.0),
    finding('tones', GYRO, count=2, unit='rad/s', frequency_hz=23.4, amplitude=2e-4,
            half_rate=False),
    finding('tones', GYRO, count=1, unit='rad/s', frequency_hz=100.0, amplitude=2e-4,
            half_rate=True),
    finding('turn_on_bias', GYRO, sigma=1e-3, sigma_low=5e-4, sigma_high=3e-3, unit='rad/s'),
    finding('motion', count=2, excluded_s=345.0),
    finding('rest_within_motion', share=0.88, rest_s=46.5, rests=7, starts_s=[2.56e-07, 263.0],
            durations_s=[15.5, 15.5]),
    finding('motion_kept', count=1, seen_s=3.0, first_s=59.0),
    finding('receive_clock', flaw='zero'),
    finding('receive_clock', flaw=None), finding('counted_samples', rate_hz=250.0),
    finding('uneven_stamps', clock='header'),
    finding('uneven_stamps', clock='header', hidden_share=0.1,
            density_high_share=0.06, rate_error_share=0.02),
    finding('clock_jumps', clock='header', count=1),
    finding('clock_jumps', clock='header', count=3), finding('repeated_part', messages=60_000),
    finding('held_values', share=0.5), finding('unit_g'), finding('unit_assumed'),
    *(finding('two_rates', sensors=['gyro', 'accel'], topics=['/g', '/a'], rates_hz=[400.0, rate])
      for rate in (250.0, 400.0001)),
    finding('repeated_half', topic=IMU, half='accel'),
    finding('chosen_topic', topics=3, chosen=['GYR', 'ACC'], reason='at random', others=['IMU']),
    finding('short_part', recorded_s=120.0, asked_s=300.0),
    finding('ignored_columns', count=12, columns=['alpha_x']),
    finding('ignored_columns', count=1, columns=['note']),
    finding('no_metadata', reason=None), finding('no_metadata', reason='cut'),
    finding('unfinished_recording', fault='unusable', file='a.db3-journal', reason='cut'),
    finding('unfinished_recording', fault='not_regular', file='a.db3-wal')]
"""Findings of every code, with each figure that changes the sentence."""


@pytest.mark.parametrize('code', WORDS)
def test_sentences_are_short_and_plain(code):
    words, findings = WORDS[code], [found for found in SAID if found.code == code]
    # The page has no figures, and says in any case what to do.
    assert isinstance(words.general or words.do, str)
    texts = [words.title, words.means, words.found, words.live or '', words.general]
    texts += [text for found in findings for text in (sentence_of(found), advice(found))]
    # The verdict is a line.
    assert all(len(brief(found).split()) <= 12 for found in findings)
    assert words.brief or CODES[code].severity == 'know'
    for text in texts:
        # A figure or a path stands for a word.
        for sentence in re.split(r'(?<=[.!?])\s', text):
            assert len(sentence.split()) <= 25, sentence


def test_numbers_of_both_signs_are_no_range():
    # From -0.01 to 0.03 rad/s would hold zero.
    found = for_display([
        finding('warm_up', (axis,), amplitude=amplitude, unit='rad/s', time_constant_s=600.0,
                exponentials=1, steady_after_s=1800.0)
        for axis, amplitude in zip(ALL, (0.02, -0.01, 0.03), strict=True)])
    assert [(one.axes, one.values['amplitude']) for one in found] == [
        (('gyro_x', 'gyro_z'), [0.02, 0.03]), (('gyro_y',), -0.01)]


def test_every_finding_is_said_as_it_was():
    assert {found.code for found in SAID} == set(WORDS)
    assert_as_before(''.join(f'{message_of(found)}\n' for found in SAID), 'snapshots/findings.txt')
