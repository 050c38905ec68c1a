# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""No verb writes over what it reads, or over a file that it did not write."""

import os
import shutil

import pytest

INPUT = 'is an input of this command, which would be overwritten; name another file'
OTHER = 'exists and is no {}, so it is not replaced; name another file, or remove this one'
RESULT = 'document imu_allan.result'
EMPTY = 'names no file; is a variable of the shell empty?'


@pytest.fixture
def folder(tmp_path, recording, result_file, monkeypatch):
    """Give a folder with a recording, a table, a result, a datasheet and links to the first."""
    [mcap] = recording.glob('*.mcap')
    shutil.copy(mcap, tmp_path / 'a.mcap')
    rows = ''.join(f'{i / 100},{i * 7919 % 101 / 1e4}\n' for i in range(3000))
    (tmp_path / 'a.csv').write_text(f'time_s,gyro_x\n{rows}')
    shutil.copy(tmp_path / 'a.csv', tmp_path / 'curve.csv')
    shutil.copy(tmp_path / 'a.csv', tmp_path / 'b.csv')
    shutil.copy(result_file, tmp_path / 'r.json')
    (tmp_path / 'spec.yaml').write_text('gyro: {noise_density: 0.05 deg/s/sqrt(Hz)}\n')
    (tmp_path / 'soft.json').symlink_to('a.mcap')
    os.link(tmp_path / 'r.json', tmp_path / 'hard.json')
    (tmp_path / 'index.html').write_text('<!DOCTYPE html><title>my page</title>')
    shutil.copytree(recording, tmp_path / 'bag')
    (tmp_path / 'planted').mkdir()
    (tmp_path / 'planted' / 'result.json').symlink_to(tmp_path / 'r.json')
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(('arguments', 'line'), [
    # As a shell makes it of: analyze --json *.csv
    (['analyze', '--json', 'a.csv', 'b.csv'], f'a.csv: {OTHER.format(RESULT)}'),
    (['analyze', 'a.mcap', '--json', './a.mcap'], f'--json ./a.mcap: {INPUT}'),
    (['analyze', 'a.mcap', '--json', 'soft.json'], f'--json soft.json: {INPUT}'),
    (['analyze', 'curve.csv', '--output', '.'], f'curve.csv: {OTHER.format("table of curves")}'),
    (['analyze', 'a.csv', '--output', 'planted'],
     'planted/result.json: is a link, which is not followed in an output folder; remove it'),
    (['check', 'a.csv', '--spec', 'spec.yaml', '--json', 'a.csv'], f'--json a.csv: {INPUT}'),
    (['check', 'r.json', '--spec', 'spec.yaml', '--json', 'hard.json'],
     f'--json hard.json: {INPUT}'),
    (['check', 'r.json', '--spec', 'spec.yaml', '--certificate', 'index.html'],
     f'index.html: {OTHER.format("certificate")}'),
    (['tune', 'r.json', '--json', 'r.json'], f'--json r.json: {INPUT}'),
    (['tune', 'r.json', '--verify', 'a.mcap', '--json', 'a.mcap'], f'--json a.mcap: {INPUT}'),
    (['export', 'r.json', '--for', 'kalibr', '--output', 'r.json'], f'--output r.json: {INPUT}'),
    (['export', 'r.json', '--for', 'kalibr', '--output', 'spec.yaml'],
     f'spec.yaml: {OTHER.format("configuration of a filter")}'),
    (['simulate', 'consumer_mems', '--output', ''], f"--output '': {EMPTY}"),
    (['info', ''], f"recording '': {EMPTY}"),
    (['analyze', 'a.csv', '--output', '-'], '--output -: standard output is no folder; name one'),
    *((['analyze', *given, '--output', output],
       f'--output: would write into {into}, which is a recording of this command; name another '
       'folder') for given, output, into in (
        (['bag'], './bag', 'bag'), (['bag', 'a.csv'], '.', 'bag'), (['.'], '.', '.'))),
])
def test_what_is_not_to_be_replaced_is_reported_and_stays(arguments, line, folder, fails_with):
    before = {path: path.read_bytes() for path in folder.rglob('*') if path.is_file()}
    # Before the work, of which something would be printed.
    assert fails_with(line, *arguments) == ''
    assert {path: path.read_bytes() for path in folder.rglob('*') if path.is_file()} == before


@pytest.mark.usefixtures('folder')
def test_every_output_is_written_again_over_its_own(output_of):
    for command in (
            'analyze a.mcap --json new.json --output out --for kalibr',
            'check new.json --spec spec.yaml --json c.json --junit c.xml --certificate c.html',
            'tune new.json --json t.json', 'export new.json --for kalibr --output out',
            'report new.json --output out --format png') * 2:
        output_of(*command.split())
