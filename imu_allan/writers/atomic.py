# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Atomic writing of files: a reader sees the old content or the new, never a mixture."""

from __future__ import annotations

from collections.abc import Callable, Mapping
import contextlib
import os
from pathlib import Path
import re
import secrets
import stat

from imu_allan.errors import ImuAllanError, printable
from imu_allan.writers.output_path import open_folder, resolved

CONFIGURATION = 'configuration of a filter'
"""Kind of the files that `imu_allan.writers.filters` writes."""
RESULT, VERDICTS, TUNING = (
    f'document imu_allan.{name}' for name in ('result', 'check', 'tuning'))
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
    ('table of coefficients in LaTeX', rb'(?s)% Needs .{,200}?imu_noise\.bib'),
    ('references in BibTeX', rb'@techreport\{ieee952,'),
    (CONFIGURATION, rb'(?s).{,16000}?, by imu_allan '))
"""Kinds of files that this package writes, and how they begin."""
Files = dict[str, Callable[[], bytes | None]]
"""What makes the content of each file by name; None leaves the file out."""
_BEGINNING = 1 << 14
"""Bytes at the start of a file by which its kind is recognized."""


def kind_of(beginning: bytes) -> str:
    """Return the kind of a file that this package wrote; empty for any other file."""
    if document := re.match(rb'\s*\{\s*"schema": "(imu_allan\.\w+)/', beginning):
        return f'document {document[1].decode()}'
    return next((kind for kind, mark in _KINDS if re.match(mark, beginning)), '')


def require_replaceable(path: str | os.PathLike[str], kind: str) -> None:
    """
    Raise ImuAllanError if an existing file is of another kind, before any work is done.

    `kind` is one that `kind_of` returns. Links are followed, and empty files may be replaced.
    """
    if _is_stream(path):
        return
    # If the file cannot be read, the attempt to write reports the reason.
    with contextlib.suppress(OSError):
        _require_kind(str(path), str(resolved(path)), kind)


def require_replaceable_in(folder: str | os.PathLike[str], kinds: Mapping[str, str]) -> None:
    """
    Raise the errors that `write_in` would raise, before any work is done.

    `kinds` maps file names in the folder to their kinds. The folder need not exist.
    """
    for name, kind in kinds.items():
        _require_no_link(Path(folder) / name)
        require_replaceable(Path(folder) / name, kind)


def write_in(folder: str | os.PathLike[str], name: str, data: bytes) -> Path:
    """
    Write a file into an output folder with `write_atomically`, and return its path.

    The user named only the folder, so a link in place of the file is not followed.
    """
    path = Path(folder) / name
    _require_no_link(path)
    write_atomically(path, data)
    return path


def write_files(folder: str | os.PathLike[str], files: Files) -> list[Path]:
    """Make and write files in turn with `write_in`; an error names all that are missing."""
    paths: list[Path] = []
    for number, (name, made) in enumerate(files.items(), 1):
        data = made()
        try:
            paths += [] if data is None else [write_in(folder, name, data)]
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
    the permissions of a replaced file are kept. Symbolic links are followed, except those of other
    users in folders that everybody may write to. A file of another kind than `data` is not
    replaced, since it may belong to the user. Anything but a regular file, such as ``/dev/stdout``
    or a pipe, is written to and kept. With `private`, nobody else may read the file; otherwise the
    umask decides.
    """
    try:
        if _is_stream(path):
            _write_through(path, data)
            return
        target = resolved(path)
        if os.name == 'posix':
            folder = open_folder(target.parent)
            try:
                _replace(path, target.name, data, private, folder)
                _sync(folder)
            finally:
                os.close(folder)
        else:
            target.parent.mkdir(parents=True, exist_ok=True)
            _replace(path, str(target), data, private)
    except OSError as error:
        raise ImuAllanError(
            f'{path}: cannot be written ({error.strerror or error}); '
            'choose a folder that exists on a disk with room and may be written to') from error


def _is_stream(path: str | os.PathLike[str]) -> bool:
    """Return whether `path` exists and is neither a regular file nor a folder."""
    if _descriptor(path) is not None:
        # Even if it leads to a file, others may be writing to it as well.
        return True
    try:
        mode = os.stat(path).st_mode  # noqa: PTH116
    except OSError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def _descriptor(path: str | os.PathLike[str]) -> int | None:
    """Return the file descriptor that a name such as ``/dev/stdout`` refers to, or None."""
    text = os.fspath(path)
    # A shell substitutes this for ``>(command)``.
    named = re.fullmatch(r'/(?:dev|proc/self)/fd/(\d{1,4})', text)
    return int(named[1]) if named else {'/dev/stdout': 1, '/dev/stderr': 2}.get(text)


def _write_through(path: str | os.PathLike[str], data: bytes) -> None:
    """Write to a device or a pipe that has a reader; refuse block devices."""
    descriptor = _descriptor(path)
    if descriptor is not None:
        handle = os.dup(descriptor)
    else:
        handle = os.open(path, os.O_WRONLY | os.O_NONBLOCK | os.O_NOCTTY)
        os.set_blocking(handle, True)
    with os.fdopen(handle, 'wb') as stream:
        if stat.S_ISBLK(os.fstat(handle).st_mode):
            raise OSError(None, 'is a disk, not a file')
        stream.write(data)


def _replace(path: str | os.PathLike[str], target: str, data: bytes, private: bool,
             folder: int | None = None) -> None:
    """Replace a file by `data`; its name is relative to `folder` if that is given."""
    before = None
    with contextlib.suppress(FileNotFoundError):
        before = os.stat(target, dir_fd=folder, follow_symlinks=False).st_mode
    if before is not None and stat.S_ISDIR(before):
        raise IsADirectoryError(None, 'is a directory')
    if before is not None and stat.S_ISREG(before) and (kind := kind_of(data[:_BEGINNING])):
        _require_kind(str(path), target, kind, folder)
    head, name = os.path.split(target)
    temporary = os.path.join(head, f'.{name[:100]}.{secrets.token_hex(4)}')  # noqa: PTH118
    # Let the system apply the umask, which a process cannot read without changing it.
    handle = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600 if private else 0o666,
                     dir_fd=folder)
    try:
        with os.fdopen(handle, 'wb') as file:
            if not private and before is not None and stat.S_ISREG(before):
                os.fchmod(handle, before & 0o777)
            file.write(data)
            file.flush()
            os.fsync(handle)
        os.replace(temporary, target, src_dir_fd=folder, dst_dir_fd=folder)
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary, dir_fd=folder)
        raise


def _require_no_link(path: Path) -> None:
    if path.is_symlink():
        raise ImuAllanError(f'{printable(path)}: is a link, which is not followed in an output '
                            'folder; remove it')


def _require_kind(path: str, name: str, kind: str, folder: int | None = None) -> None:
    """Refuse to replace a file of another kind; `name` is relative to `folder` if given."""
    with os.fdopen(os.open(name, os.O_RDONLY, dir_fd=folder), 'rb') as file:
        beginning = file.read(_BEGINNING)
    if beginning and kind_of(beginning) != kind:
        raise ImuAllanError(f'{printable(path)}: exists and is no {kind}, so it is not replaced; '
                            'name another file, or remove this one')


def _sync(folder: int) -> None:
    # Some network file systems cannot sync folders, nor can a folder opened with O_PATH.
    with contextlib.suppress(OSError):
        handle = os.open('.', os.O_RDONLY, dir_fd=folder)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
