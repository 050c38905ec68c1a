# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated faults: every front end shows the same findings in the same order, on one screen."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
import io
import json
import os
from pathlib import Path
import re

from imu_allan import analyze
from imu_allan.block import ImuBlock
from imu_allan.characterization.stream import Characterization
from imu_allan.node.result_messages import remark_values
from imu_allan.result import Result
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
from imu_allan.writers.datasheet import certificate_html, check
from imu_allan.writers.fleet import Fleet
from imu_allan.writers.fleet.written import fleet_html, fleet_json
from imu_allan.writers.report import report_html
from imu_allan.writers.table import print_result
from imu_allan.writers.verdict import findings_line
from imu_allan.writers.words import advice, sentence_of, title_of, with_words
import numpy as np
import pytest
from repeated import slow
from rich.console import Console

RATE_HZ = 100.0
SPEC = parse_model('gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}\n'
                   'accel: {noise_density: 200 ug/sqrt(Hz)}\n')


@dataclass
class Messages:
    """What a fault changes: samples, both stamps, and which messages arrive."""

    x: np.ndarray
    header_ns: np.ndarray
    receive_ns: np.ndarray
    kept: np.ndarray


def none(m: Messages) -> None:
    pass


def constant(m: Messages) -> None:
    m.x[:, 2] = 0.5


def saturated(m: Messages) -> None:
    m.x[:, 0] = np.clip(m.x[:, 0], -1e-4, 1e-4)


def deadband(m: Messages) -> None:
    m.x[:, 1][np.abs(m.x[:, 1]) < 1e-3] = 0.0


def in_g(m: Messages) -> None:
    m.x[:, 3:] /= 9.80665


def without_gravity(m: Messages) -> None:
    m.x[:, 5] -= 9.80665


def raw_counts(m: Messages) -> None:
    m.x[:, :3] *= 1e5


def moved(m: Messages) -> None:
    m.x[3000:4000] += np.sin(np.arange(1000) / 7)[:, None]


def driven(m: Messages) -> None:
    m.x[2000:10_000] += np.random.default_rng(1).standard_normal((8000, 6))


def turned_slowly(m: Messages) -> None:
    m.x[4000:6000, 1] += 0.02 * np.hanning(2000)


def stepped(m: Messages) -> None:
    m.x[6000:, 1] += 5e-3


def louder(m: Messages) -> None:
    m.x[7000:, :3] *= 2.0


def warming(m: Messages) -> None:
    m.x[:, :3] += 2e-2 * np.exp(-np.arange(len(m.x))[:, None] / 3000)


def cycling(m: Messages) -> None:
    m.x[:, 3:] += 0.05 * np.sin(2 * np.pi * np.arange(len(m.x))[:, None] / 1500)


def with_tone(m: Messages) -> None:
    m.x[:, 4] += 0.02 * np.sin(2 * np.pi * 17.3 / RATE_HZ * np.arange(len(m.x)))


def copied(m: Messages) -> None:
    m.x[:, 1] = m.x[:, 0]


def stood_still(m: Messages) -> None:
    m.x[5000:9000, 3] = m.x[5000, 3]


def froze(m: Messages) -> None:
    m.x[5000:7000] = m.x[5000]


def began_late(m: Messages) -> None:
    m.x[:2000] = 0.0


def polled_fast(m: Messages) -> None:
    m.x[1::2] = m.x[::2]


def coarse(m: Messages) -> None:
    m.x[:, 3:] = np.round(m.x[:, 3:] / 0.05) * 0.05


def smoothed(m: Messages) -> None:
    m.x[3:] = (m.x[3:] + m.x[2:-1] + m.x[1:-2] + m.x[:-3]) / 4


def bias_subtracted(m: Messages) -> None:
    for i in range(3):
        m.x[:, i] -= np.convolve(m.x[:, i], np.full(200, 1 / 200), 'same')


def in_turn(m: Messages) -> None:
    m.x[::2, :3] += 5e-3


def with_outliers(m: Messages) -> None:
    m.x[[1000, 4000, 9000], 0] += 1.0


def never_a_number(m: Messages) -> None:
    m.x[:, 4] = np.nan


def absent_for_a_while(m: Messages) -> None:
    m.x[8000:, 2] = np.nan


def lossy(m: Messages) -> None:
    m.kept &= np.random.default_rng(2).random(len(m.x)) > 0.2


def slower_later(m: Messages) -> None:
    for stamps in (m.header_ns, m.receive_ns):
        stamps[6000:] = stamps[6000] + 2 * (stamps[6000:] - stamps[6000])


def jumped(m: Messages) -> None:
    m.header_ns[6000:] -= int(3600e9)


def without_header_stamps(m: Messages) -> None:
    m.header_ns[:] = 0


def replayed(m: Messages) -> None:
    m.receive_ns[:] = m.receive_ns[0] + (m.receive_ns - m.receive_ns[0]) // 10


def several(m: Messages) -> None:
    for fault in (stepped, louder, in_g, coarse, with_tone):
        fault(m)


FAULTS: dict[Callable[[Messages], None], str | None] = {
    none: None, constant: 'constant_axis', saturated: 'saturated', deadband: 'deadband',
    in_g: 'gravity', without_gravity: 'gravity', raw_counts: 'implausible', moved: 'motion',
    driven: 'rest_within_motion', turned_slowly: None, stepped: None, louder: None,
    warming: 'warm_up', cycling: None, with_tone: 'tones', copied: 'copied_axis',
    stood_still: 'stood_still', froze: 'frozen', began_late: 'late_start',
    polled_fast: 'held_values', coarse: 'coarse_resolution', smoothed: 'band_limited',
    bias_subtracted: None, in_turn: 'alternating', with_outliers: 'spikes',
    never_a_number: 'axis_not_finite', absent_for_a_while: 'axis_absent_in_part',
    lossy: 'many_missing', slower_later: 'rate_changed', jumped: 'clock_jumps',
    without_header_stamps: 'receive_clock', replayed: 'clock_speed', several: None}
"""With the code under which each is found, where it surely is."""

AT_ONCE = (
    (none,), (constant, saturated, deadband, coarse), (copied, stood_still, never_a_number),
    (in_g, froze, with_outliers, jumped), (raw_counts, without_gravity, began_late, lossy),
    (polled_fast, replayed), (smoothed, without_header_stamps), (in_turn, absent_for_a_while),
    (slower_later, with_tone), (warming, moved), (driven,), (bias_subtracted,), (several,))
"""Faults that leave each other to be found, for one record."""


def recorded(faults: Iterable[Callable[[Messages], None]]) -> Result:
    """Two minutes of a simulated IMU at rest with some faults."""
    blocks = list(simulated_blocks(parse_model(
        'gyro: {noise_density: 0.3 deg/sqrt(h)}\naccel: {noise_density: 150 ug/sqrt(Hz)}'),
        RATE_HZ, 12_000, start_ns=10**18))
    m = Messages(*(np.concatenate([getattr(block, name) for block in blocks])
                   for name in ('samples', 'header_ns', 'receive_ns')), np.ones(12_000, bool))
    m.x[:, 5] += 9.80665 - m.x[:, 5].mean()
    for fault in faults:
        fault(m)
    imu = Characterization(kind='recording', path='rec', topic='/imu')
    for rows in np.array_split(np.flatnonzero(m.kept), len(blocks)):
        imu.update(ImuBlock(m.header_ns[rows], m.receive_ns[rows], m.x[rows],
                            np.zeros((len(rows), 2), bool), blocks[0].frame_id))
    imu.finish()
    return with_words(imu.result())


def on_the_terminal(result: Result, *, verbose: bool = False) -> str:
    out = io.StringIO()
    print_result(result, Console(file=out, width=80), verbose=verbose)
    return out.getvalue()


def assert_the_same_everywhere(result: Result) -> None:
    codes = [found.code for found in result.warnings]
    titles = [title_of(found) for found in result.warnings]
    assert [found['code'] for found in json.loads(result.to_json())['warnings']] == codes
    line = findings_line(result)
    assert line.split(': ')[0] == f'{len(codes)} finding{"" if len(codes) == 1 else "s"}' or (
        not codes and not line)
    begins = [one for one in on_the_terminal(result, verbose=True).splitlines()
              if one.partition(': ')[0] in titles]
    assert [one.partition(': ')[0] for one in begins] == titles
    page = report_html(result)
    assert re.findall(r'<dt class="(?:act|know)">([^<]*)</dt>', page) == titles
    fleet = Fleet({'a': result})
    assert json.loads(fleet_json(fleet))['units'][0]['findings'] == codes
    for document in (page, fleet_html(fleet), certificate_html(check(result, SPEC), result, SPEC)):
        assert line in document
    # /diagnostics and the log of the node.
    assert [key.split('/')[1] for key in remark_values(result.warnings)] == codes
    good_to_know = sum(found.severity == 'know' for found in result.warnings)
    said = re.search(r'Good to know(?: \((\d+)\)|: (\d+) findings)', on_the_terminal(result))
    assert (int(said[1] or said[2]) if said else 0) == good_to_know


@pytest.mark.parametrize('faults', [*AT_ONCE, *(slow((fault,)) for fault in FAULTS)])
def test_every_front_end_shows_the_same_findings_in_the_same_order_on_one_screen(faults):
    result = recorded(faults)
    assert {FAULTS[fault] for fault in faults} - {None} <= {one.code for one in result.warnings}
    if several in faults:
        assert len(result.warnings) > 3
    assert_the_same_everywhere(result)
    lines = on_the_terminal(result).splitlines()
    assert len(lines) + 1 <= 24
    assert max(map(len, lines)) <= 80
    assert lines[0].startswith('Gyroscope: ')
    shown = ' '.join(' '.join(lines).split())
    for found in result.warnings:
        if found.severity == 'act':
            assert sentence_of(found) in shown
            assert advice(found) in shown
        elif several not in faults:
            assert title_of(found) in shown


@pytest.mark.skipif('IMU_ALLAN_DATA' not in os.environ, reason='IMU_ALLAN_DATA is not set')
@pytest.mark.parametrize(('name', 'topic'), [
    ('adis16405_imu2', None), ('adis16405_imu5', None), ('nested_imu_mcap', None),
    ('plotjuggler_v2_constant_imu/rosbag2_test', None),
    ('robot_localization_test1_2imu_xsens', '/my_odometry2imu/imu_data')])
def test_every_front_end_shows_the_same_findings_of_a_real_recording(name, topic):
    assert_the_same_everywhere(analyze(Path(os.environ['IMU_ALLAN_DATA'], name), topic=topic))
