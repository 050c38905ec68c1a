# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Simulated faults: every front end shows the same findings in the same order, on one screen."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
import io
import json
import re

from imu_allan.characterization.stream import Characterization
from imu_allan.result import Result
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
from imu_allan.writers.datasheet import certificate_html, check
from imu_allan.writers.fleet import Fleet
from imu_allan.writers.fleet.folder import fleet_json
from imu_allan.writers.fleet.page import fleet_html
from imu_allan.writers.report import report_html
from imu_allan.writers.table import print_result
from imu_allan.writers.verdict import findings_line
from imu_allan.writers.words import title_of, with_words
import numpy as np
import pytest
from rich.console import Console

RATE_HZ = 100.0
SPEC = parse_model('gyro: {noise_density: 0.03 deg/s/sqrt(Hz)}\n'
                   'accel: {noise_density: 200 ug/sqrt(Hz)}\n')


def constant(x: np.ndarray) -> None:
    x[:, 2] = 0.5


def saturated(x: np.ndarray) -> None:
    x[:, 0] = np.clip(x[:, 0], -1e-4, 1e-4)


def in_g(x: np.ndarray) -> None:
    x[:, 3:] /= 9.80665


def moved(x: np.ndarray) -> None:
    x[3000:4000] += np.sin(np.arange(1000) / 7)[:, None]


def stepped(x: np.ndarray) -> None:
    x[6000:, 1] += 5e-3


def louder(x: np.ndarray) -> None:
    x[7000:, :3] *= 2.0


def warming(x: np.ndarray) -> None:
    x[:, :3] += 2e-2 * np.exp(-np.arange(len(x))[:, None] / 3000)


def with_tone(x: np.ndarray) -> None:
    x[:, 4] += 0.02 * np.sin(2 * np.pi * 17.3 / RATE_HZ * np.arange(len(x)))


def copied(x: np.ndarray) -> None:
    x[:, 1] = x[:, 0]


def stood_still(x: np.ndarray) -> None:
    x[5000:9000, 3] = x[5000, 3]


def coarse(x: np.ndarray) -> None:
    x[:, 3:] = np.round(x[:, 3:] / 0.05) * 0.05


def several(x: np.ndarray) -> None:
    for fault in (stepped, louder, in_g, coarse, with_tone):
        fault(x)


def none(x: np.ndarray) -> None:
    pass


FAULTS: tuple[Callable[[np.ndarray], None], ...] = (
    none, constant, saturated, in_g, moved, stepped, louder, warming, with_tone, copied,
    stood_still, coarse, several)


@cache
def recorded(fault: Callable[[np.ndarray], None]) -> Result:
    """Two minutes of a simulated IMU at rest with a fault in its samples."""
    blocks = list(simulated_blocks(parse_model(
        'gyro: {noise_density: 0.3 deg/sqrt(h)}\naccel: {noise_density: 150 ug/sqrt(Hz)}'),
        RATE_HZ, 12_000, start_ns=10**18))
    samples = np.concatenate([block.samples for block in blocks])
    samples[:, 5] += 9.80665 - samples[:, 5].mean()
    fault(samples)
    ends = np.cumsum([len(block) for block in blocks])
    parts = np.split(samples, ends[:-1])
    imu = Characterization(kind='recording', path='rec', topic='/imu')
    for block, part in zip(blocks, parts, strict=True):
        imu.update(replace(block, samples=part))
    imu.finish()
    return with_words(imu.result())


def on_the_terminal(result: Result, *, verbose: bool = False) -> str:
    out = io.StringIO()
    print_result(result, Console(file=out, width=80), verbose=verbose)
    return out.getvalue()


@pytest.mark.parametrize('fault', FAULTS)
def test_every_front_end_shows_the_same_findings_in_the_same_order(fault):
    result = recorded(fault)
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


def test_the_faults_are_found():
    found = {fault.__name__: {one.code for one in recorded(fault).warnings} for fault in FAULTS}
    for fault, code in (('constant', 'constant_axis'), ('saturated', 'saturated'),
                        ('in_g', 'gravity'), ('copied', 'copied_axis'),
                        ('stood_still', 'stood_still'), ('coarse', 'coarse_resolution')):
        assert code in found[fault], (fault, found[fault])
    assert len(found['several']) > 3


@pytest.mark.parametrize('fault', FAULTS)
def test_the_first_screen_has_at_most_24_lines_with_the_one_how_to_save(fault):
    result = recorded(fault)
    lines = on_the_terminal(result).splitlines()
    assert len(lines) + 1 <= 24
    assert max(map(len, lines)) <= 80
    assert lines[0].startswith('Gyroscope: ')
    shown = ' '.join(' '.join(lines).split())
    for found in result.warnings:
        if found.code != 'motion':
            assert title_of(found) in shown
