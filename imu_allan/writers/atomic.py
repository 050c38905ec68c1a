# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Writing a file so that a reader sees the old content or the new, never a part."""

from __future__ import annotations

from collections.abc import Mapping
import contextlib
import os
from pathlib import Path
import re
import secrets
import stat

from imu_allan.errors import ImuAllanError, printable
from imu_allan.writers.output_path import followed, open_folder

CONFIGURATION = 'configuration of a filter'
"""The kind of what `imu_allan.writers.filters` writes."""
RESULT, VERDICTS, TUNING = (
    f'document imu_allan.{name}' for name in ('result', 'check', 'tuning'))
PAGE, JUNIT, CURVES = 'page', 'JUnit report', 'table of curves'
PICTURES = {'png': 'PNG picture', 'svg': 'SVG picture', 'pdf': 'PDF'}
"""The kind of a picture by the ending of its name."""
_KINDS = (
    (PICTURES['png'], rb'\x89PNG\r\n'),
    (PICTURES['pdf'], rb'%PDF-'),
    (PICTURES['svg'], rb'(?s)<\?xml .{,200}?<(?:!DOCTYPE )?svg'),
    (JUNIT, rb'(?s)<\?xml .{,100}?<testsuites'),
    (PAGE, rb'(?s)<!DOCTYPE html>.{,2000}?<meta name="generator" content="imu_allan '),
    (CURVES, rb'axis,unit,tau_s,'),
    ('table of a fleet', rb'unit,serial,'),
    ('table of coefficients in LaTeX', rb'(?s)% Needs .{,200}?imu_noise\.bib'),
    ('references in BibTeX', rb'@techreport\{ieee952,'),
    (CONFIGURATION, rb'(?s).{,16000}?, by imu_allan '))
"""What this program writes, and how it begins."""
_BEGINNING = 1 << 14
"""Bytes by which a file is known."""


def kind_of(beginning: bytes) -> str:
    """Return what a file of this program is; empty for any other."""
    if document := re.match(rb'\s*\{\s*"schema": "(imu_allan\.\w+)/', beginning):
        return f'document {document[1].decode()}'
    return next((kind for kind, mark in _KINDS if re.match(mark, beginning)), '')


def require_replaceable(path: str | os.PathLike[str], kind: str) -> None:
    """
    Refuse a file that is there and is of another kind, before the work for it begins.

    `kind` is as `kind_of` says it; links are followed, and what is empty may be replaced.
    """
    if _is_stream(path):
        return
    # What cannot be looked at is reported by the attempt to write.
    with contextlib.suppress(OSError):
        _require_kind(str(path), str(followed(path)), kind)


def require_replaceable_in(folder: str | os.PathLike[str], kinds: Mapping[str, str]) -> None:
    """
    Refuse what `write_in` would refuse, before the work for it begins.

    `kinds` are by the name of the file in the folder, which need not be there.
    """
    for name, kind in kinds.items():
        _require_no_link(Path(folder) / name)
        require_replaceable(Path(folder) / name, kind)


def write_in(folder: str | os.PathLike[str], name: str, data: bytes) -> Path:
    """
    Write a file into an output folder, as `write_atomically`, and return its path.

    Who gave the folder did not name the file: a link in its place is not followed.
    """
    path = Path(folder) / name
    _require_no_link(path)
    write_atomically(path, data)
    return path


def write_atomically(path: str | os.PathLike[str], data: bytes, *, private: bool = False) -> None:
    """
    Replace the content of `path` by `data`, all of it or nothing.

    The bytes reach the disk under another name in the same folder before the name changes hands,
    so that a crash or a power cut leaves the old file. Folders that are missing are made; a
    symbolic link is followed, but for one that somebody else put into a folder that everybody may
    write to; the permissions of a file that is replaced are kept. A file of another kind than
    `data` is not replaced, for it may be the user's. What is no regular file, such as
    ``/dev/stdout`` or a pipe, is written to and stays what it is. With `private` nobody else may
    read the file; otherwise that is for the umask to say.
    """
    try:
        if _is_stream(path):
            _write_through(path, data)
            return
        target = followed(path)
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
    """Whether `path` is there and is neither a regular file nor a folder."""
    if _descriptor(path) is not None:
        # Even where it leads to a file, others write to that as well.
        return True
    try:
        mode = os.stat(path).st_mode  # noqa: PTH116
    except OSError:
        return False
    return not (stat.S_ISREG(mode) or stat.S_ISDIR(mode))


def _descriptor(path: str | os.PathLike[str]) -> int | None:
    """Return what this process has open under the name, such as its standard output."""
    text = os.fspath(path)
    # What a shell puts in the place of ``>(command)``.
    named = re.fullmatch(r'/(?:dev|proc/self)/fd/(\d{1,4})', text)
    return int(named[1]) if named else {'/dev/stdout': 1, '/dev/stderr': 2}.get(text)


def _write_through(path: str | os.PathLike[str], data: bytes) -> None:
    """Write to a device or a pipe; a disk is none, and a pipe must have a reader."""
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
    """Put `data` in the place of a file, whose name is one in `folder` if that is given."""
    before = None
    with contextlib.suppress(FileNotFoundError):
        before = os.stat(target, dir_fd=folder, follow_symlinks=False).st_mode
    if before is not None and stat.S_ISDIR(before):
        raise IsADirectoryError(None, 'is a directory')
    if before is not None and stat.S_ISREG(before) and (kind := kind_of(data[:_BEGINNING])):
        _require_kind(str(path), target, kind, folder)
    head, name = os.path.split(target)
    temporary = os.path.join(head, f'.{name[:100]}.{secrets.token_hex(4)}')  # noqa: PTH118
    # The system applies the umask, which a process cannot even ask for without changing it.
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
    """Refuse a file, whose name is one in `folder` if that is given, that is of another kind."""
    with os.fdopen(os.open(name, os.O_RDONLY, dir_fd=folder), 'rb') as file:
        beginning = file.read(_BEGINNING)
    if beginning and kind_of(beginning) != kind:
        raise ImuAllanError(f'{printable(path)}: exists and is no {kind}, so it is not replaced; '
                            'name another file, or remove this one')


def _sync(folder: int) -> None:
    # Some network file systems cannot sync a folder, and one that is open by O_PATH cannot be.
    with contextlib.suppress(OSError):
        handle = os.open('.', os.O_RDONLY, dir_fd=folder)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
