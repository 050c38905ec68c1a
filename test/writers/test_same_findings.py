# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated faults: every front end shows the same findings in the same order, on one screen."""

from dataclasses import replace
import json
import re

from characterized import streamed
from imu_allan.datasheet import check
from imu_allan.finding_messages import advice, sentence_of, title_of, with_words
from imu_allan.node.output_topics import remark_values
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
from imu_allan.writers.datasheet import certificate_html
from imu_allan.writers.fleet import Fleet, fleet_html, fleet_json
from imu_allan.writers.key_figures import findings_line
from imu_allan.writers.report import report_html
import numpy as np
from on_terminal import printed
import pytest
from repeated import slow
from scipy.signal import lfilter

RATE_HZ = 100.0
SPEC = parse_model('gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}\n'
                   'accel: {noise_density: 200 ug/sqrt(Hz)}\n')


def lossy(block):
    return block.part(np.random.default_rng(2).random(len(block)) > 0.2)


def slower_later(block):
    for stamps in (block.header_ns, block.receive_ns):
        stamps[6000:] += stamps[6000:] - stamps[6000]


def jumped(block):
    block.header_ns[6000:] -= int(3600e9)


def replayed(block):
    block.receive_ns[:] -= (block.receive_ns - block.receive_ns[0]) * 9 // 10


def samples(rows, columns, become):
    """Give a fault in some rows and columns of the samples: a number, or what becomes of them."""
    def fault(block):
        x = block.samples
        x[rows, columns] = become(x[rows, columns]) if callable(become) else become
    return fault


ALL, GYRO, ACCEL = slice(None), slice(0, 3), slice(3, 6)
NUMBER = np.arange(12_000.0)[:, None]

FAULTS = {
    'constant': (samples(ALL, 2, 0.5), 'constant_axis'),
    'saturated': (samples(ALL, 0, lambda x: np.clip(x, -1e-4, 1e-4)), 'saturated'),
    'deadband': (samples(ALL, 1, lambda x: np.where(np.abs(x) < 1e-3, 0.0, x)), 'deadband'),
    'in g': (samples(ALL, ACCEL, lambda x: x / 9.80665), 'gravity'),
    'raw counts': (samples(ALL, GYRO, lambda x: x * 1e5), 'implausible'),
    'moved': (samples(slice(3000, 4000), ALL, lambda x: x + np.sin(NUMBER[:1000] / 7)), 'motion'),
    'driven': (samples(slice(2000, 10_000), ALL, lambda x: x + np.random.default_rng(
        1).standard_normal(x.shape)), 'rest_within_motion'),
    'stepped': (samples(slice(6000, None), 1, lambda x: x + 5e-3), None),
    'louder': (samples(slice(7000, None), GYRO, lambda x: x * 2.0), None),
    'warming': (samples(ALL, GYRO, lambda x: x + 2e-2 * np.exp(-NUMBER / 3000)), 'warm_up'),
    'with a tone': (samples(ALL, [4], lambda x: x + 0.02 * np.sin(
        2 * np.pi * 17.3 / RATE_HZ * NUMBER)), 'tones'),
    'stood still': (samples(slice(5000, 9000), 3, lambda x: x[0]), 'stood_still'),
    'coarse': (samples(ALL, ACCEL, lambda x: np.round(x / 0.05) * 0.05), 'coarse_resolution'),
    'smoothed': (samples(slice(3, None), ALL, lambda x: lfilter([0.25] * 4, 1, x, axis=0)),
                 'band_limited'),
    'with outliers': (samples([1000, 4000, 9000], 0, lambda x: x + 1.0), 'spikes'),
    'never a number': (samples(ALL, 4, np.nan), 'axis_not_finite'),
    'absent for a while': (samples(slice(8000, None), 2, np.nan), 'field_absent'),
    'lossy': (lossy, 'many_missing'), 'slower later': (slower_later, 'rate_changed'),
    'jumped': (jumped, 'clock_jumps'),
    'replayed': (replayed, 'clock_speed')}
"""With the code under which each is found, where it surely is."""

SEVERAL = ('stepped', 'louder', 'in g', 'coarse', 'with a tone')
AT_ONCE = (
    (), ('constant', 'saturated', 'deadband', 'coarse'),
    ('stood still', 'never a number'), ('in g', 'with outliers', 'jumped'),
    ('raw counts', 'lossy'), ('smoothed', 'replayed'), ('slower later', 'with a tone'),
    ('warming', 'moved'), ('driven', 'absent for a while'), SEVERAL)
"""Faults that leave each other to be found, for one record."""


def recorded(faults):
    """Two minutes of a simulated IMU at rest with some faults."""
    [block] = simulated_blocks(parse_model(
        'gyro: {noise_density: 0.3 deg/sqrt(h)}\naccel: {noise_density: 150 ug/sqrt(Hz)}'),
        RATE_HZ, 12_000, start_ns=10**18, block_samples=12_000)
    block = replace(block, receive_ns=block.header_ns.copy())
    block.samples[:, 5] += 9.80665 - block.samples[:, 5].mean()
    for fault in faults:
        block = FAULTS[fault][0](block) or block
    return with_words(streamed([block], 'rec').result())


@pytest.mark.parametrize('faults', [*AT_ONCE, *(slow((fault,)) for fault in FAULTS)],
                         ids=', '.join)
def test_every_front_end_shows_the_same_findings_in_the_same_order_on_one_screen(faults):
    result = recorded(faults)
    codes = [found.code for found in result.warnings]
    if faults == SEVERAL:
        assert len(codes) > 3
    else:
        assert {code for fault in faults if (code := FAULTS[fault][1])} <= {*codes}
    titles = [title_of(found) for found in result.warnings]
    assert [found['code'] for found in json.loads(result.to_json())['warnings']] == codes
    line = findings_line(result)
    assert line.split(': ')[0] == f'{len(codes)} finding{"" if len(codes) == 1 else "s"}' or (
        not codes and not line)
    begins = [one.partition(': ')[0] for one in printed(result, verbose=True).splitlines()]
    assert [begin for begin in begins if begin in titles] == titles
    page = report_html(result)
    assert re.findall(r'<dt class="(?:act|know)">([^<]*)</dt>', page) == titles
    fleet = Fleet({'a': result})
    assert json.loads(fleet_json(fleet))['units'][0]['findings'] == codes
    for document in (page, fleet_html(fleet), certificate_html(check(result, SPEC), result, SPEC)):
        assert line in document
    # /diagnostics and the log of the node.
    assert [key.split('/')[1] for key in remark_values(result.warnings)] == codes
    good_to_know = len({title_of(found) for found in result.warnings if found.severity == 'know'})
    screen = printed(result)
    said = re.search(r'Good to know(?: \((\d+)\)|: (\d+) findings)', screen)
    assert (int(said[1] or said[2]) if said else 0) == good_to_know
    lines = screen.splitlines()
    assert len(lines) + 1 <= 24
    assert max(map(len, lines)) <= 80
    assert lines[0].startswith('Gyroscope: ')
    shown = ' '.join(' '.join(lines).split())
    for found in result.warnings:
        if found.severity == 'act':
            assert sentence_of(found) in shown
            assert advice(found) in shown
        elif faults != SEVERAL:
            assert title_of(found) in shown
