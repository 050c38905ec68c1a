# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""One result to be made: of which recording, in which way, into which folder."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from itertools import count as naturals
from pathlib import Path
import re
from typing import Any, Literal, TYPE_CHECKING

from imu_allan.errors import ImuAllanError

if TYPE_CHECKING:
    from imu_allan.analysis import Opening
    from imu_allan.recordings import RecordingOptions
    from imu_allan.result import Inspection, Result


@dataclass(frozen=True)
class Task:
    """
    One result to be made.

    Attributes
    ----------
    path : str
        The recording.
    topic : str or None
        None where the recording has one Imu topic.
    options : mapping
        Of `TimelineOptions`.
    start_s, duration_s : float
        The part to use; a duration of None means all the rest.
    size_bytes : int
        Of the recording, for progress.
    folder : Path or None
        Where to write the result.
    unit : str
        What the recording is called among others.
    inspection : mapping
        Of `Inspection`; empty where nothing was said.
    exports : tuple of str
        Consumers whose configurations are written into the folder.
    reading : RecordingOptions or None
        How the recording is to be read.
    together : tuple of str
        Recordings of one IMU that make one result; empty where it is one recording.

    """

    path: str
    topic: str | None
    options: Mapping[str, Any]
    start_s: float | Literal['auto']
    duration_s: float | None
    size_bytes: int
    folder: Path | None
    unit: str = ''
    inspection: Mapping[str, str] = field(default_factory=dict)
    exports: tuple[str, ...] = ()
    reading: 'RecordingOptions | None' = None
    together: tuple[str, ...] = ()

    def arguments(self) -> dict[str, Any]:
        """Return those of `imu_allan.analysis.analyze` and `said`, but the path."""
        from imu_allan.recordings import RecordingOptions
        from imu_allan.timeline import TimelineOptions

        return {'topic': self.topic, 'options': TimelineOptions(**self.options),
                'reading': self.reading or RecordingOptions(), 'start_s': self.start_s,
                'duration_s': self.duration_s}

    def said(self) -> dict[str, str]:
        """Return the options that a result made of it names."""
        from imu_allan.analysis import said

        return said(**self.arguments())

    def inspected(self) -> 'Inspection | None':
        """Return what a result made of it says of the unit."""
        from imu_allan.result import Inspection

        return Inspection(**self.inspection) if self.inspection else None


def characterize(task: Task, progress: Callable[[int], None] | None = None,
                 artist: Executor | None = None, opening: 'Opening | None' = None,
                 ) -> 'tuple[Result, ImuAllanError | None]':
    """
    Make the result of a task and write its folder: where the work is done, not one by one.

    Beside the result stands why the folder could not be written, where it could not.

    Parameters
    ----------
    task : Task
        What to do.
    progress : callable, optional
        As for `analyze`.
    artist : Executor, optional
        Draws the picture meanwhile.
    opening : callable, optional
        As for `analyze`.

    """
    from imu_allan.analysis import analyze

    drawing = None
    if task.folder is not None and artist is not None:
        drawing = partial(_drawn, artist)
    result = analyze(list(task.together) or task.path, progress=progress, opening=opening,
                     **task.arguments())
    if task.inspection:
        result = replace(result, inspection=task.inspected())
    if task.folder is not None:
        from imu_allan.writers.folder import save_folder
        from imu_allan.writers.folder_lock import turn_in
        try:
            with turn_in(task.folder):
                save_folder(result, task.folder, task.exports, drawing=drawing)
        except ImuAllanError as error:
            return result, error
    return result, None


def _drawn(artist: Executor, result: 'Result') -> Callable[[], bytes]:
    """Have the picture of a result drawn; return what waits for it."""
    from imu_allan.writers.plot import overview_png

    drawn = artist.submit(overview_png, result)

    def picture() -> bytes:
        # While it waits: what prints the result afterwards.
        import_module('imu_allan.writers.table')
        import_module('rich.console')
        try:
            return drawn.result()
        except ImuAllanError:
            # No process could be started, or it was ended from outside.
            return overview_png(result)

    return picture


def folder_names(recordings: Sequence[tuple[str, str | None]],
                 units: Mapping[str, str] | None = None) -> list[str]:
    """
    Name a folder after each recording and topic, every name once.

    Parameters
    ----------
    recordings : sequence of (str, str or None)
        Path and topic. Nothing in a topic's name leads out of the folder above, and no name is
        longer than a file system takes.
    units : mapping of str to str, optional
        What the unit of each path is called; the recording's own name by default.

    """
    from imu_allan.fleet.names import unit_name

    taken: set[str] = set()
    numbers: dict[str, Iterator[int]] = {}
    stems = units or {path: unit_name(path) for path in {path for path, _ in recordings}}
    names = []
    for path, topic in recordings:
        first = name = _folder_name(stems[path], topic)
        # Where capitals count for nothing, two names that differ in them are one folder.
        while name.casefold() in taken:
            name = f'{first}-{next(numbers.setdefault(first.casefold(), naturals(2)))}'
        taken.add(name.casefold())
        names.append(name)
    return names


def _folder_name(stem: str, topic: str | None) -> str:
    name = stem if topic is None else f'{stem}_{topic.strip("/")}'
    name = re.sub(r'[^\w.-]+', '_', name).lstrip('.')
    # Bytes of a folder's name; file systems take 255, and a number may have to be added.
    return name.encode()[:200].decode(errors='ignore') or 'recording'
