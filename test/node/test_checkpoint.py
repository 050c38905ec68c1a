# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0

import hashlib
import io
import os
from pathlib import Path
import pickle
import time
import zipfile

from hypothesis import given, settings, strategies
from imu_allan.node.checkpoint import (
    decode_state,
    encode_state,
    StateFile,
    UnusableState,
    VERSION,
)
import numpy as np
import pytest
from whole_lines import refused, Varying

STATE = {'about': np.array('{"text": "ä"}'), 'sums': np.arange(12.0).reshape(3, 4),
         'counts': np.array([1, 2**62]), 'flags': np.array([True, False]),
         'empty': np.empty((0, 6))}
CONTENT = encode_state(STATE)


def framed(payload: bytes, version: bytes = b'%d' % VERSION) -> bytes:
    return b'imu_allan.state/' + version + b'\n' + hashlib.sha256(payload).digest() + payload


def test_a_state_of_another_layout_is_told_by_its_version() -> None:
    for version, reason in ((VERSION - 1, 'foreign'), (VERSION + 1, 'newer')):
        with pytest.raises(UnusableState, match=(
                f'^it has version {version}, this imu_allan reads {VERSION}$')) as caught:
            decode_state(framed(b'', b'%d' % version))
        assert caught.value.reason == reason


def test_a_state_reads_back_exactly() -> None:
    found = decode_state(CONTENT)
    assert list(found) == list(STATE)
    for key, array in STATE.items():
        assert found[key].dtype == array.dtype
        np.testing.assert_array_equal(found[key], array)


@settings(max_examples=300, deadline=None)
@given(position=strategies.integers(0, len(CONTENT) - 1), flip=strategies.integers(1, 255))
def test_a_changed_byte_anywhere_makes_the_state_unusable(position: int, flip: int) -> None:
    mutated = bytearray(CONTENT)
    mutated[position] ^= flip
    with pytest.raises(UnusableState):
        decode_state(bytes(mutated))


@settings(max_examples=100, deadline=None)
@given(length=strategies.integers(0, len(CONTENT) - 1))
def test_a_state_cut_off_anywhere_is_damaged(length: int) -> None:
    with pytest.raises(UnusableState) as caught:
        decode_state(CONTENT[:length])
    assert caught.value.reason == 'damaged'


@settings(max_examples=300, deadline=None)
@given(payload=strategies.binary(max_size=400))
def test_any_payload_with_a_right_checksum_is_refused_without_another_error(
        payload: bytes) -> None:
    with pytest.raises(UnusableState) as caught:
        decode_state(framed(payload))
    assert caught.value.reason == 'damaged'


def test_pickles_are_never_loaded(tmp_path: Path) -> None:
    class Bomb:
        def __reduce__(self) -> tuple[object, ...]:
            return (Path.touch, (tmp_path / 'exploded',))

    arrays = io.BytesIO()
    np.savez(arrays, allow_pickle=True, bomb=np.array([Bomb()], dtype=object))
    for payload in (arrays.getvalue(), pickle.dumps(Bomb())):
        with pytest.raises(UnusableState) as caught:
            decode_state(framed(payload))
        assert caught.value.reason == 'damaged'
    assert not (tmp_path / 'exploded').exists()


def test_arrays_that_unpack_to_more_than_the_file_are_refused() -> None:
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, 'w', zipfile.ZIP_DEFLATED) as archive:
        zeros = io.BytesIO()
        np.save(zeros, np.zeros(1_000_000))
        archive.writestr('zeros.npy', zeros.getvalue())
    assert len(packed.getvalue()) < 50_000
    with refused('its arrays are larger than the file', UnusableState):
        decode_state(framed(packed.getvalue()))


def test_objects_are_not_stored() -> None:
    with refused('Object arrays cannot be saved when allow_pickle=False', ValueError):
        encode_state({'fine': np.zeros(3), 'bomb': np.array([object()])})


def test_no_file_is_no_state(tmp_path: Path) -> None:
    assert StateFile(tmp_path / 'new' / 'state').load() is None


def test_a_state_is_saved_and_loaded(tmp_path: Path) -> None:
    file = StateFile(tmp_path / 'state')
    assert file.save(STATE) == file.path.stat().st_size
    loaded = file.load()
    assert loaded is not None
    np.testing.assert_array_equal(loaded['sums'], STATE['sums'])


def test_a_failed_save_leaves_the_state_before(tmp_path: Path,
                                               monkeypatch: pytest.MonkeyPatch) -> None:
    file = StateFile(tmp_path / 'state')
    file.save(STATE)
    before = file.path.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr('os.fsync', full)
    with refused(f'{tmp_path / "state"}: cannot be written (No space left on device); choose a '
                 'folder that exists on a disk with room and may be written to'):
        file.save({'sums': np.zeros(5)})
    assert file.path.read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ['state', 'state.lock']


def test_what_is_kept_aside_keeps_its_content_and_says_why(tmp_path: Path) -> None:
    file = StateFile(tmp_path / 'state')
    file.path.write_bytes(b'precious')
    aside = file.keep_aside('foreign')
    assert aside.name.startswith('state.foreign.20')
    assert aside.read_bytes() == b'precious'
    assert not file.path.exists()


def test_leftovers_of_a_killed_save_are_swept_up(tmp_path: Path) -> None:
    (tmp_path / '.state.a1b2c3d4').write_bytes(b'half of a state')
    others = ['.state.keep.this.one', '.state.settings', '.state.database', '.state.A1B2C3D4']
    for name in others:
        (tmp_path / name).write_bytes(b'of somebody else')
    StateFile(tmp_path / 'state')
    assert {path.name for path in tmp_path.iterdir()} == {*others, 'state.lock'}


def test_a_file_in_use_is_refused_until_the_other_node_has_ended(tmp_path: Path) -> None:
    path = tmp_path / 'state'
    other = StateFile(path)
    with refused(f'state_file {path}: is in use by another node; give every node a file of its '
                 'own'):
        StateFile(path)
    other.close()
    StateFile(path).close()


def test_a_folder_that_cannot_be_made_is_one_clear_line(tmp_path: Path) -> None:
    (tmp_path / 'file').write_text('in the way')
    with refused(f'state_file {tmp_path / "file" / "state"}: cannot be written (File exists); '
                 'choose a folder that may be written to'):
        StateFile(tmp_path / 'file' / 'state')
    with refused(f'state_file {tmp_path}: is a folder; name a file in it'):
        StateFile(tmp_path)


@pytest.mark.parametrize('name', ['state', 'state.lock'])
def test_a_pipe_as_state_or_lock_is_one_line_at_once(tmp_path: Path, name: str) -> None:
    os.mkfifo(tmp_path / name)
    began = time.monotonic()
    with refused(f'state_file {tmp_path / "state"}: ' + (
            'is a device, a pipe or a socket; name a regular file, or one that is not there yet'
            if name == 'state' else
            'cannot be written (state.lock is not a regular file); choose a folder that may be '
            'written to')):
        StateFile(tmp_path / 'state')
    # A pipe is waited for until somebody writes to it: for ever.
    assert time.monotonic() - began < 60
    assert sorted(path.name for path in tmp_path.iterdir()) == [name]


def test_a_lock_that_is_a_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / 'precious').write_text('mine')
    (tmp_path / 'state.lock').symlink_to(tmp_path / 'precious')
    with refused(Varying(f'state_file {tmp_path / "state"}: cannot be written (<words>); choose a '
                         'folder that may be written to')):
        StateFile(tmp_path / 'state')
    assert (tmp_path / 'precious').read_text() == 'mine'


def test_state_and_lock_are_read_by_nobody_else(tmp_path: Path) -> None:
    file = StateFile(tmp_path / 'state')
    file.save({'sums': np.arange(3.0)})
    file.close()
    assert {path.name: path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {
        'state': 0o600, 'state.lock': 0o600}


def test_a_state_that_could_not_be_loaded_is_not_saved(tmp_path: Path) -> None:
    file = StateFile(tmp_path / 'state')
    file.save({'sums': np.arange(3.0)})
    with refused(Varying(f'{tmp_path / "state"}: a state of <number> bytes could not be resumed '
                         'from, so it is not written; the one before it stays')):
        file.save({'sums': np.zeros(9_000_000)})
    assert file.load() is not None
    file.close()
