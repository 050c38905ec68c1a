# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Tasks of the command: from which recording to make a result, how, and into which folder."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from imu_allan.errors import ImuAllanError

if TYPE_CHECKING:
    from imu_allan.analysis import Choice
    from imu_allan.result import Result


@dataclass(frozen=True)
class Task:
    """
    One result to be made.

    Attributes
    ----------
    paths : tuple of str
        The recording; several of one IMU give one joint result.
    choice : Choice
        Which part of it is used, and how it is read.
    size_bytes : int
        Size of the recording, for progress.
    folder : Path or None
        Where to write the result.
    unit : str
        Name of the recording among others.
    inspection : mapping of str to str
        What the result states about the unit.
    exports : tuple of str
        Consumers whose configurations are written into the folder.

    """

    paths: tuple[str, ...]
    choice: 'Choice'
    size_bytes: int
    folder: Path | None
    unit: str
    inspection: Mapping[str, str]
    exports: tuple[str, ...]

    @property
    def path(self) -> str:
        """Return the recording, or all of them."""
        return ' + '.join(self.paths)


def characterize(task: Task, progress: Callable[[int], None] | None = None
                 ) -> 'tuple[Result, ImuAllanError | None]':
    """
    Make the result of a task and write its folder, so that workers write their folders themselves.

    Return the result, and the error if the folder could not be written.
    """
    from imu_allan.analysis import analyzed
    from imu_allan.result import Inspection

    result = analyzed(task.paths[0] if len(task.paths) == 1 else task.paths, task.choice,
                      progress)
    if task.inspection:
        result = replace(result, inspection=Inspection(**task.inspection))
    if task.folder is not None:
        from imu_allan.writers.folder import save_folder
        try:
            save_folder(result, task.folder, task.exports)
        except ImuAllanError as error:
            return result, error
    return result, None
