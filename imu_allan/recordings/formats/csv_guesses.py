# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Which sensor three columns are of whose names say no more than x, y and z."""

from collections.abc import Collection, Sequence
import re

from imu_allan.recordings.formats.csv_names import triples

_UNITS = {'gyro': ('rad/s', 'deg/s', '°/s', 'dps', 'mdps'),
          'accel': ('m/s^2', 'm/s²', 'm/s2', 'g', 'mg')}
"""Which tell the sensor; a large G is a magnetometer's, too."""
_NOT_RAW = re.compile('free|user|grav|mag|tilt|euler|cmd|command|desired|target|odom|wheel|joint')
"""In a name: not what an IMU measures, or not all of it."""
_FILES = {'gyro': re.compile('gyr', re.IGNORECASE), 'accel': re.compile('acc', re.IGNORECASE)}


def guessed_axes(names: Sequence[tuple[str, str | None]], columns: Sequence[int],
                 known: Collection[str], file_name: str) -> tuple[dict[str, int], str | None]:
    """
    Tell the axes of a sensor that no name speaks of, by their unit or by the name of the file.

    Parameters
    ----------
    names : sequence of (str, str or None)
        Name and unit of every column.
    columns : sequence of int
        Those of which nothing is known.
    known : collection of str
        Which of gyro and accel are known already.
    file_name : str
        Of the whole file.

    Returns
    -------
    axes : dict of str to int
        Column of each axis found; none where two sensors could be meant.
    by_file_name : str or None
        The sensor, if nothing but the name of the file tells it.

    """
    found = {stem: [columns[place] for place in places] for stem, places in triples(
        [names[column][0] for column in columns]).items() if _NOT_RAW.search(stem) is None}
    axes: dict[str, int] = {}
    for sensor, units in _UNITS.items():
        fitting = [three for three in found.values()
                   if all((names[column][1] or '').strip() in units for column in three)]
        if sensor not in known and len(fitting) == 1:
            axes |= _axes(sensor, fitting[0])
    told = [sensor for sensor, pattern in _FILES.items() if pattern.search(file_name)]
    if axes or known or len(told) != 1 or '' not in found:
        return axes, None
    return _axes(told[0], found['']), told[0]


def _axes(sensor: str, columns: Sequence[int]) -> dict[str, int]:
    return {f'{sensor}_{letter}': column for letter, column in zip('xyz', columns, strict=True)}
