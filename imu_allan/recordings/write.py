# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Writing of Imu samples as a rosbag2 directory, block by block in constant memory."""

from collections.abc import Iterable
from pathlib import Path
import shutil
import sqlite3
from typing import get_args, Literal

from imu_allan.block import ImuBlock
from imu_allan.cdr import encode_imu_rows, IMU_TYPE
from imu_allan.errors import error_about, ImuAllanError, printable
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores

Storage = Literal['mcap', 'sqlite3']
Compression = Literal['', 'zstd']


def write_recording(
    path: Path | str, blocks: Iterable[ImuBlock], *, topic: str = '/imu/data_raw',
    storage: Storage = 'mcap', compression: Compression = 'zstd',
) -> Path:
    """
    Write a rosbag2 directory.

    The directory appears under its name only when complete; an exception or Ctrl-C leaves nothing.

    Parameters
    ----------
    path : path-like
        The directory to create.
    blocks : iterable of ImuBlock
        Messages to write.
    topic : str
        Topic name of the messages.
    storage : {'mcap', 'sqlite3'}
        Storage format.
    compression : {'', 'zstd'}
        Compression of MCAP chunks.

    Returns
    -------
    Path
        The directory.

    Raises
    ------
    ImuAllanError
        If `path` exists already, or cannot be created or written, for example because the disk is
        full.

    """
    path = Path(path)
    if path.exists() or path.is_symlink():
        raise error_about(path, 'exists already; choose another name or remove it')
    if storage not in get_args(Storage):
        raise ImuAllanError(
            f'storage {printable(storage)}: not one of {", ".join(get_args(Storage))}')
    if storage == 'sqlite3' and set('?#%') & set(str(path)):
        # The library would take them for parts of a URI.
        raise error_about(path, 'choose a name without ?, # and %')
    unfinished = path.with_name(f'.{path.name}.unfinished')
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        shutil.rmtree(unfinished, ignore_errors=True)
        unfinished.mkdir()
    except OSError as error:
        raise error_about(path, f'cannot be created ({error.strerror}: '
                          f'{printable(error.filename)}); choose a folder that may be written '
                          'to') from error
    try:
        # The library names the file after the directory.
        writer = Writer(unfinished / path.name, version=9,
                        storage_plugin=StoragePlugin[storage.upper()])
        if storage == 'mcap' and compression:
            writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            _write(writer, blocks, topic)
        (unfinished / path.name).rename(path)
    except (OSError, sqlite3.OperationalError) as error:
        raise error_about(path, 'cannot be written '
                          f'({getattr(error, "strerror", None) or error}); choose a folder on a '
                          'disk with more room') from error
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)
    return path


def _write(writer: Writer, blocks: Iterable[ImuBlock], topic: str) -> None:
    """Write messages, encoding some thousand at a time."""
    connection = writer.add_connection(topic, IMU_TYPE, typestore=get_typestore(Stores.ROS2_JAZZY))
    for block in blocks:
        for start in range(0, len(block), 1 << 14):
            part = block.part(slice(start, start + (1 << 14)))
            for stamp, row in zip(part.receive_ns.tolist(), encode_imu_rows(part), strict=True):
                writer.write(connection, stamp, row.tobytes())
