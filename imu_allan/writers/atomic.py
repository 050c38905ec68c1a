# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Atomic writing of files: a reader sees the old content or the new, never a mixture."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
import os
from pathlib import Path
import re
import secrets
import shutil
from tempfile import TemporaryFile

from imu_allan.errors import ImuAllanError, printable
from imu_allan.writers.supported_filters import CONSUMERS

CONFIGURATION = 'configuration of a filter'
"""Kind of the files that `imu_allan.writers.filters` writes."""
RESULT, VERDICTS, TUNING = (f'document imu_allan.{name}' for name in ('result', 'check', 'tuning'))
PAGE, CERTIFICATE, JUNIT, CURVES = 'page', 'certificate', 'JUnit report', 'table of curves'
PICTURES = {'png': 'PNG picture', 'svg': 'SVG picture', 'pdf': 'PDF'}
"""Kind of a picture by file name suffix."""
_KINDS = (
    (PICTURES['png'], rb'\x89PNG\r\n'),
    (PICTURES['pdf'], rb'%PDF-'),
    (PICTURES['svg'], rb'(?s)<\?xml .{,200}?<(?:!DOCTYPE )?svg'),
    (JUNIT, rb'(?s)<\?xml .{,100}?<testsuites'),
    (CERTIFICATE, rb'(?s)<!DOCTYPE html>.{,2000}?'
                  rb'<meta name="generator" content="imu_allan [^" ]* certificate"'),
    (PAGE, rb'(?s)<!DOCTYPE html>.{,2000}?<meta name="generator" content="imu_allan '),
    (CURVES, rb'axis,unit,tau_s,'),
    ('table of a fleet', rb'unit,serial,'),
    (CONFIGURATION, rb'(?s).{,16000}?, by imu_allan '))
"""Kinds of files that this package writes, and how they begin."""
Files = dict[str, Callable[[], bytes | None]]
"""What makes the content of each file by name; None leaves the file out."""
_BEGINNING = 1 << 14
"""Bytes at the start of a file by which its kind is recognized."""
_STANDARD = {'/dev/stdout': 1, '/dev/stderr': 2}
"""Descriptors of the streams that a process was given."""


def kind_of(beginning: bytes) -> str:
    """Return the kind of a file that this package wrote; empty for any other file."""
    if document := re.match(rb'\s*\{\s*"schema": "(imu_allan\.\w+)/', beginning):
        return f'document {document[1].decode()}'
    return next((kind for kind, mark in _KINDS if re.match(mark, beginning)), '')


def kinds_of_files(exports: Sequence[str] = ()) -> dict[str, str]:
    """Return the kinds of the files of `imu_allan.writers.result_files.save_folder` by name."""
    return {'result.json': RESULT, 'curve.csv': CURVES,
            **{CONSUMERS[consumer].file: CONFIGURATION for consumer in exports},
            'report.html': PAGE, 'allan_deviation.png': PICTURES['png']}


def require_replaceable(path: str | os.PathLike[str], kind: str) -> None:
    """
    Raise ImuAllanError if an existing file is of another kind, before any work is done.

    `kind` is one that `kind_of` returns. Links are followed, and empty files may be replaced.
    """
    # If the file cannot be read, the attempt to write reports the reason.
    with suppress(OSError):
        if not _is_stream(path):
            _require_kind(path, resolved(path), kind)


def require_replaceable_in(folder: str | os.PathLike[str], kinds: Mapping[str, str]) -> None:
    """
    Raise the errors that `write_files` would raise, before any work is done.

    `kinds` maps file names in the folder to their kinds. The folder need not exist.
    """
    for name, kind in kinds.items():
        _require_no_link(Path(folder) / name)
        require_replaceable(Path(folder) / name, kind)


def write_files(folder: str | os.PathLike[str], files: Files) -> list[Path]:
    """
    Make and write files into an output folder in turn; an error names all that are missing.

    The user named only the folder, so a link in place of a file is not followed.
    """
    paths: list[Path] = []
    for number, (name, made) in enumerate(files.items(), 1):
        data, path = made(), Path(folder) / name
        if data is None:
            continue
        try:
            _require_no_link(path)
            write_atomically(path, data)
            paths.append(path)
        except ImuAllanError as error:
            others = ', '.join(list(files)[number:])
            raise ImuAllanError(
                f'{error}{others and f"; not written either: {others}"}') from error
    return paths


def write_atomically(path: str | os.PathLike[str], data: bytes, *, private: bool = False) -> None:
    """
    Replace the content of `path` by `data`, completely or not at all.

    The data are first synced to disk under a temporary name in the same folder. The file is
    renamed last, so a crash or power failure leaves the old file. Missing folders are created, and
    the permissions of a replaced file are kept. Symbolic links are followed. A file of another
    kind than `data` is not replaced, since it may belong to the user. Anything but a regular file,
    such as ``/dev/stdout`` or a pipe, is written to and kept. With `private`, nobody else may read
    the file; otherwise the umask decides.
    """
    try:
        if _is_stream(path):
            # What is printed follows at the same position, if a file stands behind the stream.
            standard = _STANDARD.get(os.fspath(path))
            opened = path if standard is None else os.dup(standard)
            with open(opened, 'wb') as stream:  # noqa: PTH123
                stream.write(data)
        else:
            _replace(path, resolved(path), data, private)
    except BrokenPipeError:
        # The reader has seen enough, as may happen wherever something is printed.
        raise
    except OSError as error:
        raise ImuAllanError(
            f'{path}: cannot be written ({error.strerror or error}); '
            'choose a folder that exists on a disk with room and may be written to') from error


def resolved(path: str | os.PathLike[str]) -> Path:
    """
    Return the absolute path without symbolic links.

    Raises OSError for a link of another user in a folder like /tmp, where Linux forbids that
    (fs.protected_symlinks).
    """
    with suppress(FileNotFoundError):
        os.stat(path)  # noqa: PTH116
    return Path(os.path.realpath(path))


def require_writable(folder: str | os.PathLike[str]) -> None:
    """Raise ImuAllanError if a folder cannot be written in or made, before any work is done."""
    place = Path(folder).absolute()
    try:
        # Nothing is made yet, since the work may give nothing to write.
        while not os.path.lexists(place):
            place = place.parent
        with TemporaryFile(dir=place):
            pass
    except (OSError, ValueError) as error:
        raise ImuAllanError(f'{printable(folder)}: cannot be written '
                            f'({getattr(error, "strerror", None) or error}); choose a folder that '
                            'may be written to') from error


def _is_stream(path: str | os.PathLike[str]) -> bool:
    """Return whether `path` exists and is neither a regular file nor a folder."""
    given = Path(path)
    # Even if standard output leads to a file, more is printed to it.
    return os.fspath(path) in _STANDARD or (
        given.exists() and not given.is_file() and not given.is_dir())


def _replace(path: str | os.PathLike[str], target: Path, data: bytes, private: bool) -> None:
    if target.is_dir():
        raise IsADirectoryError(None, 'is a directory')
    exists = target.is_file()
    if exists and (kind := kind_of(data[:_BEGINNING])):
        _require_kind(path, target, kind)
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f'.{target.name[:100]}.{secrets.token_hex(4)}')
    # Let the system apply the umask, which a process cannot read without changing it.
    handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600 if private else 0o666)
    try:
        with os.fdopen(handle, 'wb') as file:
            if exists and not private:
                shutil.copymode(target, temporary)
            file.write(data)
            file.flush()
            os.fsync(handle)
        temporary.replace(target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    # Some network file systems cannot sync folders.
    with suppress(OSError):
        handle = os.open(target.parent, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _require_no_link(path: Path) -> None:
    if path.is_symlink():
        raise ImuAllanError(f'{printable(path)}: is a link, which is not followed in an output '
                            'folder; remove it')


def _require_kind(path: str | os.PathLike[str], target: Path, kind: str) -> None:
    """Refuse to replace a file of another kind."""
    with target.open('rb') as file:
        beginning = file.read(_BEGINNING)
    if beginning and kind_of(beginning) != kind:
        raise ImuAllanError(f'{printable(path)}: exists and is no {kind}, so it is not replaced; '
                            'name another file, or remove this one')
