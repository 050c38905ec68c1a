# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a file of this program is, and that nothing else is replaced."""
from dataclasses import replace
import json
import os
from pathlib import Path

from imu_allan.result import Result
from imu_allan.sensor.noise_model import parse_model
from imu_allan.writers.atomic import (
    CERTIFICATE,
    CONFIGURATION,
    JUNIT,
    kind_of,
    RESULT,
    TUNING,
    VERDICTS,
    write_atomically,
    write_in,
)
from imu_allan.writers.datasheet import certificate_html, check, to_json, to_junit
from imu_allan.writers.filters import CONSUMERS, export, ExportOptions
from imu_allan.writers.fleet import Fleet, save_fleet
from imu_allan.writers.folder import save_comparison, save_folder, save_latex, save_report
from imu_allan.writers.tuning_table import tuning_document
import pytest
from whole_lines import refused, unwritable


@pytest.mark.parametrize('consumer', CONSUMERS)
def test_every_configuration_is_known_by_its_beginning(consumer: str, result: Result) -> None:
    # Much is written above the numbers where much is to be said of them.
    options = ExportOptions() if consumer.startswith('state_space') else ExportOptions(
        inflate={'N': 2.0, 'K': 5.0})
    text = export(result, consumer, None, options).text
    assert kind_of(text.encode()[:1 << 14]) == CONFIGURATION


def test_every_document_and_page_is_known_by_its_beginning(result: Result) -> None:
    specification = parse_model('gyro: {noise_density: 1 deg/s/sqrt(Hz)}')
    verdicts = check(result, specification)
    texts = {RESULT: result.to_json(), VERDICTS: to_json(verdicts, result, specification),
             JUNIT: to_junit(verdicts, result, specification),
             CERTIFICATE: certificate_html(verdicts, result, specification),
             TUNING: json.dumps(tuning_document(result, 0.1, 60.0, 'random_walk'), indent=2)}
    assert {kind: kind_of(text.encode()) for kind, text in texts.items()} == {
        kind: kind for kind in texts}


def test_every_file_in_a_folder_is_replaced_by_its_own_kind_alone(tmp_path: Path, result: Result
                                                                  ) -> None:
    # One axis is drawn in a sixth of the time.
    result = replace(result, axes={'gyro_x': result.axes['gyro_x']}, warnings=())
    other = replace(result, source=replace(result.source, path='other'))
    for path in {*save_folder(result, tmp_path, ['kalibr']), *save_report(result, tmp_path),
                 *save_latex(result, tmp_path),
                 *save_comparison({'a': result, 'b': other}, tmp_path),
                 *save_fleet(Fleet({'a': result, 'b': other}), tmp_path)}:
        before = path.read_bytes()
        path.write_text('of the user')
        with refused(f'{path}: exists and is no {kind_of(before[:1 << 14])}, so it is not '
                     'replaced; name another file, or remove this one'):
            write_in(tmp_path, path.name, before)
        assert path.read_text() == 'of the user'
        path.write_bytes(before)
        write_in(tmp_path, path.name, before)


def test_a_failure_leaves_the_old_content_and_no_debris(tmp_path, monkeypatch):
    write_atomically(tmp_path / 'file', b'old')

    def full_disk(_handle):
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr(os, 'fsync', full_disk)
    with refused(unwritable(tmp_path / 'file', 'No space left on device')):
        write_atomically(tmp_path / 'file', b'new')
    assert [path.name for path in tmp_path.iterdir()] == ['file']
    assert (tmp_path / 'file').read_bytes() == b'old'


def test_permissions_are_those_of_the_file_before_or_of_the_umask(tmp_path):
    old = os.umask(0o027)
    try:
        write_atomically(tmp_path / 'new', b'')
    finally:
        os.umask(old)
    assert (tmp_path / 'new').stat().st_mode & 0o777 == 0o640
    (tmp_path / 'new').chmod(0o600)
    write_atomically(tmp_path / 'new', b'again')
    assert (tmp_path / 'new').stat().st_mode & 0o777 == 0o600
