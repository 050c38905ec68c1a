# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A folder of tables, a sensor each, as phones record them: Sensor Logger, phyphox."""

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from imu_allan.block import ImuBlock
from imu_allan.errors import ImuAllanError, printable
from imu_allan.fleet.names import natural
from imu_allan.recordings.formats.csv_file import CsvRecording
from imu_allan.recordings.imu_topic import ImuTopic
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import Recording
from imu_allan.wording import NO_TOPIC, SENSORS

_MOST_TABLES = 64
"""Files that are looked into; a phone has some thirty sensors."""
_CALLED = {'gyro': 'gyr', 'accel': 'acc'}
"""Part of the name of a file, in small letters, whose bare x, y and z are of a sensor."""
_BEST = {'gyro': ('gyroscope',), 'accel': ('totalacceleration', 'accelerometer')}
"""Names in small letters, the best first: Sensor Logger takes gravity out of its Accelerometer."""


def tables_in(folder: Path) -> list[Path]:
    """Name the CSV files of a folder, by growing numbers in their names."""
    return sorted((file for file in folder.iterdir() if file.suffix.lower() == '.csv'
                   and not file.name.startswith('.') and file.is_file()),
                  key=lambda file: natural(file.name))


class TableFolder(Recording):
    """A folder in which gyroscope and accelerometer have a CSV file each, of one clock."""

    def __init__(self, path: Path, options: RecordingOptions) -> None:
        super().__init__(path, options)
        self._files: dict[str, Path] = {}
        tables: dict[str, list[str]] = {sensor: [] for sensor in ('gyro', 'accel', 'both')}
        for file in tables_in(path)[:_MOST_TABLES]:
            try:
                sensors = self._table(file).sensors
            except ImuAllanError as error:
                self.other_topics[file.name], self.reasons[file.name] = 'CSV', str(error)
                continue
            self._files[file.name] = file
            self.topics.append(ImuTopic(file.name, None))
            tables['both' if len(sensors) > 1 else sensors[0]].append(file.name)
        lacking = [SENSORS[sensor].lower() for sensor in SENSORS if not tables[sensor]]
        if lacking and not tables['both']:
            # Of thirty sensors of a phone the others have no axis of an IMU either.
            names = sorted(self.reasons, key=lambda name: not any(
                part in name.lower() for part in _CALLED.values()))
            raise ImuAllanError('; '.join([
                f'{printable(path)}: its CSV files give no {" and no ".join(lacking)}',
                *(self.reasons[name] for name in names[:2])]))
        self.size_bytes = sum(file.stat().st_size for file in self._files.values())
        gyro, accel = (_best(tables[sensor], _BEST[sensor]) for sensor in SENSORS)
        if gyro is not None and accel is not None:
            self.preferred, self.preferred_for = (gyro, accel), 'by the names of the files'

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read a table, each block with its share of the bytes of all."""
        file = self._files[topic]
        with self._table(file) as table:
            for block, position in table.decoded(NO_TOPIC):
                yield block, position * self.size_bytes // table.size_bytes
        for remark in table.remarks:
            self.keep_remark(remark)

    def _table(self, file: Path) -> CsvRecording:
        """Open a table; which sensor its x, y and z are of is what it may be called after."""
        try:
            return CsvRecording(file, file, self.options)
        except ImuAllanError:
            named = [sensor for sensor, part in _CALLED.items() if part in file.name.lower()]
            if len(named) != 1 or self.options.columns:
                raise
            columns = ('time', 'time'), *((f'{named[0]}_{axis}', axis) for axis in 'xyz')
            with suppress(ImuAllanError):
                return CsvRecording(file, file, replace(self.options, columns=columns))
            raise


def _best(names: list[str], best: tuple[str, ...]) -> str | None:
    """Choose the only table of a sensor, or that of the best name."""
    if len(names) == 1:
        return names[0]
    known = {name.lower().removesuffix('.csv').replace(' ', ''): name for name in names}
    return next((known[name] for name in best if name in known), None)
