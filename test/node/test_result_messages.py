# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from dataclasses import replace
import math
from typing import Any

from builtin_interfaces.msg import Time
from changed import only, UNSEEN, with_axes, with_coefficient
from diagnostic_msgs.msg import DiagnosticStatus
from imu_allan.finding import finding
from imu_allan.node.diagnostics import diagnostics_message, Facts, waiting_for
from imu_allan.node.result_messages import result_messages
from imu_allan.result import GoodnessOfFit, Result, Timeline, Tone, TurnOnBias
from imu_allan.timeline import TimelineSummary
from imu_allan.writers.words import message_of, with_words
import numpy as np
import pytest
from ros_harness import at_rest, facts, result_of, summary

STAMP = Time(sec=12, nanosec=34)
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
N, K = 'noise_density', 'rate_random_walk'
JUMPED = finding('clock_jumps', clock='header', count=2)


@pytest.fixture(scope='module')
def result() -> Result:
    """Give two axes of white noise, on which nothing is awaited, and K shows on the second."""
    found = only(result_of(at_rest(3000)), 'gyro_')
    found = replace(found, axes={name: found.axes[name] for name in ('gyro_x', 'gyro_y')})
    for key in found.axes['gyro_x'].coefficients:
        found = with_coefficient(found, '', key, observable_in_s=None)
    return with_coefficient(found, 'gyro_y', K, observable=True, value=1e-5, ci95=(9e-6, 1.1e-5))


def shown(part: str, facts_: Facts, summary_: TimelineSummary, result: Result | None = None
          ) -> DiagnosticStatus:
    """Give a status of ``/diagnostics``."""
    array = diagnostics_message('imu_allan', STAMP, [(facts_, summary_)], result)
    [status] = [one for one in array.status if one.name == f'imu_allan: {part}']
    return status


def entries(status: DiagnosticStatus) -> dict[str, str]:
    return {entry.key: entry.value for entry in status.values}


@pytest.mark.parametrize(('key', 'changes', 'level', 'words'), [
    (N, {}, OK, 'noise density and rate random walk are observable'),
    (K, {**UNSEEN, 'observable_in_s': 7200.0}, WARN,
     'rate random walk not observable yet, expected in 2 h'),
    (N, UNSEEN, WARN, 'noise density not observable yet')])
def test_the_level_of_an_axis_says_whether_a_filter_can_be_configured(
        result: Result, key: str, changes: dict[str, Any], level: bytes, words: str) -> None:
    changed = with_coefficient(only(result, 'gyro_y'), '', key, **changes)
    for fit, said, more in ((True, level, ''), (False, WARN, '; no noise model fits this axis '
                                                             'well')):
        fitted = with_axes(changed, goodness_of_fit=GoodnessOfFit(0.5, 0.01, fit))
        [status] = result_messages(fitted, 'imu_allan', STAMP)['coefficients'].status
        assert (status.level, status.message) == (said, words + more)


def test_an_absent_axis_is_nan_and_a_hidden_term_reaches_from_zero_to_its_bound(
        result: Result) -> None:
    messages = result_messages(only(result, 'gyro_x'), 'imu_allan', STAMP)
    axis = result.axes['gyro_x']
    vector = messages['gyro/noise_density']
    assert vector.vector.x == axis.coefficients[N].value
    assert math.isnan(messages['accel/noise_density'].vector.z)
    assert (vector.header.stamp, vector.header.frame_id) == (STAMP, 'imu')
    for term, ends in ((N, axis.coefficients[N].ci95), (K, (0.0, axis.coefficients[K].upper95))):
        vectors = [messages[f'gyro/{term}/interval/{end}'].vector for end in ('low', 'high')]
        assert tuple(vector.x for vector in vectors) == ends
        assert all(math.isnan(vector.y) for vector in vectors)
    curve = messages['gyro/allan_deviation']
    assert [(dim.label, dim.size, dim.stride) for dim in curve.layout.dim] == [
        ('tau,x,y,z', 4, 100), ('octave', 25, 25)]
    rows = np.array(curve.data).reshape(4, 25)
    assert [np.isfinite(row).sum() for row in rows] == [len(axis.curve.tau_s)] * 2 + [0, 0]
    assert np.isnan(messages['accel/allan_deviation'].data).all()
    # A curve of more octaves keeps its longest averaging times.
    longer = with_axes(only(result, 'gyro_x'), curve=lambda axis: replace(
        axis.curve, tau_s=tuple(2.0**np.arange(28)), adev=tuple(np.arange(28.0))))
    rows = np.array(result_messages(longer, 'imu_allan', STAMP)['gyro/allan_deviation'].data)
    np.testing.assert_array_equal(rows[:50], [*2.0**np.arange(3, 28), *np.arange(3.0, 28)])


def test_findings_stand_with_their_axis_and_in_the_estimation_in_the_order_of_the_result(
        result: Result) -> None:
    found = [finding('gaps_not_listed', listed=1000, gaps=2000, gaps_s=200.0),
             *(finding('deadband', (f'gyro_{letter}',), share=0.5, width=0.01, unit='rad/s')
               for letter in 'xy'), finding('frozen', messages=20, since_s=3.0)]
    result = with_words(replace(
        with_axes(result, tones=(Tone(50.0, 1e-3),)), warnings=tuple(found),
        turn_on_bias={'gyro_y': TurnOnBias(0.2, (0.1, 4.5))}))
    x, y = result_messages(result, 'imu_allan', STAMP)['coefficients'].status
    words = ('50 % of the samples are exactly 0, and none lies between 0 and 0.01 rad/s: the '
             'driver gives small values as 0. -> no coefficient is given; switch the deadband '
             'off, then call ~/reset')
    assert entries(x)['tones/0/frequency_hz'] == '50.0'
    assert entries(x)['remarks/deadband'] == entries(y)['remarks/deadband'] == words
    assert [{key: value for key, value in entries(status).items() if 'turn_on' in key}
            for status in (x, y)] == [{}, {
                'turn_on_bias/value': '0.2', 'turn_on_bias/ci95_low': '0.1',
                'turn_on_bias/ci95_high': '4.5', 'turn_on_bias/unit': 'rad/s'}]
    status = shown('estimation', facts(), summary(), result)
    said = [entry.key for entry in status.values if entry.key.startswith('remarks/')]
    assert [key.split('/')[1] for key in said] == [one.code for one in result.warnings]
    assert len(set(said)) == len(result.warnings)
    # Those to act upon come first, and make the message unless they may be over.
    acted = [one for one in result.warnings if one.severity == 'act']
    assert [*result.warnings[:len(acted)]] == acted
    assert status.level == WARN
    assert status.message == '; '.join(
        message_of(one, live=True) for one in acted if one.code == 'deadband')
    # What is good to know alone is no warning.
    mild = replace(result, warnings=result.warnings[len(acted):])
    assert shown('estimation', facts(), summary(), mild).level == OK


@pytest.mark.parametrize(('part', 'facts_', 'summary_', 'level', 'words'), [
    ('reception', facts(), summary(), OK, 'receiving 100 messages per second'),
    ('reception', facts(silent_s=7.0), summary(), ERROR, 'no message for 7 s'),
    ('reception', facts({'lost': 12}), summary(), WARN,
     '12 messages on /imu lost in the last 30 s: on the way, between publisher and node; ask for '
     'reliable delivery with qos_overrides'),
    ('timeline', facts(), summary(), OK, '1,000 samples at 100 Hz'),
    ('timeline', facts(), summary(mostly_motion=True), WARN,
     'the IMU was moving most of the time: let it rest'),
    ('timeline', facts(on_probation=True), summary(), OK,
     'looking whether the messages are of the IMU of the run'),
    ('timeline', facts(), summary(remarks=(finding('several_publishers'),)), WARN,
     'neighbouring messages differ in turn, as those of two sensors that publish with one '
     'frame_id do. -> give every IMU a topic of its own'),
    ('timeline', facts({'clock_jumps': 2, 'missing': 200, 'duplicates': 4, 'rejected': 1}),
     summary(remarks=(JUMPED,)), WARN,
     '200 samples missing, 4 duplicates, 1 message rejected, 2 jumps of the clock in the last '
     '30 s; the header clock jumped 2 times: no difference is taken across a jump'),
    ('timeline', facts(), summary(timeline=Timeline(
        100.0, 1000, 12.0, missing=200, duplicates=4, rejected=3), clock_jumps=2,
        remarks=(JUMPED,)), OK, '1,000 samples at 100 Hz'),
    ('estimation', facts(fit_error='broken'), summary(), ERROR, 'broken'),
    ('storage', facts(), summary(), OK, 'no state file: a crash or a reboot begins a new run'),
    ('storage', facts(save_error='No space left'), summary(), ERROR, 'No space left')])
def test_a_status_names_what_is_wrong(
        part: str, facts_: Facts, summary_: TimelineSummary, level: bytes, words: str) -> None:
    status = shown(part, facts_, summary_)
    assert (status.level, status.message, status.hardware_id) == (level, words, '/imu')


def test_the_coefficient_that_is_awaited_next_is_named_with_its_time(result: Result) -> None:
    for name, key, seconds in (('gyro_x', K, 5000.0), ('gyro_x', 'bias_instability', 900.0),
                               ('gyro_y', 'bias_instability', 1200.0)):
        result = with_coefficient(result, name, key, **UNSEEN, observable_in_s=seconds)
    assert waiting_for(result) == ('gyro_x', 'bias_instability', 900.0)
    status = shown('estimation', facts(), summary(), result)
    assert status.message == 'bias instability of gyro x expected to be observable in 15 min'
    assert entries(status)['next_observable_in_s'] == '900.0'
    assert entries(status)['observable/rate_random_walk'] == '1'
    assert entries(status)['observable/noise_density'] == '2'
