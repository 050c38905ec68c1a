# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Folders with one CSV file per sensor, as phone apps write them: Sensor Logger, phyphox."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
import re

from imu_allan.block import ImuBlock
from imu_allan.errors import error_about, ImuAllanError
from imu_allan.recordings.formats.csv_file import CsvRecording
from imu_allan.recordings.formats.csv_header import NamesNoAxis
from imu_allan.recordings.options import RecordingOptions
from imu_allan.recordings.recording import ImuTopic, Recording
from imu_allan.wording import natural, NO_TOPIC, SENSORS


def tables_in(folder: Path) -> list[Path]:
    """List the CSV files of a folder in natural order of their names."""
    return sorted((file for file in folder.iterdir() if file.suffix.lower() == '.csv'
                   and not file.name.startswith('.') and file.is_file()),
                  key=lambda file: natural(file.name))


class TableFolder(Recording):
    """
    A folder with one CSV file for the gyroscope and one for the accelerometer, of one clock.

    Attributes
    ----------
    alone : list of Path
        If the folder holds no such pair but files with both sensors, its files that may be
        recordings by themselves.

    """

    def __init__(self, path: Path, options: RecordingOptions) -> None:
        super().__init__(path, options)
        self._tables: dict[str, CsvRecording] = {}
        tables = tables_in(path)
        foreign: set[Path] = set()
        # A phone has some thirty sensors.
        for file in tables[:64]:
            try:
                self._tables[file.name] = self._table(file)
            except ImuAllanError as error:
                self.other_topics[file.name], self.reasons[file.name] = 'CSV', str(error)
                if isinstance(error, NamesNoAxis):
                    foreign.add(file)
        self.topics = [ImuTopic(name, None) for name in self._tables]
        halves = {sensor: [name for name, table in self._tables.items()
                           if table.sensors == [sensor]] for sensor in SENSORS}
        self.alone: list[Path] = []
        if not all(halves.values()):
            if len(self._tables) == sum(map(len, halves.values())):
                raise error_about(path, 'a folder of CSV files that are no IMU together: '
                                  f'{self._why_no_imu(halves)}')
            self.alone = [file for file in tables if file not in foreign]
        self.size_bytes = sum(table.size_bytes for table in self._tables.values())
        # In lower case, best first. Sensor Logger removes gravity from its Accelerometer.
        preferred = {'gyro': ('gyroscope',), 'accel': ('totalacceleration', 'accelerometer')}
        gyro, accel = (_best(names, preferred[sensor]) for sensor, names in halves.items())
        if gyro is not None and accel is not None:
            self.preferred, self.preferred_for = (gyro, accel), 'by the names of the files'

    def decoded(self, topic: str) -> Iterator[tuple[ImuBlock, int]]:
        """Read a table; yield blocks, each with its share of the bytes of all files."""
        table = self._tables[topic].for_another_topic()
        for block, position in table.decoded(NO_TOPIC):
            yield block, position * self.size_bytes // table.size_bytes
        self.keep_remarks_of(table)

    def _table(self, file: Path) -> CsvRecording:
        """Open a table; if its columns fit no sensor or both, infer it from the file name."""
        try:
            return CsvRecording(file, file, self.options)
        except ImuAllanError:
            # The user gives the columns of all files at once.
            given = {meaning: [pair for pair in self.options.columns if meaning in pair[0]]
                     for meaning in ('time', *SENSORS)}
            named = [sensor for sensor in SENSORS if sensor[:3] in file.name.lower()]
            fits = {}
            for sensor in named or (SENSORS if self.options.columns else ()):
                # MetaWear names its columns x-axis (g).
                for behind in ('', '-axis'):
                    axes = given[sensor] or [
                        (f'{sensor}_{axis}', f'{axis}{behind}') for axis in 'xyz']
                    options = replace(self.options, columns=(*given['time'], *axes))
                    with suppress(NamesNoAxis):
                        fits[sensor] = CsvRecording(file, file, options)
            if len(fits) != 1:
                raise
            return next(iter(fits.values()))

    def _why_no_imu(self, halves: Mapping[str, Sequence[str]]) -> str:
        """Explain why the files are not an IMU: what they lack, or why they cannot be read."""
        lacking = [SENSORS[sensor].lower() for sensor, names in halves.items() if not names]
        said = f'its CSV files give no {" and no ".join(lacking)}'
        # List likely files first; most of a phone's thirty sensors are not part of an IMU.
        names = sorted(self.reasons, key=lambda name: not re.search('gyr|acc|imu', name.lower()))
        return '; '.join([said, *(self.reasons[name] for name in names[:2])])


def _best(names: list[str], best: tuple[str, ...]) -> str | None:
    """Choose the only table of a sensor, or the one with the best name."""
    if len(names) == 1:
        return names[0]
    known = {name.lower().removesuffix('.csv').replace(' ', ''): name for name in names}
    return next((known[name] for name in best if name in known), None)
