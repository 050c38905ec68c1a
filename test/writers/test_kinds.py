# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a file of this program is, and that nothing else is replaced."""
from dataclasses import replace
import json
from pathlib import Path

from imu_allan.result import Result
from imu_allan.sensor.noise_model import parse_model
from imu_allan.writers.atomic import (
    CERTIFICATE,
    CONFIGURATION,
    JUNIT,
    kind_of,
    PICTURES,
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
from whole_lines import refused


@pytest.mark.parametrize('consumer', CONSUMERS)
def test_every_configuration_is_known_by_its_beginning(consumer: str, result: Result) -> None:
    # Much is written above the numbers where much is to be said of them.
    model = consumer.startswith('state_space')
    for options in (ExportOptions(), *(() if model else (
            ExportOptions(as_measured=True), ExportOptions(inflate={'N': 2.0, 'K': 5.0})))):
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


def test_what_is_empty_is_replaced(tmp_path: Path, result: Result) -> None:
    (tmp_path / 'from_mktemp').touch()
    write_atomically(tmp_path / 'from_mktemp', result.to_json().encode())
    assert (tmp_path / 'from_mktemp').read_text() == result.to_json()


def test_a_recording_is_none_of_the_kinds() -> None:
    for beginning in (b'\x89MCAP0\r\n', b'SQLite format 3\0', b'#ROSBAG V2.0\n', b'ULog\x01\x12',
                      b'\xa3\x95\x80', b'time_s,gyro_x\n', b'name: My IMU\ngyro: {}\n', b'{}'):
        assert kind_of(beginning) == ''
        assert beginning not in PICTURES.values()
