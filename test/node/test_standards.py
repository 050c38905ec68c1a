# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A running IMU against its datasheet and against an earlier result."""

from dataclasses import replace
from pathlib import Path

from imu_allan.characterization import Characterization
from imu_allan.node.run import Lane, Run
from imu_allan.node.standards import Finding, Looks, Standards
from imu_allan.result import Tone
from imu_allan.sensor.noise_model import parse_model
from imu_allan.sensor.simulated_imu import simulated_blocks
from imu_allan.writers.datasheet import live
from imu_allan.writers.result_file import save_result
import pytest
from ros_harness import characterized, Driver, Health, Ros
from whole_lines import Varying

MODEL = 'gyro: {noise_density: 1e-3 rad/s/sqrt(Hz)}'


def run_of(model: str, seed: int = 0) -> Characterization:
    return characterized(*simulated_blocks(parse_model(model), 100.0, 20_000, seed=seed))


def written(folder: Path, limit: str) -> str:
    path = folder / 'spec.yaml'
    path.write_text(f'gyro: {{noise_density: {limit} rad/s/sqrt(Hz)}}')
    return str(path)


def above(limit: str) -> str:
    return '; '.join(f'gyro_{letter} N: the 95 % interval is above {limit} rad/s/sqrt(Hz) '
                     '(measured <number>, <number> .. <number>)' for letter in 'xyz')


def test_a_verdict_is_reported_once_it_is_certain_and_a_limit_that_breaks_later_too(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    standards = Standards(spec_file=written(tmp_path, '1.3e-3'))
    run, looks, levels = characterized(), Looks(), []
    assert standards.judge(run.result(), run, looks) == [
        Finding('specification', 'warn', 'cannot tell yet: no axis has a result')]
    for block in simulated_blocks(parse_model(MODEL), 100.0, 3000, block_samples=300):
        run.update(block)
        [finding] = standards.judge(run.result(), run, looks)
        levels.append(finding.level)
    assert (levels, {*levels}) == (sorted(levels, reverse=True), {'warn', 'ok'})
    assert finding.message == Varying(
        'every limit of the specification is kept, certain after <words>')
    # It stays certain, whatever the next look would say, until the limit is broken.
    assert standards.judge(run.result(), run, looks) == [finding]
    noisy = run_of('gyro: {noise_density: 2e-3 rad/s/sqrt(Hz)}')
    # A look takes the fits that the result was made of.
    [result], fits = Run(Lane(noisy)).snapshot().fitted()
    monkeypatch.setattr(live, 'fit_axes', lambda *_: pytest.fail('fitted again'))
    assert standards.judge(result, noisy, looks, fits) == [
        Finding('specification', 'error', Varying(above('1.3e-3')))]


def test_the_same_imu_is_as_in_the_reference_and_a_departure_is_reported_with_figures(
        tmp_path: Path) -> None:
    save_result(run_of(MODEL).result(), tmp_path / 'before.json')
    standards = Standards(reference=str(tmp_path / 'before.json'))
    again = run_of(MODEL, seed=1)
    assert standards.judge(again.result(), again, Looks()) == [
        Finding('reference', 'ok', 'as in the reference: 3 axes')]
    shaken = run_of('gyro: {noise_density: 1e-3 rad/s/sqrt(Hz), x: {noise_density: '
                    '2e-3 rad/s/sqrt(Hz)}, y: {noise_density: 1e-3 rad/s/sqrt(Hz), '
                    'mean: 0.01 rad/s}}').result()
    axes = dict(shaken.axes)
    axes['gyro_z'] = replace(axes['gyro_z'], tones=(Tone(31.0, 1e-3),))
    assert standards.judge(replace(shaken, axes=axes), characterized(), Looks()) == [
        Finding('reference', 'warn', Varying(
            'gyro_x: noise density <number> rad/s/sqrt(Hz), <number> in the reference; gyro_y: '
            'bias <number> rad/s, <number> in the reference; gyro_z: a line at 31 Hz of 0.001 '
            'rad/s, none in the reference'))]


def test_a_specification_that_is_broken_stands_in_diagnostics_and_log(
        ros: Ros, health: Health) -> None:
    node = ros.start('imu_allan_node', {
        'publish_period': 0.5, 'spec_file': written(ros.folder, '1e-4')})
    driver = Driver(ros).wait_for_node()
    # Certain takes longer than likely.
    ros.until(lambda: driver.publish(500) or health.said(
        'specification', Varying(above('1e-4')), b'\2'))
    assert Varying(f'specification: {above("1e-4")}') in node.lines
