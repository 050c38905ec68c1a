# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Files compressed as a whole that expand to more than any recording."""

import itertools
import os
from pathlib import Path
import sys
import tempfile

from imu_allan.recordings import open_recording
from imu_allan.recordings.formats.temporary_folder import make_folder, remove_folder
import pytest
from whole_lines import refused
import zstandard


@pytest.mark.parametrize('declared', [True, False])
def test_a_file_that_fills_the_disk_is_refused_and_leaves_nothing(
        tmp_path, monkeypatch, declared):
    path = tmp_path / 'a.db3.zstd'
    plain = 1 << 30
    compressor = zstandard.ZstdCompressor().compressobj(size=plain if declared else -1)
    path.write_bytes(b''.join(compressor.compress(bytes(1 << 22)) for _ in range(plain >> 22))
                     + compressor.flush())
    assert path.stat().st_size < 200_000
    temporary = tmp_path / 'temporary'
    temporary.mkdir()
    monkeypatch.setattr('tempfile.tempdir', str(temporary))
    with refused(f'{path}: expands to more than 1000 times its size, as no recording of an IMU '
                 'does; if it is one, unpack it with: zstd -d'):
        open_recording(path)
    assert list(temporary.iterdir()) == []


def test_an_end_while_a_temporary_folder_goes_away_leaves_nothing_of_it(
        tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path))
    folder = make_folder()
    for number in range(100):
        (folder / str(number)).touch()
    unlink, calls = os.unlink, itertools.count()

    def unlink_once_ended(*args: object, **options: object) -> None:
        unlink(*args, **options)
        if next(calls) == 50:
            sys.exit(1)

    monkeypatch.setattr(os, 'unlink', unlink_once_ended)
    with pytest.raises(SystemExit):
        remove_folder(folder)
    assert list(tmp_path.iterdir()) == []
