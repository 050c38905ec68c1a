# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Export of the configuration of a consumer, and messages on existing configurations."""

from collections.abc import Sequence
import os
from pathlib import Path

from imu_allan.errors import printable
from imu_allan.result import Result
from imu_allan.wording import listed
from imu_allan.writers.atomic import CONFIGURATION, kind_of
from imu_allan.writers.consumers import CONSUMERS
from imu_allan.writers.filters.chosen_numbers import ExportOptions, Numbers
from imu_allan.writers.filters.structured import WRITERS
from imu_allan.writers.filters.template import filled


def export(result: Result, consumer: str, options: ExportOptions = ExportOptions()  # noqa: B008
           ) -> str:
    """Return the text of the configuration of a filter; `CONSUMERS` names its file."""
    return WRITERS.get(consumer, filled)(Numbers(result, consumer, options))


def existing_file_note(path: str | os.PathLike[str]) -> str:
    """Say that a file stands in place of a configuration that cannot be made, if one does."""
    if not Path(path).is_file():
        return ''
    return f'; {printable(path)} stands there from before and was not replaced'


def stale_files_note(folder: str | os.PathLike[str], exports: Sequence[str] = ()) -> str:
    """Name the configurations in a folder that are not `exports`, but of an earlier result."""
    folder = Path(folder)
    old = {name: consumer.file for name, consumer in CONSUMERS.items()
           if name not in exports and _is_configuration(folder / consumer.file)}
    if not old:
        return ''
    files = listed(list(old.values()))
    again = ' '.join(f'--for {name}' for name in old)
    return (f'{printable(str(folder))}: {files} {"is" if len(old) == 1 else "are"} of an earlier '
            f'result and {"was" if len(old) == 1 else "were"} not replaced; {again} writes '
            f'{"it" if len(old) == 1 else "them"} anew')


def _is_configuration(path: Path) -> bool:
    if not path.is_file():
        return False
    try:
        with path.open('rb') as file:
            return kind_of(file.read(1 << 14)) == CONFIGURATION
    except OSError:
        # A filter of this user cannot read the file either, so it causes no confusion.
        return False
