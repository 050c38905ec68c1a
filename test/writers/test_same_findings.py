# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated faults: every front end shows the same findings in the same order, on one screen."""

from collections.abc import Iterable
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
from imu_allan.writers.words import advice, says, title_of, with_words
import numpy as np
import pytest
from repeated import slow
from rich.console import Console

SPEC = parse_model('gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}\n'
                   'accel: {noise_density: 200 ug/sqrt(Hz)}\n')


FAULTS: dict[str, tuple[str, str]] = {
    'none': ('pass', ''),
    'constant': ('x[:, 2] = 0.5', 'constant_axis'),
    'saturated': ('x[:, 0] = np.clip(x[:, 0], -1e-4, 1e-4)', 'saturated'),
    'deadband': ('x[np.abs(x[:, 1]) < 1e-3, 1] = 0', 'deadband'),
    'in_g': ('x[:, 3:] /= 9.80665', 'gravity'),
    'without_gravity': ('x[:, 5] -= 9.80665', 'gravity'),
    'raw_counts': ('x[:, :3] *= 1e5', 'implausible'),
    'moved': ('x[3000:4000] += np.sin(np.arange(1000) / 7)[:, None]', 'motion'),
    'driven': ('x[2000:10_000] += np.random.default_rng(1).standard_normal((8000, 6))',
               'rest_within_motion'),
    'turned_slowly': ('x[4000:6000, 1] += 0.02 * np.hanning(2000)', ''),
    'stepped': ('x[6000:, 1] += 5e-3', ''),
    'louder': ('x[7000:, :3] *= 2', ''),
    'warming': ('x[:, :3] += 2e-2 * np.exp(-n / 3000)', 'warm_up'),
    'cycling': ('x[:, 3:] += 0.05 * np.sin(2 * np.pi * n / 1500)', ''),
    'with_tone': ('x[:, 4] += 0.02 * np.sin(2 * np.pi * 0.173 * n[:, 0])', 'tones'),
    'copied': ('x[:, 1] = x[:, 0]', 'copied_axis'),
    'stood_still': ('x[5000:9000, 3] = x[5000, 3]', 'stood_still'),
    'froze': ('x[5000:7000] = x[5000]', 'frozen'),
    'began_late': ('x[:2000] = 0', 'late_start'),
    'polled_fast': ('x[1::2] = x[::2]', 'held_values'),
    'coarse': ('x[:, 3:] = np.round(x[:, 3:] / 0.05) * 0.05', 'coarse_resolution'),
    'smoothed': ('x[3:] = (x[3:] + x[2:-1] + x[1:-2] + x[:-3]) / 4', 'band_limited'),
    'bias_subtracted': (
        'for i in range(3): x[:, i] -= np.convolve(x[:, i], np.full(200, 1 / 200), "same")', ''),
    'in_turn': ('x[::2, :3] += 5e-3', 'alternating'),
    'with_outliers': ('x[[1000, 4000, 9000], 0] += 1', 'spikes'),
    'never_a_number': ('x[:, 4] = np.nan', 'axis_not_finite'),
    'absent_for_a_while': ('x[8000:, 2] = np.nan', 'axis_absent_in_part'),
    'lossy': ('kept &= np.random.default_rng(2).random(len(x)) > 0.2', 'many_missing'),
    'slower_later': ('for t in (header, receive): t[6000:] = t[6000] + 2 * (t[6000:] - t[6000])',
                     'rate_changed'),
    'jumped': ('header[6000:] -= int(3600e9)', 'clock_jumps'),
    'without_header_stamps': ('header[:] = 0', 'receive_clock'),
    'replayed': ('receive[:] = receive[0] + (receive - receive[0]) // 10', 'clock_speed')}
"""
What each does to samples `x`, stamps of both clocks, and which messages are `kept`; `n` counts.

With the code under which it is found, where it surely is.
"""
SEVERAL = ('stepped', 'louder', 'in_g', 'coarse', 'with_tone')
AT_ONCE = (
    ('none',), ('constant', 'saturated', 'deadband', 'coarse'),
    ('copied', 'stood_still', 'never_a_number'), ('in_g', 'froze', 'with_outliers', 'jumped'),
    ('raw_counts', 'without_gravity', 'began_late', 'lossy'), ('polled_fast', 'replayed'),
    ('smoothed', 'without_header_stamps'), ('in_turn', 'absent_for_a_while'),
    ('slower_later', 'with_tone'), ('warming', 'moved'), ('driven',), ('bias_subtracted',),
    SEVERAL)
"""Faults that leave each other to be found, for one record; but for the last, which do not."""


def recorded(faults: Iterable[str]) -> Result:
    """Two minutes of a simulated IMU at rest with some faults."""
    blocks = list(simulated_blocks(parse_model(
        'gyro: {noise_density: 0.3 deg/sqrt(h)}\naccel: {noise_density: 150 ug/sqrt(Hz)}'),
        100.0, 12_000, start_ns=10**18))
    x, header, receive = (np.concatenate([getattr(block, name) for block in blocks])
                          for name in ('samples', 'header_ns', 'receive_ns'))
    kept, n = np.ones(12_000, bool), np.arange(12_000)[:, None]
    x[:, 5] += 9.80665 - x[:, 5].mean()
    for fault in faults:
        exec(FAULTS[fault][0], {'np': np, 'x': x, 'header': header, 'receive': receive,
                                'kept': kept, 'n': n})
    imu = Characterization(kind='recording', path='rec', topic='/imu')
    for rows in np.array_split(np.flatnonzero(kept), len(blocks)):
        imu.update(ImuBlock(header[rows], receive[rows], x[rows], np.zeros((len(rows), 2), bool),
                            blocks[0].frame_id))
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


@pytest.mark.parametrize('faults', [*AT_ONCE, *(slow((fault,)) for fault in FAULTS)],
                         ids='-'.join)
def test_every_front_end_shows_the_same_findings_in_the_same_order_on_one_screen(faults):
    result = recorded(faults)
    if faults == SEVERAL:
        assert len(result.warnings) > 3
    else:
        assert {FAULTS[fault][1] for fault in faults} - {''} <= {
            one.code for one in result.warnings}
    assert_the_same_everywhere(result)
    lines = on_the_terminal(result).splitlines()
    assert len(lines) + 1 <= 24
    assert max(map(len, lines)) <= 80
    assert lines[0].startswith('Gyroscope: ')
    shown = ' '.join(' '.join(lines).split())
    for found in result.warnings:
        if found.severity == 'act':
            assert says(found) in shown
            assert advice(found) in shown
        elif faults != SEVERAL:
            assert title_of(found) in shown


@pytest.mark.skipif('IMU_ALLAN_DATA' not in os.environ, reason='IMU_ALLAN_DATA is not set')
@pytest.mark.parametrize('name', ['adis16405_imu2', 'adis16405_imu5', 'nested_imu_mcap'])
def test_every_front_end_shows_the_same_findings_of_a_real_recording(name):
    assert_the_same_everywhere(analyze(Path(os.environ['IMU_ALLAN_DATA'], name)))
