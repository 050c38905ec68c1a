# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What a user reads is compared as a whole line."""

from collections.abc import Iterator
from contextlib import contextmanager
import re

from imu_allan.errors import ImuAllanError
import pytest


@contextmanager
def refused(line: 'str | Varying', error: type[Exception] = ImuAllanError,
            ) -> Iterator[pytest.ExceptionInfo[Exception]]:
    """Expect an error that says `line` and nothing else."""
    with pytest.raises(error) as caught:
        yield caught
    assert str(caught.value) == line


def unwritable(path: object, why: str) -> str:
    return (f'{path}: cannot be written ({why}); choose a folder that exists on a disk with room '
            'and may be written to')


class Varying:
    """A line with any number, moved by chance, for `<number>`; a library's own for `<words>`."""

    PARTS = (('<number>', r'[-+]?\d+(,\d{3})*(\.\d+)?(e[-+]?\d+)?'), ('<words>', r'[^\n]+'))

    def __init__(self, line: str) -> None:
        self.line = line
        self.form = re.escape(line)
        for name, part in self.PARTS:
            self.form = self.form.replace(name, part)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, str) and re.fullmatch(self.form, other) is not None

    def __repr__(self) -> str:
        return f'Varying({self.line!r})'
