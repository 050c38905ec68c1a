# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
A coverage-guided fuzzer on the readers of recordings, for as long as one likes.

It needs the package atheris, which is not among those of the tests. In the folder from which it is
started it makes one called ``coverage_guided``, which keeps what was reached, so that a later run
goes on; a finding is written beside it, to be read by ``imu_allan info``. ::

    pip install atheris
    python test/fuzz/coverage_guided.py -max_total_time=3600 -rss_limit_mb=1500 -timeout=20

All arguments are libFuzzer's.
"""

from pathlib import Path
import sys

import atheris

sys.path[:0] = [str(Path(__file__).parents[1] / name) for name in ('', 'fuzz', 'recordings')]
sys.path.insert(0, str(Path(__file__).parents[2]))

with atheris.instrument_imports(include=['imu_allan.recordings', 'imu_allan.cdr']):
    # These are imported when they are needed, which would be too late.
    from imu_allan.recordings.formats import (  # noqa: F401
        ardupilot_log,
        compressed_file,
        csv_file,
        foxglove_csv,
        mcap_file,
        px4_ulog,
        ros1_bag,
        sqlite_file,
    )

from bags import block, write_bag, write_db3, write_mcap  # noqa: E402
from mutations import read_in_part  # noqa: E402

FOLDER = Path('coverage_guided')
MESSAGES = block(20)
TABLES = {
    'csv': 'time_s,gyro_x,accel_z,temperature [degC]\n1.5,0.1,9.8,30\n1.6,0.2,9.7,\n',
    'foxglove': 'elapsed time,receive time,header.stamp,topic,value\n'
                '0,1.5,1.5,/imu.angular_velocity.x,0.1\n',
    'echoed': '5,17,imu,0,0,0,1' + ',0' * 9 + ',1,2,3' + ',0' * 9 + ',4,5,6' + ',0' * 9 + '\n'}


def read_all(content: bytes) -> None:
    """Read a file with these bytes."""
    path = FOLDER / 'a.csv'
    path.write_bytes(content)
    read_in_part(path)


def write_corpus(folder: Path) -> None:
    """Write one small file of each kind."""
    for compression in ('none', 'lz4', 'zstd'):
        write_mcap(folder / f'mcap_{compression}', MESSAGES, compression=compression)
    for compression in ('none', 'lz4', 'bz2'):
        write_bag(folder / f'bag_{compression}', MESSAGES, compression)
    write_db3(folder / 'db3', MESSAGES)
    for name, text in TABLES.items():
        (folder / name).write_text(text)


def main() -> None:
    """Fuzz until libFuzzer ends the process."""
    corpus = FOLDER / 'corpus'
    if not corpus.exists():
        corpus.mkdir(parents=True)
        write_corpus(corpus)
    atheris.Setup([*sys.argv, str(corpus)], read_all)
    atheris.Fuzz()


if __name__ == '__main__':
    main()
