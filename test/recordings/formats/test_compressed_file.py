# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Files compressed as a whole that expand to more than any recording."""

import itertools
import os
from pathlib import Path
import shutil
import subprocess
import sys
import tempfile

from bags import block, IMU
from imu_allan.cdr import encode_imu_rows
from imu_allan.errors import ImuAllanError
from imu_allan.recordings import open_recording
from imu_allan.recordings.formats.temporary_folder import make_folder, remove_folder
from mcap.writer import Writer
import pytest
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
    with pytest.raises(ImuAllanError) as error:
        open_recording(path)
    assert str(error.value) == (
        f'{path}: expands to more than 1000 times its size, as no recording of an IMU does; if it '
        'is one, unpack it with: zstd -d')
    assert list(temporary.iterdir()) == []


def packed(path: Path, padding: int) -> int:
    """Write a recording with so many bytes attached, compressed as a whole; returns its bytes."""
    plain = path.with_suffix('')
    messages = block(500)
    with plain.open('wb') as file:
        writer = Writer(file)
        writer.start('ros2')
        imu = writer.register_channel(
            '/imu', 'cdr', writer.register_schema(IMU, 'ros2msg', b'float64 x'))
        for row, stamp in zip(encode_imu_rows(messages), messages.receive_ns.tolist(),
                              strict=True):
            writer.add_message(imu, stamp, row.tobytes(), stamp)
        writer.add_attachment(0, 0, 'padding', 'application/octet-stream', bytes(padding))
        writer.finish()
    content = plain.read_bytes()
    path.write_bytes(zstandard.compress(content))
    plain.unlink()
    return len(content)


def info(path: Path, temporary: Path) -> str:
    """Run the command with this temporary folder; returns what it prints."""
    done = subprocess.run(
        [sys.executable, '-m', 'imu_allan', 'info', str(path), '--no-progress'],
        env={**os.environ, 'TMPDIR': str(temporary)}, capture_output=True, text=True, timeout=120,
        check=True)
    assert done.stderr == ''
    assert list(temporary.iterdir()) == []
    return done.stdout


def is_in_memory(folder: str) -> bool:
    with Path('/proc/mounts').open(encoding='utf-8') as file:
        return any(line.split()[1:3] == [folder, 'tmpfs'] for line in file)


@pytest.mark.skipif(
    sys.platform != 'linux' or not is_in_memory('/dev/shm')
    or shutil.disk_usage('/dev/shm').free < 1 << 29,
    reason='/dev/shm is no folder in memory with half a gigabyte of room')
def test_a_large_recording_that_is_unpacked_to_memory_is_told_once(tmp_path):
    path = tmp_path / 'a.mcap.zstd'
    size = packed(path, 1 << 26)
    with tempfile.TemporaryDirectory(dir='/dev/shm', prefix='two words ') as folder:
        told = (f'warning: {path}: its {size:,} bytes were unpacked to {folder}, which is in '
                'memory; name a folder on a disk with TMPDIR')
        assert [line for line in info(path, Path(folder)).splitlines()
                if 'TMPDIR' in line] == [told]
        packed(path, 1000)
        assert 'TMPDIR' not in info(path, Path(folder))


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
