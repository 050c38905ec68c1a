# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A folder of tables, a sensor each, as phones record them: Sensor Logger, phyphox."""

from collections.abc import Iterator
from pathlib import Path

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError
from imu_allan.fleet.names import natural
from imu_allan.recordings.formats.csv_file import CsvRecording, TOPIC
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import ImuTopic, Recording
from imu_allan.wording import SENSORS

_MOST_TABLES = 64
"""Files that are looked into; a phone has some thirty sensors."""
_BEST = {'gyro': ('gyroscope',), 'accel': ('totalacceleration', 'accelerometer')}
"""Names in small letters, the best first: Sensor Logger takes gravity out of its Accelerometer."""


class TableFolder(Recording):
    """
    A folder in which gyroscope and accelerometer have a CSV file each, with stamps of one clock.

    Parameters
    ----------
    path : Path
        The folder.
    options : RecordingOptions
        What the user says about it.

    Raises
    ------
    ImuAllanError
        If it holds no file with a gyroscope alone, or none with an accelerometer alone.

    """

    def __init__(self, path: Path, options: RecordingOptions) -> None:
        super().__init__(path, options)
        self._files: dict[str, Path] = {}
        halves: dict[str, list[str]] = {sensor: [] for sensor in SENSORS}
        tables = sorted((file for file in path.iterdir() if file.suffix.lower() == '.csv'
                         and file.is_file()), key=lambda file: natural(file.name))
        for file in tables[:_MOST_TABLES]:
            try:
                sensors = CsvRecording(file, file, options).sensors
            except ImuAllanError as error:
                self.other_topics[file.stem], self.reasons[file.stem] = 'CSV', str(error)
                continue
            self._files[file.stem] = file
            self.topics.append(ImuTopic(file.stem, None))
            if len(sensors) == 1:
                halves[sensors[0]].append(file.stem)
        if not all(halves.values()):
            raise ImuAllanError('no table of a gyroscope beside one of an accelerometer')
        self.size_bytes = sum(file.stat().st_size for file in self._files.values())
        best = [_best(names, _BEST[sensor]) for sensor, names in halves.items()]
        if all(best):
            self.preferred, self.preferred_for = tuple(map(str, best)), 'by the names of the files'

    def close(self) -> None:
        """Release nothing: each reading opens and closes the files itself."""

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read a table, each block with its share of the bytes of all."""
        file = self._files[topic]
        with CsvRecording(file, file, self.options) as table:
            for block, position in table.decoded(TOPIC):
                yield block, position * self.size_bytes // table.size_bytes
        for remark in table.remarks:
            self.keep_remark(remark)


def _best(names: list[str], best: tuple[str, ...]) -> str | None:
    """Choose the only table of a sensor, or that of the best name."""
    if len(names) == 1:
        return names[0]
    known = {name.lower().replace(' ', ''): name for name in names}
    return next((known[name] for name in best if name in known), None)
