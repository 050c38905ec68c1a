# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Time and memory of every tool that reads recordings, the whole process each."""

from collections.abc import Sequence
import json
from pathlib import Path
from statistics import median
import subprocess
import sys
import tempfile
from typing import Any

from imu_allan.block import ImuBlock
from imu_allan.recordings.write import write_recording
import numpy as np

_READ = """
import sys
from pathlib import Path
import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore
with AnyReader([Path(sys.argv[1])],
               default_typestore=get_typestore(Stores.ROS2_JAZZY)) as reader:
    rows = []
    for connection, _, raw in reader.messages():
        m = reader.deserialize(raw, connection.msgtype)
        w, a = m.angular_velocity, m.linear_acceleration
        rows.append((w.x, w.y, w.z, a.x, a.y, a.z))
samples = np.array(rows)
"""
_ALLANTOOLS = _READ + """
import allantools
for axis in samples.T:
    allantools.oadev(axis, rate=1000, data_type='freq', taus='octave')
"""
_ALLAN_VARIANCE = _READ + """
import allan_variance
allan_variance.estimate_parameters(*allan_variance.compute_avar(samples, 0.001))
"""


def programs(bag: Path, folder: Path) -> dict[str, list[str]]:
    """Return the command of each tool for a recording."""
    return {
        'imu_allan analyze': [sys.executable, '-m', 'imu_allan', 'analyze', str(bag)],
        'dedrunk noise': [str(Path(sys.executable).with_name('dedrunk')), 'noise', str(bag), '-y',
                          '--output', str(folder / 'imu.yaml'), '--csv', str(folder / 'a.csv')],
        'rosbags + allantools': [sys.executable, '-c', _ALLANTOOLS, str(bag)],
        'rosbags + allan-variance': [sys.executable, '-c', _ALLAN_VARIANCE, str(bag)],
    }


_WATCH = """
import json, os, subprocess, sys, time
begin = time.perf_counter()
process = subprocess.Popen(sys.argv[1:], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
_, status, usage = os.wait4(process.pid, 0)
print(json.dumps({'wall_s': time.perf_counter() - begin,
                  'cpu_s': usage.ru_utime + usage.ru_stime,
                  'memory_mb': usage.ru_maxrss / 1024,
                  'status': os.waitstatus_to_exitcode(status)}))
"""


def measured(command: list[str]) -> dict[str, float]:
    """Return wall and processor time in s and the largest resident size in MB of a process."""
    # A child begins with the size of its parent: a small one that loads nothing starts it.
    done = subprocess.run([sys.executable, '-I', '-S', '-c', _WATCH, *command], check=True,
                          capture_output=True, text=True)
    found: dict[str, float] = json.loads(done.stdout)
    return found


def walking(messages: int) -> ImuBlock:
    """Return a sensor at 1 kHz whose random walk shows so clearly that no tool refuses it."""
    rng = np.random.default_rng(1)
    noise = rng.standard_normal((messages, 6))
    noise += np.cumsum(2e-3 * rng.standard_normal((messages, 6)), axis=0)
    stamps = 1_700_000_000 * 10**9 + np.arange(messages, dtype=np.int64) * 10**6
    return ImuBlock(stamps, stamps, np.round(noise, 3) * 1e-3 + np.array([0, 0, 0, 0, 0, 9.81]),
                    np.zeros((messages, 2), np.bool_), 'imu_link')


def run(lengths: Sequence[int], repeats: int) -> dict[str, Any]:
    """Measure every tool in turn, medians of `repeats`."""
    found: dict[str, Any] = {}
    for messages in lengths:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            bag = write_recording(folder / 'bag', [walking(messages)], storage='mcap')
            turns = [{tool: measured(command) for tool, command in programs(bag, folder).items()}
                     for _ in range(repeats)]
        found[str(messages)] = {tool: {key: median(turn[tool][key] for turn in turns)
                                       for key in turns[0][tool]} for tool in turns[0]}
        print(f'{messages} messages: done', flush=True)
    return found
