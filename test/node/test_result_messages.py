# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

from collections.abc import Mapping
from dataclasses import replace
import json
import math
from typing import Any

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Vector3Stamped
from imu_allan.finding import finding
from imu_allan.node.characterization_node import queue_messages
from imu_allan.node.diagnostics import (
    diagnostics_message,
    Facts,
    reception_conditions,
    timeline_conditions,
    waiting_for,
)
from imu_allan.node.result_messages import result_messages
from imu_allan.noise.terms import AXES, TERMS
from imu_allan.result import (
    AxisResult,
    Coefficient,
    Curve,
    GoodnessOfFit,
    Result,
    Source,
    Span,
    Timeline,
    Tone,
    TurnOnBias,
)
from imu_allan.timeline import TimelineSummary
from imu_allan.writers.words import message_of, with_words
import numpy as np
import pytest
from ros_harness import facts, summary

STAMP = Time(sec=12, nanosec=34)


def axis_result(name: str, values: Mapping[str, float], octaves: int = 10,
                **fields: Any) -> AxisResult:
    """Build an axis whose terms are observable where `values` has them."""
    quantity = AXES[name]
    coefficients = {
        key: Coefficient(term.symbol, term.unit(quantity), True, values[key],
                         (values[key] * 0.9, values[key] * 1.1), None) if key in values else
        Coefficient(term.symbol, term.unit(quantity), False, None, None, 1e-7,
                    observable_in_s=waits.get(key))
        for waits in [fields.pop('waits', {})] for key, term in TERMS.items()}
    tau = tuple(0.01 * 2.0**i for i in range(octaves))
    adev = tuple(values.get('noise_density', 1.0) / math.sqrt(t) for t in tau)
    curve = Curve(tau, adev, tau, ((0, 1),) * octaves, ((0, 1),) * octaves, adev)
    settings: dict[str, Any] = {'mean': 0.1, 'band_limit_s': None, 'tones': (),
                                'goodness_of_fit': GoodnessOfFit(0.5, 0.01, True), **fields}
    return AxisResult(quantity.value, quantity.unit, coefficients=coefficients, curve=curve,
                      **settings)


def result_of(axes: Mapping[str, AxisResult]) -> Result:
    return Result('0', Source('topic', None, '/imu/data_raw', 'imu', None, 'header'),
                  Timeline(100.0, 1000, 10.0), axes)


def messages_of(axes: Mapping[str, AxisResult]) -> dict[str, Any]:
    return result_messages(result_of(axes), 'imu_allan', STAMP)


def status_of(name: str, axis: AxisResult) -> DiagnosticStatus:
    [status] = messages_of({name: axis})['coefficients'].status
    return status


def shown(part: str, facts_: Facts, summary_: TimelineSummary, result: Result | None = None
          ) -> DiagnosticStatus:
    """Give a status of ``/diagnostics``."""
    array = diagnostics_message('imu_allan', STAMP, [(facts_, summary_)], result)
    [status] = [one for one in array.status if one.name == f'imu_allan: {part}']
    return status


ALL = {'noise_density': 1e-3, 'rate_random_walk': 1e-5}


def entries(status: DiagnosticStatus) -> dict[str, str]:
    return {entry.key: entry.value for entry in status.values}


def test_the_values_of_an_axis_are_written_to_the_last_digit() -> None:
    value = 0.1 + 0.2
    found = entries(status_of('gyro_x', axis_result(
        'gyro_x', {'noise_density': value}, tones=(Tone(50.0, 1e-3),), band_limit_s=0.02)))
    assert float(found['noise_density/value']) == value
    assert found['noise_density/ci95_low'] == repr(value * 0.9)
    assert (found['tones/0/frequency_hz'], found['band_limit_s']) == ('50.0', '0.02')
    assert found['rate_random_walk/upper95'] == '1e-07'
    assert 'rate_random_walk/value' not in found


@pytest.mark.parametrize(('values', 'fields', 'level', 'words'), [
    (ALL, {}, DiagnosticStatus.OK, 'noise density and rate random walk are observable'),
    ({'noise_density': 1e-3}, {'waits': {'rate_random_walk': 7200.0}}, DiagnosticStatus.WARN,
     'rate random walk not observable yet, expected in 2 h'),
    ({'rate_random_walk': 1e-3}, {}, DiagnosticStatus.WARN, 'noise density not observable yet'),
    (ALL, {'goodness_of_fit': GoodnessOfFit(0.0, 0.4, False)}, DiagnosticStatus.WARN,
     'noise density and rate random walk are observable; no noise model fits this axis well')])
def test_the_level_of_an_axis_says_whether_a_filter_can_be_configured(
        values: Mapping[str, float], fields: dict[str, Any], level: bytes, words: str) -> None:
    status = status_of('accel_y', axis_result('accel_y', values, **dict(fields)))
    assert (status.level, status.message) == (level, words)


def test_an_axis_that_is_absent_is_nan_beside_the_others() -> None:
    messages = messages_of({'gyro_x': axis_result('gyro_x', ALL)})
    vector = messages['gyro/noise_density']
    assert vector.vector.x == 1e-3
    assert math.isnan(vector.vector.y)
    assert math.isnan(messages['accel/noise_density'].vector.z)
    assert (vector.header.stamp, vector.header.frame_id) == (STAMP, 'imu')
    curve = messages['gyro/allan_deviation']
    assert [(dim.label, dim.size, dim.stride) for dim in curve.layout.dim] == [
        ('tau,x,y,z', 4, 100), ('octave', 25, 25)]
    rows = np.array(curve.data).reshape(4, 25)
    assert np.isfinite(rows[:2, :10]).all()
    assert np.isnan(rows[2:]).all()
    assert np.isnan(messages['accel/allan_deviation'].data).all()


def test_the_interval_of_a_hidden_coefficient_reaches_from_zero_to_its_bound() -> None:
    axis = axis_result('gyro_x', {'noise_density': 1e-3})
    messages = messages_of({'gyro_x': axis})
    for term, ends in (('noise_density', axis.coefficients['noise_density'].ci95),
                       ('rate_random_walk', (0.0, axis.coefficients['rate_random_walk'].upper95))):
        vectors = [messages[f'gyro/{term}/interval/{end}'].vector for end in ('low', 'high')]
        assert tuple(vector.x for vector in vectors) == ends
        assert all(math.isnan(vector.y) for vector in vectors)


def test_remarks_of_the_fit_and_the_turn_on_bias_stand_with_their_axis() -> None:
    remark = replace(finding('deadband', ('gyro_x',), share=0.5, width=0.01, unit='rad/s'),
                     message='gyro_y: words that decide nothing')
    result = replace(result_of({name: axis_result(name, ALL) for name in ('gyro_x', 'gyro_y')}),
                     warnings=(remark,), turn_on_bias={'gyro_y': TurnOnBias(0.2, (0.1, 4.5))})
    x, y = result_messages(result, 'imu_allan', STAMP)['coefficients'].status
    words = ('50 % of the samples are exactly 0, and none lies between 0 and 0.01 rad/s: the '
             'driver gives small values as 0. -> no coefficient is given; switch the deadband '
             'off, then call ~/reset')
    assert entries(x)['remarks/deadband'] == words
    assert 'remarks/deadband' not in entries(y)
    assert [{key: value for key, value in entries(status).items() if 'turn_on' in key}
            for status in (x, y)] == [{}, {
                'turn_on_bias/value': '0.2', 'turn_on_bias/ci95_low': '0.1',
                'turn_on_bias/ci95_high': '4.5', 'turn_on_bias/unit': 'rad/s'}]
    status = shown('estimation', facts(), summary(), result)
    assert entries(status)['remarks/deadband'] == f'gyro x: {words}'


def test_the_estimation_tells_every_finding_in_the_order_of_the_result() -> None:
    found = [finding('gaps_not_listed', listed=1000, gaps=2000, gaps_s=200.0),
             *(finding('deadband', (f'gyro_{letter}',), share=0.5, width=0.01, unit='rad/s')
               for letter in 'xy'),
             finding('deadband', ('accel_x',), share=0.5, width=0.01, unit='m/s^2'),
             finding('frozen', messages=20, since_s=3.0)]
    result = with_words(replace(
        result_of({name: axis_result(name, ALL) for name in AXES}), warnings=tuple(found)))
    status = shown('estimation', facts(), summary(), result)
    said = [entry.key for entry in status.values if entry.key.startswith('remarks/')]
    assert [key.split('/')[1] for key in said] == [one.code for one in result.warnings]
    assert len(set(said)) == len(result.warnings)
    # Those to act upon come first, and make the message unless they may be over.
    assert [one.severity for one in result.warnings] == ['act'] * 3 + ['know']
    assert status.level == WARN
    assert status.message == '; '.join(
        message_of(one, live=True) for one in result.warnings if one.code == 'deadband')
    # What is good to know alone is no warning.
    mild = replace(result, warnings=result.warnings[3:])
    assert shown('estimation', facts(), summary(), mild).level == OK


def test_a_curve_of_more_octaves_keeps_its_longest_averaging_times() -> None:
    axis = axis_result('accel_x', ALL, octaves=28)
    rows = np.array(messages_of({'accel_x': axis})['accel/allan_deviation'].data).reshape(4, 25)
    np.testing.assert_array_equal(rows[0], axis.curve.tau_s[3:])
    np.testing.assert_array_equal(rows[1], axis.curve.adev[3:])


def test_a_result_without_axes_empties_every_topic() -> None:
    messages = messages_of({})
    assert json.loads(messages.pop('result').data)['axes'] == {}
    assert list(messages.pop('coefficients').status) == []
    vectors = [message for message in messages.values() if isinstance(message, Vector3Stamped)]
    assert (len(messages), len(vectors)) == (22, 20)
    assert all(math.isnan(vector.vector.x) for vector in vectors)


JUMPED = finding('clock_jumps', clock='header', count=2)
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


@pytest.mark.parametrize(('part', 'facts_', 'summary_', 'level', 'words'), [
    ('reception', facts(), summary(), OK, 'receiving 100 messages per second'),
    ('reception', facts(publishers=0), summary(), ERROR, 'nothing publishes /imu'),
    ('reception', facts(silent_s=7.0), summary(), ERROR, 'no message for 7 s'),
    ('reception', facts({'lost': 12}), summary(), WARN,
     '12 messages on /imu lost in the last 30 s: on the way, between publisher and node; ask for '
     'reliable delivery with qos_overrides'),
    ('reception', facts(lost=12, malformed=3), summary(), OK, 'receiving 100 messages per second'),
    ('timeline', facts(), summary(), OK, '1,000 samples at 100 Hz'),
    ('timeline', facts(), summary(moving=True), WARN,
     'the IMU moves: what it measures meanwhile is left out'),
    ('timeline', facts(), summary(mostly_motion=True), WARN,
     'the IMU was moving most of the time: let it rest'),
    ('timeline', facts(on_probation=True), summary(), OK,
     'looking whether the messages are of the IMU of the run'),
    ('timeline', facts(expected_rate=101.0), summary(), OK, '1,000 samples at 100 Hz'),
    ('timeline', facts(update_error='no clock'), summary(), ERROR, 'no clock'),
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
    ('estimation', facts(), summary(), OK, 'no result yet'),
    ('estimation', facts(fit_error='broken'), summary(), ERROR, 'broken'),
    ('storage', facts(), summary(), OK, 'no state file: a crash or a reboot begins a new run'),
    ('storage', facts(checkpoint_error='No space left'), summary(), ERROR, 'No space left'),
    ('storage', facts(save_error='No space left'), summary(), ERROR, 'No space left')])
def test_a_status_names_what_is_wrong(
        part: str, facts_: Facts, summary_: TimelineSummary, level: bytes, words: str) -> None:
    status = shown(part, facts_, summary_)
    assert (status.level, status.message, status.hardware_id) == (level, words, '/imu')


def test_of_all_that_is_wrong_the_worst_comes_first() -> None:
    bad = facts({'lost': 1, 'malformed': 1, 'missing': 1, 'rejected': 1, 'clock_jumps': 1},
                publishers=0, silent_s=7.0, namesakes=1, mixed=True, looping=True, paused=True,
                temperature_missing=True, update_error='no clock', expected_rate=200.0)
    moving = summary(moving=True, mostly_motion=True, remarks=(finding('several_publishers'),))
    assert [(one.name, one.level) for one in (
        *reception_conditions(bad), *reception_conditions(facts(publishers=2)),
        *timeline_conditions(bad, moving)) if one.present] == [
        ('namesakes', ERROR), ('mixed', ERROR), ('unpublished', ERROR), ('silent', ERROR),
        ('looping', WARN), ('malformed', WARN), ('lost', WARN), ('paused', WARN),
        ('thermometer', WARN), ('publishers', WARN), ('useless', ERROR), ('moving', WARN),
        ('mostly_motion', WARN), ('expected_rate', WARN), ('remarks', WARN), ('faults', WARN),
        ('jumped', WARN)]


def test_the_coefficient_that_is_awaited_next_is_named_with_its_time() -> None:
    result = result_of({
        'gyro_x': axis_result('gyro_x', {'noise_density': 1e-3},
                              waits={'rate_random_walk': 5000.0, 'bias_instability': 900.0}),
        'gyro_y': axis_result('gyro_y', ALL, waits={'bias_instability': 1200.0})})
    assert waiting_for(result) == ('gyro_x', 'bias_instability', 900.0)
    status = shown('estimation', facts(), summary(), result)
    assert status.message == 'bias instability of gyro x expected to be observable in 15 min'
    assert entries(status)['next_observable_in_s'] == '900.0'
    assert entries(status)['observable/rate_random_walk'] == '1'
    assert entries(status)['observable/noise_density'] == '2'


@pytest.mark.parametrize('rate_hz', [0.0, 100.0, 4000.0, 5000.0, 8000.0, 100_000.0])
def test_the_queue_holds_two_seconds_at_every_rate(rate_hz: float) -> None:
    assert queue_messages(rate_hz) >= max(2 * rate_hz, 10_000)


def test_gaps_are_counted_with_the_longest() -> None:
    seen = summary(timeline=Timeline(100.0, 1000, 20.0, missing=700, gaps=(Span(1.0, 2.0),)),
                   gaps=2, gaps_s=7.0, longest_gap_s=5.0)
    found = entries(shown('timeline', facts(), seen))
    assert (found['gaps'], found['longest_gap_s']) == ('2', '5.0')
