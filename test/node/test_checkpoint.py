# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
from collections.abc import Callable
import hashlib
import io
import os
from pathlib import Path
import pickle

from hypothesis import given, settings, strategies
from imu_allan.node import checkpoint
from imu_allan.node.checkpoint import decode_state, encode_state, StateFile, UnusableState
import numpy as np
import pytest
from whole_lines import refused, Varying

STATE = {'about': np.array('{"text": "ä"}'), 'sums': np.arange(12.0).reshape(3, 4),
         'counts': np.array([1, 2**62]), 'flags': np.array([True, False]),
         'empty': np.empty((0, 6))}
CONTENT = encode_state(STATE)


def framed(payload: bytes) -> bytes:
    return (b'imu_allan.state/%d\n' % checkpoint.VERSION + hashlib.sha256(payload).digest()
            + payload)


def assert_damaged(content: bytes) -> None:
    with pytest.raises(UnusableState) as caught:
        decode_state(content)
    assert caught.value.reason == 'damaged'


@settings(max_examples=300, deadline=None)
@given(position=strategies.integers(0, len(CONTENT) - 1), flip=strategies.integers(1, 255),
       payload=strategies.binary(max_size=400))
def test_a_state_changed_or_cut_off_anywhere_or_of_any_payload_is_unusable(
        position: int, flip: int, payload: bytes) -> None:
    mutated = bytearray(CONTENT)
    mutated[position] ^= flip
    with pytest.raises(UnusableState):
        decode_state(bytes(mutated))
    assert_damaged(CONTENT[:position])
    assert_damaged(framed(payload))


def test_pickles_are_never_loaded(tmp_path: Path) -> None:
    class Bomb:
        def __reduce__(self) -> tuple[object, ...]:
            return (Path.touch, (tmp_path / 'exploded',))

    arrays = io.BytesIO()
    np.savez(arrays, allow_pickle=True, bomb=np.array([Bomb()], dtype=object))
    for payload in (arrays.getvalue(), pickle.dumps(Bomb())):
        assert_damaged(framed(payload))
    assert not (tmp_path / 'exploded').exists()


def in_folder(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_a_state_is_saved_for_nobody_else_loaded_and_kept_aside(tmp_path: Path) -> None:
    file = StateFile(tmp_path / 'new' / 'state')
    assert file.load() is None
    assert file.save(STATE) == file.path.stat().st_size
    loaded, expected = ([(key, array.dtype, array.shape, array.tolist())
                         for key, array in state.items()] for state in (file.load() or {}, STATE))
    assert loaded == expected
    assert {path.name: path.stat().st_mode & 0o777 for path in file.path.parent.iterdir()} == {
        'state': 0o600, 'state.lock': 0o600}
    content = file.path.read_bytes()
    aside = file.keep_aside('foreign')
    assert aside.name.startswith('state.foreign.20')
    assert aside.read_bytes() == content
    assert not file.path.exists()


def test_a_failed_save_leaves_the_state_before(tmp_path: Path,
                                               monkeypatch: pytest.MonkeyPatch) -> None:
    file = StateFile(tmp_path / 'state')
    file.save(STATE)
    before = file.path.read_bytes()
    with refused(Varying(f'{tmp_path / "state"}: a state of <number> bytes could not be resumed '
                         'from, so it is not written; the one before it stays')):
        file.save({'sums': np.zeros(9_000_000)})

    def full(*_: object) -> None:
        raise OSError(28, 'No space left on device')

    monkeypatch.setattr('os.fsync', full)
    with refused(f'{tmp_path / "state"}: cannot be written (No space left on device); choose a '
                 'folder that exists on a disk with room and may be written to'):
        file.save({'sums': np.zeros(5)})
    assert file.path.read_bytes() == before
    assert in_folder(tmp_path) == {'state', 'state.lock'}


def test_leftovers_of_a_killed_save_are_swept_up(tmp_path: Path) -> None:
    for name in ('.state.a1b2c3d4', '.state.settings', '.state.A1B2C3D4'):
        (tmp_path / name).write_bytes(b'half of a state, or of somebody else')
    StateFile(tmp_path / 'state')
    assert in_folder(tmp_path) == {'.state.settings', '.state.A1B2C3D4', 'state.lock'}


@pytest.mark.parametrize(('made', 'path', 'words'), [
    (lambda at: (at / 'file').write_text('in the way'), 'file/state',
     'cannot be written (File exists); choose a folder that may be written to'),
    (lambda at: (at / 'state').mkdir(), 'state', 'is a folder; name a file in it'),
    # A pipe is waited for until somebody writes to it: for ever.
    (lambda at: os.mkfifo(at / 'state'), 'state', 'is a device, a pipe or a socket; name a '
     'regular file, or one that is not there yet'),
    (lambda at: (at / 'state.lock').symlink_to(at / 'precious'), 'state',
     'cannot be written (<words>); choose a folder that may be written to')],
    ids=['below a file', 'folder', 'pipe', 'link as lock'])
def test_what_can_be_no_state_or_lock_is_one_line_and_left_alone(
        tmp_path: Path, made: Callable[[Path], object], path: str, words: str) -> None:
    (tmp_path / 'precious').write_text('mine')
    made(tmp_path)
    before = in_folder(tmp_path)
    with refused(Varying(f'state_file {tmp_path / path}: {words}')):
        StateFile(tmp_path / path)
    assert in_folder(tmp_path) == before
    assert (tmp_path / 'precious').read_text() == 'mine'


def test_states_kept_aside_are_capped_oldest_first(tmp_path: Path) -> None:
    file = StateFile(tmp_path / 'state')
    aside = []
    for number in range(25):
        file.path.write_bytes(bytes([number]))
        aside.append(file.keep_aside('rate' if number % 2 else 'frame_id').name)
    (tmp_path / 'state.notes').write_text('of the user')
    assert file.thin_out() == aside[4::-1]
    assert in_folder(tmp_path) == {*aside[5:], 'state.lock', 'state.notes'}
    for name in aside[-3:]:
        os.truncate(tmp_path / name, 60_000_000)
    assert file.thin_out() == aside[-2:4:-1]
    file.close()
