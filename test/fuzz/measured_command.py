# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The command as a process of its own, with the time and the memory that it took."""

import json
from pathlib import Path
import subprocess
import sys
import tempfile

# The largest memory of a process begins with that of the one that started it: a small one.
METER = """
import json, os, subprocess, sys
process = subprocess.Popen(sys.argv[2:])
_, status, usage = os.wait4(process.pid, 0)
with open(sys.argv[1], 'w') as file:
    json.dump([os.waitstatus_to_exitcode(status), usage.ru_utime + usage.ru_stime,
               usage.ru_maxrss], file)
"""


def run(*arguments: object, patience_s: float = 120.0) -> tuple[int, str, str, float, int]:
    """Run the command; returns status, stdout, stderr, CPU time in s and largest memory in kB."""
    with tempfile.TemporaryDirectory() as folder:
        measured = Path(folder, 'measured')
        done = subprocess.run(
            [sys.executable, '-c', METER, str(measured), sys.executable, '-m', 'imu_allan',
             *map(str, arguments)], capture_output=True, text=True, timeout=patience_s, check=True)
        status, seconds, kilobytes = json.loads(measured.read_text())
    return status, done.stdout, done.stderr, seconds, kilobytes
