# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""One way to damage inputs of any kind, and one judgement of what the command makes of them."""

from collections.abc import Callable, Sequence
import contextlib
import copy
import io
from pathlib import Path
from random import Random
import time
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.cli.main import main
from imu_allan.errors import ImuAllanError
from imu_allan.finding_messages import message_of
from imu_allan.recordings import open_recording, read_blocks
import pytest
from repeated import slow

EXTREMES = [0, 1, 255, 65535, 10**9, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**63 - 1, 2**63,
            2**64 - 1]
NUMBERS = [0.0, -0.0, -1.0, 1.0, 5e-324, 2.2e-308, 1e-200, 1e-30, 1e30, 1e154, 1e200,
           1.7e308, -1e308, 0.1, 3, -7, 10**25]
TEXTS = ['', ' ', 'x', '\x1b[31mred\x1b[0m', '\x1b]0;title\x07', 'two\nlines', '\r', '\t', '\0',
         '</script><script>alert(1)</script>', '<img src=x onerror=alert(1)>', '"&\'', '../../x',
         '[bold]markup[/bold]', '[/]', '$x^2$', '$\\frac{', '{{ 7 * 7 }}', '{% raw', '%s%n',
         '- a: b', ': #', '\u202eabc', '\ud800', '\U0001f916', 'é', 'a' * 5000, '&amp;', ']]>',
         '-->', '.inf', 'null', '1e999', '0x10', '*a', '&a', '!!python/object:os.system',
         '\u2028', '\x85', '\ufeff']
LONGEST_S = 10.0


def mutated_bytes(content: bytes, choice: Random) -> bytes:
    """Return the content with one or a few changes, more often near its ends."""
    data = bytearray(content)
    for _ in range(choice.choice([1, 1, 1, 2, 4, 16])):
        size = len(data)
        if size < 2:
            break
        at = choice.choice([choice.randrange(size), choice.randrange(min(size, 300)),
                            size - 1 - choice.randrange(min(size, 1500))])
        kind = choice.randrange(9)
        if kind <= 2:
            data[at] ^= 1 << choice.randrange(8)
        elif kind == 3:
            data[at] = choice.randrange(256)
        elif kind == 4:
            width = choice.choice([2, 4, 8])
            value = choice.choice(EXTREMES) & ((1 << 8 * width) - 1)
            data[at:at + width] = value.to_bytes(width, choice.choice(['little', 'big']))
        elif kind == 5:
            stop = min(size, at + choice.choice([1, 4, 16, 500, 5000]))
            data[at:stop] = bytes([choice.choice([0, 255, 65])]) * (stop - at)
        elif kind == 6:
            del data[at:at + choice.choice([1, 3, 8, 100, 4096])]
        elif kind == 7:
            data[at:at] = choice.randbytes(choice.choice([1, 4, 9, 100]))
        else:
            data = data[:at] if choice.random() < .5 else data + data[at:at + 1000]
    return bytes(data)


def mutated_text(text: str, choice: Random, words: Sequence[str] = ()) -> str:
    """Return the text with lines or words lost, doubled, exchanged or replaced."""
    for _ in range(choice.choice([1, 1, 2, 5])):
        lines = text.split('\n')
        row, other = choice.randrange(len(lines)), choice.randrange(len(lines))
        kind = choice.randrange(8)
        if kind == 0:
            del lines[row]
        elif kind == 1:
            lines[row], lines[other] = lines[other], lines[row]
        elif kind == 2:
            lines.insert(row, lines[other])
        elif kind == 3:
            lines[row] = choice.choice([' ', '\t', '  - ', '{', '[', '? ', '|\n']) + lines[row]
        elif kind <= 5:
            parts = lines[row].split(choice.choice([' ', ',', ':', ';']))
            parts[choice.randrange(len(parts))] = choice.choice(
                [*words, *TEXTS, *map(str, NUMBERS), 'nan', '-inf'])
            lines[row] = choice.choice([' ', ',', ': ']).join(parts)
        else:
            at = choice.randrange(len(lines[row]) + 1)
            lines[row] = (lines[row][:at] + choice.choice([*words, *TEXTS, '1', '-', '.', 'e'])
                          + lines[row][at + choice.choice([0, 1, 5]):])
        text = '\n'.join(lines) or 'x'
    return text


def mutated_document(document: Any, choice: Random, *, same_types: bool) -> Any:
    """Return a copy with one to eight changes; of `same_types`, more pass the check of types."""
    changed = copy.deepcopy(document)
    for _ in range(choice.choice([1, 1, 2, 3, 8])):
        _change_somewhere(changed, choice, same_types)
    return changed


def _change_somewhere(document: Any, choice: Random, same_types: bool) -> None:
    where = document
    while True:
        keys = list(where) if isinstance(where, dict) else list(range(len(where)))
        if not keys:
            return
        key = choice.choice(keys)
        value = where[key]
        if not (isinstance(value, (dict, list)) and value
                and choice.random() < (.97 if same_types else .85)):
            break
        where = value
    if not same_types and choice.random() < .6:
        if choice.random() < .3:
            del where[key]
        else:
            where[key] = choice.choice([None, True, [], {}, [[]], 'x', -1, 1e400, 2**70, [None],
                                        float('nan'), value, [value], {'x': value}])
    elif isinstance(value, bool):
        where[key] = not value
    elif isinstance(value, (int, float)):
        number = choice.choice([*NUMBERS, value * 1e6, -value, value])
        where[key] = (int(min(abs(number), 1e18)) if isinstance(value, int)
                      and choice.random() < .9 else number)
    elif isinstance(value, str):
        where[key] = choice.choice([*TEXTS, value + choice.choice(TEXTS)])
    elif value is None:
        where[key] = choice.choice([*NUMBERS, *TEXTS, [0.0, 1.0], [1.0, 1.0], [2.0, -1.0]])
    elif isinstance(value, list):
        where[key] = choice.choice([[], value[:1], value[::-1], value + value[-1:], value * 20])
    elif choice.random() < .5:
        where[key] = {}


def run_command(*arguments: object, statuses: Sequence[int] = (0, 1)) -> tuple[int, str]:
    """Run the command here, in time and with one line on stderr if it fails; status and stdout."""
    out, err = io.StringIO(), io.StringIO()
    start = time.process_time()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        status = main([*map(str, arguments)])
    assert time.process_time() - start < LONGEST_S
    assert status in statuses, err.getvalue()
    line = err.getvalue()
    if status == 1:
        assert line.startswith('imu_allan: ')
        assert line.endswith('\n')
        assert line[:-1].isprintable(), line
        assert len(line) < 1500
    else:
        assert line == ''
    assert_harmless_on_a_terminal(out.getvalue())
    return status, out.getvalue()


def read_in_part(path: Path, judge: Callable[[str, ImuBlock], None] = lambda *_: None) -> int:
    """Read the first topics of a file; returns the number of messages, 0 if it is refused."""
    began, messages = time.process_time(), 0
    try:
        with open_recording(path) as recording:
            for topic in recording.topics[:3]:
                if topic.count == 0:
                    continue
                for block in read_blocks(recording, topic.name):
                    messages += len(block)
                    assert block.samples.shape == (len(block), 6)
                    assert block.absent.shape == (len(block), 2)
                    assert block.header_ns.shape == block.receive_ns.shape == (len(block),)
                    judge(topic.name, block)
            assert all(message_of(remark).isprintable() for remark in recording.remarks)
    except ImuAllanError as error:
        assert str(error).isprintable()
        assert len(str(error)) < 1500
        messages = 0
    assert time.process_time() - began < LONGEST_S
    return messages


def assert_harmless_on_a_terminal(text: str) -> None:
    """Require that nothing moves the cursor, changes colours or retitles the window."""
    assert all(c.isprintable() or c in '\n\t' for c in text), ascii(text)


def rounds(everyday: int) -> Any:
    """Try so many inputs every day, and ten times a thousand in the slow tests."""
    return pytest.mark.parametrize(('count', 'seed'), [
        (everyday, 1), *(slow(1000, seed) for seed in range(2, 12))])


def each(count: int, seed: int, judge: Callable[[Random], None]) -> None:
    """Judge `count` inputs; a failure names the seed that makes it again."""
    for number in range(count):
        name = f'{seed}/{number}'
        try:
            judge(Random(name))
        except Exception as error:
            raise AssertionError(f'input of Random({name!r}): {error!r}') from error
