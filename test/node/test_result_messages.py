# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What is published, logged and reported of a run, and from when on a term is."""

from dataclasses import replace
import math

from builtin_interfaces.msg import Time
from characterized import streamed
from diagnostic_msgs.msg import DiagnosticStatus
from exact_results import only, UNSEEN, with_axes, with_coefficient
from imu_allan.characterization import axis_groups
from imu_allan.characterization.join_results import fitted
from imu_allan.finding import finding
from imu_allan.finding_messages import message_of, with_words
from imu_allan.node import diagnostics
from imu_allan.node.log import Log, LogOfChanges, progress_line
from imu_allan.node.output_topics import result_messages
from imu_allan.node.run import Lane, new_run, pack, Run, Setup, unpack
from imu_allan.node.shown_terms import ShownTerms
from imu_allan.node.standards import Comparison, DatasheetLooks, Standards
from imu_allan.node.storage import decode_state, encode_state
from imu_allan.result import (
    Coefficient,
    GoodnessOfFit,
    Span,
    TemperatureDependence,
    Timeline,
    Tone,
    Trend,
    TurnOnBias,
)
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
from imu_allan.timeline.memory import Counts
from imu_allan.timeline.motion import MotionSummary
from imu_allan.writers.result_files import save_result
import numpy as np
import pytest
from ros_harness import at_rest, entries, facts, summary
from whole_lines import Varying

STAMP = Time(sec=12, nanosec=34)
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
N, K = 'noise_density', 'rate_random_walk'
JUMPED = finding('clock_jumps', clock='header', count=2)
TIMES = [10.0 * number for number in range(1, 24)]
MODEL = 'gyro: {noise_density: 1e-3 rad/s/sqrt(Hz)}'


@pytest.fixture(scope='module')
def result():
    """Give two axes of white noise, on which nothing is awaited, and K shows on the second."""
    found = only(streamed([at_rest(3000)]).result(), 'gyro_')
    found = replace(found, axes={name: found.axes[name] for name in ('gyro_x', 'gyro_y')})
    for key in found.axes['gyro_x'].coefficients:
        found = with_coefficient(found, '', key, observable_in_s=None)
    return with_coefficient(found, 'gyro_y', K, observable=True, value=1e-5, ci95=(9e-6, 1.1e-5))


def shown(part, facts_, summary_, result=None):
    array = diagnostics.diagnostics_message('imu_allan', STAMP, [(facts_, summary_)], result)
    [status] = [one for one in array.status if one.name == f'imu_allan: {part}']
    return status


@pytest.mark.parametrize(('key', 'changes', 'level', 'words'), [
    (N, {}, OK, 'noise density and rate random walk are observable'),
    (K, {**UNSEEN, 'observable_in_s': 7200.0}, WARN,
     'rate random walk not observable yet, expected in 2 h'),
    (N, UNSEEN, WARN, 'noise density not observable yet')])
def test_the_level_of_an_axis_says_whether_a_filter_can_use_it(result, key, changes, level, words):
    changed = with_coefficient(only(result, 'gyro_y'), '', key, **changes)
    for fit, said, more in ((True, level, ''), (False, WARN, '; no noise model fits this axis '
                                                             'well')):
        fitted = with_axes(changed, goodness_of_fit=GoodnessOfFit(0.5, 0.01, fit))
        [status] = result_messages(fitted, 'imu_allan', STAMP)['coefficients'].status
        assert (status.level, status.message) == (said, words + more)


def test_an_accelerometer_on_a_topic_of_its_own_has_its_own_frame(result):
    for given, expected in (('accel_frame', 'accel_frame'), (None, result.source.frame_id)):
        messages = result_messages(result, 'imu_allan', STAMP, accel_frame_id=given)
        assert messages['gyro/noise_density'].header.frame_id == result.source.frame_id
        assert messages['accel/noise_density'].header.frame_id == expected


def test_an_absent_axis_is_nan_and_a_hidden_term_reaches_from_zero_to_its_bound(result):
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
        axis.curve, tau_s=tuple(2.0**np.arange(28)), adev=tuple(np.arange(28.0)),
        edf=(2.0,) * 28))
    rows = np.array(result_messages(longer, 'imu_allan', STAMP)['gyro/allan_deviation'].data)
    np.testing.assert_array_equal(rows[:50], [*2.0**np.arange(3, 28), *np.arange(3.0, 28)])


def test_findings_stand_with_their_axis_and_in_the_estimation_in_the_order_of_the_result(result):
    found = [finding('motion', count=2, excluded_s=200.0),
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
     '12 messages on /imu lost in the last 30 s: ask for reliable delivery and a queue for '
     '2.5 s of messages, with qos_overrides'),
    ('timeline', facts(), summary(), OK, '1,000 samples at 100 Hz'),
    ('timeline', facts(), summary(measured_rate_hz=None, timeline=Timeline(None, 1, 0.0)), OK,
     '1 sample'),
    ('timeline', facts(), summary(mostly_motion=True), WARN,
     'the IMU was moving most of the time: let it rest'),
    ('timeline', facts(on_probation=True), summary(), OK,
     'looking whether the messages are of the IMU of the run'),
    ('timeline', facts(), summary(remarks=(finding('several_publishers'),)), WARN,
     'neighbouring messages differ in turn: two sensors that publish with one frame_id, or a '
     'vibration at half the message rate. -> give every IMU a topic of its own'),
    # After a pause of 150 s more are missing than 30 s hold.
    ('timeline', facts({'clock_jumps': 2, 'missing': 15_003, 'duplicates': 4, 'rejected': 1}),
     summary(remarks=(JUMPED,)), WARN,
     'found in the last 30 s: 15,003 samples missing, 4 duplicates, 1 message rejected, 2 jumps '
     'of the clock; the header stamps jumped 2 times: no difference is taken across a jump'),
    ('timeline', facts(), summary(timeline=Timeline(
        100.0, 1000, 12.0, missing=200, duplicates=4, rejected=3),
        counts=Counts(clock_jumps=2), remarks=(JUMPED,)), OK, '1,000 samples at 100 Hz'),
    ('estimation', facts(errors={'fit': 'broken'}), summary(), ERROR, 'broken'),
    ('storage', facts(), summary(), OK, 'no state file: a crash or a reboot begins a new run'),
    ('storage', facts(errors={'save': 'No space left'}), summary(), ERROR, 'No space left')])
def test_a_status_names_what_is_wrong(part, facts_, summary_, level, words):
    status = shown(part, facts_, summary_)
    assert (status.level, status.message, status.hardware_id) == (level, words, '/imu')


def test_the_coefficient_that_is_awaited_next_is_named_with_its_time(result):
    for name, key, seconds in (('gyro_x', K, 5000.0), ('gyro_x', 'bias_instability', 900.0),
                               ('gyro_y', 'bias_instability', 1200.0)):
        result = with_coefficient(result, name, key, **UNSEEN, observable_in_s=seconds)
    assert diagnostics.waiting_for(result) == (900.0, 'gyro_x', 'bias_instability')
    status = shown('estimation', facts(), summary(), result)
    assert status.message == 'bias instability of gyro x expected to be observable in 15 min'
    assert entries(status)['next_observable_in_s'] == '900.0'
    assert entries(status)['observable/rate_random_walk'] == '1'
    assert entries(status)['observable/noise_density'] == '2'


def test_a_condition_is_reported_once_when_it_begins_and_once_when_it_is_over(heard):
    changes = LogOfChanges(Log(lambda: heard), '/imu')
    counts = {'malformed': 1, 'lost': 3, 'unusable': 1, 'clock_jumps': 1}
    bad = facts(counts, publishers=2, mixed=True, looping=True, expected_rate=200.0,
                malformed=1, lost=3)
    rejected = Timeline(100.0, 1000, 10.0, rejected=1)
    moving = summary(motion=MotionSummary(moving=True), counts=Counts(clock_jumps=1),
                     timeline=rejected)
    for now in range(100):
        changes.see_reception(bad)
        changes.see_timeline(now, bad, moving)
    begun = [one for one in (*diagnostics.reception_conditions(bad),
                             *diagnostics.timeline_conditions(bad, moving))
             if one.present and one.over is not None]
    assert len(begun) == 9
    first = "info first samples on /imu: frame_id 'imu', 100 Hz, header stamps"
    assert [line for line in heard.lines if line != first] == [
        f'warning {one.message}' for one in begun]
    assert heard.lines.count(first) == 1
    heard.lines.clear()
    good = facts(malformed=1, lost=3, expected_rate=100.0)
    for now in range(101, 200):
        changes.see_reception(good)
        changes.see_timeline(now, good, summary(timeline=rejected))
    assert heard.lines == [
        'info no message on /imu is passed over any more; call ~/reset if it is another IMU',
        'info one publisher is left on /imu',
        'info the messages on /imu are new again',
        'info every message on /imu can be decoded again; 1 message could not be in all',
        'info no message on /imu is lost any more; 3 were in all',
        'info the IMU is at rest again',
        'info the rate is the expected one again',
        'info no message is rejected any more; 1 was in all']


def test_progress_is_reported_every_minute_and_later_every_hour(heard):
    changes = LogOfChanges(Log(lambda: heard), '/imu')
    result = with_coefficient(only(streamed([at_rest(6000, seed=2)]).result(), 'gyro'), 'gyro_x',
                              'bias_instability', observable_in_s=60.0)
    changes.see_timeline(0.0, facts(), summary())
    heard.lines.clear()
    for second in range(2 * 3600 + 700):
        changes.see_progress(float(second), facts(), result)
    # At 1 to 10 minutes, then after an hour each.
    assert len(heard.lines) == 10 + 2
    shown = ('observable of 3 axes: noise density of 3; next: bias instability of gyro x in about '
             '60 s')
    assert heard.lines[0] == f'info 6,000 samples at 100 Hz in 60 s; {shown}'
    # What has come since the fit counts, with the motion in it.
    moved = Timeline(100.0, 9000, 90.0, motion=(Span(10.0, 20.0),))
    assert progress_line(result, moved) == (
        f'9,000 samples at 100 Hz in 90 s, 70 s of it at rest; {shown}')
    assert progress_line(replace(result, axes={}), result.timeline) == (
        '6,000 samples at 100 Hz in 60 s; observable of 0 axes: nothing yet')


def at(result, seconds, observable, wait_s=None, presence=None):
    """Give the result as that of another time, in which K of one axis shows or not."""
    axis = result.axes['gyro_x']
    walk = (Coefficient('K', 'u', True, 2.0, (1.0, 3.0), None, presence=presence) if observable
            else Coefficient('K', 'u', False, None, None, 4.0, observable_in_s=wait_s))
    return replace(
        result, timeline=replace(result.timeline, samples=round(100 * seconds),
                                 sample_rate_hz=100.0, duration_s=seconds),
        axes={'gyro_x': replace(axis, coefficients={**axis.coefficients, K: walk})})


def published(looks, fit):
    return looks.judged(fit).axes['gyro_x'].coefficients[K]


@pytest.mark.parametrize(('fits', 'shown', 'waits'), [
    # Of each fit: time, whether the term shows, when it is expected to, and how probable it is.
    # Not seen at 20 s; seen at 30 to 60, thrice as much; lost at 70, and back at 210.
    pytest.param([(time, time >= 30 and time != 70) for time in TIMES],
                 [False] * 5 + [True] + [False] * 14 + [True] * 3, {7: 3 * 70.0 - 80.0},
                 id='shown by every fit since a third of the record'),
    pytest.param([(3600.0, True)], [True], {}, id='the first look at a long record is one'),
    pytest.param([(time, True) for time in TIMES[:3]], [False, False, True], {},
                 id='that at a short one is the first of many'),
    # At 30 s the record is thrice as long, but only at 40 s it is probable; what is shown stays.
    pytest.param([(time, True, None, presence) for time, presence in zip(
        TIMES, (0.995, 0.98, 0.98, 0.995, 0.8), strict=False)],
        [False] * 3 + [True] * 2, {0: 20.0, 1: None, 2: None}, id='probable too'),
    pytest.param([(time, False, 2 * time) for time in TIMES], [False] * 23,
                 dict.fromkeys(range(23)), id='a wait that recedes is not said'),
    # At 30 s the record is thrice as long as at the first look.
    pytest.param([(time, False, 500 - time) for time in TIMES], [False] * 23,
                 {0: None, 1: None} | {at: 490.0 - 10 * at for at in range(2, 23)},
                 id='one that stands is')])
def test_of_repeated_looks_what_lasts_is_published(result, fits, shown, waits):
    looks = ShownTerms()
    found = [published(looks, at(result, *fit)) for fit in fits]
    assert [one.observable for one in found] == shown
    assert {at: found[at].observable_in_s for at in waits} == waits
    for (_, seen, *_), one in zip(fits, found, strict=True):
        if seen and not one.observable:
            assert (one.value, one.ci95, one.upper95) == (None, None, 3.0)


def test_of_repeated_looks_a_dependence_on_temperature_that_lasts_is_published(result):
    looks, heat = ShownTerms(), TemperatureDependence(1e-4, (5e-5, 2e-4), 20.0, 21.0)
    said = finding('temperature', ('gyro_x',), per_kelvin=1e-4, per_kelvin_low=5e-5,
                   per_kelvin_high=2e-4, unit='rad/s', lowest_c=20.0, highest_c=21.0, lag_s=None)
    for time, shown in ((10, False), (20, False), (30, True), (40, True), (50, None), (60, False),
                        (149, False), (150, True)):
        one = at(result, float(time), False)
        seen = shown is not None
        found = looks.judged(replace(one, warnings=(said,) if seen else (), axes={
            'gyro_x': replace(one.axes['gyro_x'], trend=Trend(temperature=heat if seen else None)
                              )}))
        assert (found.axes['gyro_x'].trend.temperature, found.warnings) == (
            (heat, (said,)) if shown else (None, ())), time


def test_what_one_look_finds_by_chance_is_not_said_unless_it_is_the_last(result):
    looks = ShownTerms()
    line, dead = finding('band_limited', ('gyro_x',), edge_hz=20.0), finding(
        'constant_axis', ('gyro_y',), value=0.1, unit='rad/s')
    warm = finding('thermometer', fault='constant')
    for time, found, more_comes, said in (
            (3, (line, dead, warm), True, (dead,)), (9, (line, dead), True, (line, dead)),
            (11, (dead,), True, (dead,)), (14, (line.of('accel_x'),), True, ()),
            (17, (line, warm), True, ()), (20, (line, warm), True, (line, warm)),
            (20, (line.of('gyro_z'),), False, (line.of('gyro_z'),))):
        one = replace(at(result, float(time), False), warnings=found)
        assert looks.judged(one, more_comes=more_comes).warnings == said, time


def test_a_look_after_a_restart_is_one_more_and_not_the_first(result):
    setup = Setup(('/imu',))
    run = new_run(setup)
    published(run.looks, at(result, 800.0, False))
    # As often as it is started anew: a run is one.
    for seconds, observable in ((900.0, False), (1000.0, False), (2800.0, True), (2900.0, True)):
        [run] = unpack(decode_state(encode_state(pack([run], setup))), setup)
        assert published(run.looks, at(result, seconds, seconds > 900)
                         ).observable == observable


def run_of(model, seed=0):
    return streamed(simulated_blocks(parse_model(model), 100.0, 20_000, seed=seed))


def written(folder, limit):
    path = folder / 'spec.yaml'
    path.write_text(f'gyro: {{noise_density: {limit} rad/s/sqrt(Hz)}}')
    return str(path)


def judged(standards, run, looks):
    result, record = run.fitted()
    return standards.judge(result, [record], looks)


def above(limit):
    return '; '.join(f'gyro_{letter} N: the 95 % interval is above {limit} rad/s/sqrt(Hz) '
                     '(measured <number>, <number> .. <number>)' for letter in 'xyz')


def test_a_verdict_is_reported_once_certain_and_a_limit_that_breaks_later(tmp_path, monkeypatch):
    standards = Standards(spec_file=written(tmp_path, '1.3e-3'))
    run, looks, levels = streamed([]), DatasheetLooks(), []
    assert judged(standards, run, looks) == [
        Comparison('specification', 'warn', 'cannot tell yet: no axis has a result')]
    for block in simulated_blocks(parse_model(MODEL), 100.0, 3000, block_samples=300):
        run.update(block)
        [finding] = judged(standards, run, looks)
        levels.append(finding.level)
    assert (levels, {*levels}) == (sorted(levels, reverse=True), {'warn', 'ok'})
    assert finding.message == Varying(
        'every limit of the specification is kept, certain after <words>')
    # It stays certain, whatever the next look would say, until the limit is broken.
    assert judged(standards, run, looks) == [finding]
    noisy = run_of('gyro: {noise_density: 1.8e-3 rad/s/sqrt(Hz)}')
    result, records = fitted(Run([Lane(noisy)]).snapshot())
    # A look takes the fits that the result was made of.
    monkeypatch.setattr(axis_groups, 'fit_axes', lambda *_: pytest.fail('fitted again'))
    assert standards.judge(result, records, looks) == [
        Comparison('specification', 'error', Varying(above('1.3e-3')))]


def test_the_same_imu_is_as_in_the_reference_and_a_departure_is_reported_with_figures(tmp_path):
    save_result(run_of(MODEL).result(), tmp_path / 'before.json')
    standards = Standards(reference=str(tmp_path / 'before.json'))
    again = run_of(MODEL, seed=1)
    assert judged(standards, again, DatasheetLooks()) == [
        Comparison('reference', 'ok', 'as in the reference: 3 axes')]
    shaken = run_of('gyro: {noise_density: 1e-3 rad/s/sqrt(Hz), x: {noise_density: '
                    '2e-3 rad/s/sqrt(Hz)}, y: {noise_density: 1e-3 rad/s/sqrt(Hz), '
                    'mean: 0.01 rad/s}}')
    assert judged(standards, shaken, DatasheetLooks()) == [
        Comparison('reference', 'warn', Varying(
            'gyro_x: noise density <number> rad/s/sqrt(Hz), <number> in the reference; gyro_y: '
            'bias <number> rad/s, <number> in the reference'))]
