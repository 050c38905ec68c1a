# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Opening a recording by its content, whatever its name."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from importlib import import_module
from pathlib import Path
import re

from imu_allan.errors import error_about, ImuAllanError, printable
from imu_allan.recordings.messages.definitions import definition_files
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import BAG_SUFFIXES, Recording, unreadable_error
from imu_allan.wording import natural

_RESULTS = ('result.json', 'fleet.json')


def open_recording(
    path: Path | str, *, rate_hz: float | None = None,
    options: RecordingOptions = RecordingOptions(),  # noqa: B008
) -> Recording:
    """
    Open a recording of any kind.

    Parameters
    ----------
    path : path-like
        A rosbag2 directory, a .mcap or .db3 file (also compressed as a whole with zstd), a ROS 1
        .bag, a PX4 .ulg, an ArduPilot .bin, a CSV file, or a folder with one CSV file per sensor.
    rate_hz : float, optional
        Sample rate in Hz of a CSV file without a time column.
    options : RecordingOptions, optional
        Further options of the user.

    Returns
    -------
    Recording
        The recording, to be used as a context manager.

    Raises
    ------
    ImuAllanError
        If the file is missing, empty, a git-LFS pointer, or not a recording.

    """
    path = Path(path)
    if rate_hz is not None:
        options = replace(options, rate_hz=rate_hz)
    try:
        definition_files(options.definitions)
        if path.is_dir():
            for name in _RESULTS:
                if (path / name).is_file() and not holds_recording(path):
                    raise _result_given(path, path / name)
            found = recordings_in(path, options)
            if path not in found:
                if len(found) > 1:
                    raise error_about(path, f'holds {len(found)} recordings, such as '
                                      f'{printable(found[0].name)}; name one')
                return open_recording(found[0], options=options)
            from imu_allan.recordings.formats.table_folder import TableFolder, tables_in
            if not holds_recording(path) and tables_in(path):
                return TableFolder(path, options)
            from imu_allan.recordings.formats.bag_directory import BagDirectory
            return BagDirectory(path, open_recording, options)
        return open_stored(path, path, options)
    except OSError as error:
        raise unreadable_error(path, error) from error
    except ValueError as error:
        if isinstance(error, ImuAllanError):
            raise
        # The path contains a null byte.
        raise error_about(path, printable(error)) from error


def _result_given(given: Path, file: Path) -> ImuAllanError:
    what = ('go on with imu_allan report, tune, export or check and the result.json in one of its '
            'folders' if file.name == 'fleet.json' else
            f'go on with imu_allan report, tune, export or check {printable(file)}')
    return error_about(given, f'a result of imu_allan analyze, not a recording; {what}')


def _is_split(files: Sequence[Path]) -> bool:
    """Return whether names differ in their numbers alone, and one begins where another ends."""
    names = {re.sub(r'(_\d+)?\.(mcap|db3)(\.zstd)?$', '', file.name) for file in files}
    if len(names) > 1:
        return False
    ends: list[int] = []
    # Of compressed files the names decide: to see a time, all of them would be unpacked.
    for file in files[:2] if files[0].suffix != '.zstd' else ():
        with suppress(ImuAllanError), open_recording(file) as part:
            ends += part.ends_ns
    if len(ends) < 4 or 0 in ends:
        # An empty file, or one of a recorder that was killed, has no times. Parts begin with 0.
        return files[0].name.startswith(f'{names.pop()}_0.')
    return -1e8 < ends[2] - ends[1] < 5e9


def recordings_in(
    path: Path | str, options: RecordingOptions = RecordingOptions(),  # noqa: B008
) -> list[Path]:
    """
    List the recordings in a folder, in natural order of their names (2 before 10).

    Parameters
    ----------
    path : path-like
        A recording, or a folder of recordings: rosbag2 directories, bare files that are not parts
        of one, ``.bag``, ``.ulg`` or ``.bin`` files, or CSV files with both sensors.
    options : RecordingOptions, optional
        Names and units of the columns of CSV files.

    Returns
    -------
    list of Path
        The recordings; `path` itself if it is not a folder of recordings.

    """
    folder = Path(path)
    try:
        if not folder.is_dir() or (folder / 'metadata.yaml').is_file():
            return [folder]
        found = [item for item in folder.iterdir() if not item.name.startswith('.') and (
            _is_bag(item) or bool(_of_tables(item, options)) if item.is_dir() else
            item.suffix.lower() in ('.bag', '.ulg', '.bin'))]
        if _is_bag(folder):
            from imu_allan.recordings.formats.bag_directory import recorded_files
            files = recorded_files(folder)
            found += [folder] if len(files) < 2 or _is_split(files) else files
        found += _of_tables(folder, options, beside=bool(found))
    except (OSError, ValueError):
        # The error is reported when the path is opened.
        return [folder]
    return sorted(found, key=lambda item: natural(item.name)) or [folder]


def _of_tables(folder: Path, options: RecordingOptions, *, beside: bool = False) -> list[Path]:
    """
    List the CSV recordings of a folder: files with both sensors, or the folder if it is a pair.

    `beside` others, a file with one sensor is a recording, too.
    """
    from imu_allan.recordings.formats.table_folder import TableFolder, tables_in
    tables = tables_in(folder)
    if not tables or any((folder / name).is_file() for name in _RESULTS):
        return []
    if not holds_recording(folder):
        with suppress(ImuAllanError):
            return TableFolder(folder, options).alone or [folder]
    return [table for table in tables if _has_axes(table, options)] if beside else []


def _has_axes(table: Path, options: RecordingOptions) -> bool:
    """Return whether a CSV file may have columns of an IMU; its errors are reported later."""
    from imu_allan.recordings.formats.csv_header import NamesNoAxis
    try:
        with open_recording(table, options=options):
            return True
    except NamesNoAxis:
        return False
    except ImuAllanError:
        return True


def holds_recording(folder: Path) -> bool:
    """Return whether a folder is a rosbag2 directory, even without metadata, or has ROS 1 bags."""
    return folder.is_dir() and (_is_bag(folder) or any(folder.glob('*.bag')))


def _is_bag(folder: Path) -> bool:
    return (folder / 'metadata.yaml').is_file() or any(
        item.name.endswith(BAG_SUFFIXES) for item in folder.iterdir())


def _head(path: Path, stored: Path) -> bytes:
    """Read the first bytes of a file; raise ImuAllanError if it cannot hold a recording."""
    if not stored.exists():
        raise error_about(path, 'no such file or directory')
    if not stored.is_file():
        raise error_about(path, 'not a file')
    with stored.open('rb') as file:
        # Long enough for the longest signature, the 40 bytes of git-LFS.
        head = file.read(64)
    if not head:
        raise error_about(path, 'the file is empty')
    for first_bytes, what in (
            (b'version https://git-lfs.github.com/spec/',
             'a git-LFS pointer, not the recording itself; fetch it with: git lfs pull'),
            ((b'\xff\xfe', b'\xfe\xff'),
             'text in UTF-16, as a redirection of PowerShell writes it; save it as UTF-8'),
            ((b'\x1f\x8b', b'PK\x03\x04'),
             'compressed with gzip or zip; take the recording out of it')):
        if head.startswith(first_bytes):
            raise error_about(path, what)
    return head


def open_stored(path: Path, stored: Path, options: RecordingOptions) -> Recording:
    """Open a file by its first bytes; `stored` is the unpacked file if `path` is compressed."""
    head = _head(path, stored)
    if stored == path and head.startswith(b'\x28\xb5\x2f\xfd'):
        from imu_allan.recordings.formats.decompress import open_compressed
        return open_compressed(path, open_stored, options)
    for first_bytes, module, name in (
            (b'\x89MCAP', 'mcap_file', 'McapRecording'),
            (b'SQLite format 3\0', 'sqlite_file', 'SqliteRecording'),
            (b'#ROSBAG V', 'ros1_bag', 'Ros1Recording'),
            (b'ULog\x01\x12\x35', 'autopilot_log', 'UlogRecording'),
            (b'\xa3\x95\x80', 'autopilot_log', 'ArduPilotRecording')):
        if head.startswith(first_bytes):
            if options.columns:
                raise error_about(path, '--columns is for CSV files; --gyro and --accel name the '
                                  'fields of messages')
            # The libraries of a format are imported only if it is read.
            kind = getattr(import_module(f'imu_allan.recordings.formats.{module}'), name)
            recording: Recording = kind(path, stored, options)
            return recording
    if head.startswith(b'{') and b'"schema": "imu_allan.' in head:
        raise _result_given(path, path)
    if path.suffix.lower() in ('.csv', '.txt') or (head.isascii() and any(
            separator in head for separator in (b',', b';', b'\t'))):
        from imu_allan.recordings.formats.csv_file import CsvRecording
        return CsvRecording(path, stored, options)
    if path.name == 'metadata.yaml':
        raise error_about(path, 'describes the recording in its folder; name the folder')
    raise error_about(path, 'neither a rosbag2 directory nor a .mcap, .db3, ROS 1 .bag, PX4 .ulg, '
                      'ArduPilot .bin or CSV file')
