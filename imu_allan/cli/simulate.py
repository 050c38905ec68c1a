# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Write a recording of a simulated IMU."""

import argparse
from pathlib import Path
from typing import Any, TYPE_CHECKING

from imu_allan.cli.arguments import duration, rate, whole_number
from imu_allan.errors import ImuAllanError
from imu_allan.writers.terminal import progress_bar

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from imu_allan.block import ImuBlock


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'simulate', help='write a recording from a noise model file',
        usage='%(prog)s MODEL [options]',
        examples=('simulate consumer_mems --output imu_at_rest',
                  'simulate my_imu.yaml --rate 1kHz --duration 3h --output night'),
        description='Write a rosbag2 recording of an IMU at rest with the noise of a model file. '
                    'The same seed gives the same samples.')
    parser.add_argument('model', metavar='MODEL',
                        help='noise model: a YAML file with units, or one that is shipped '
                             '(consumer_mems, tactical_mems)')
    parser.add_argument('-o', '--output', metavar='DIR',
                        help='recording to write (default: the name of MODEL, in this folder)')
    parser.add_argument('--storage', choices=('mcap', 'sqlite3'), default='mcap',
                        help='container of the recording (default: %(default)s)')
    parser.add_argument('--rate', metavar='RATE', type=rate, default=100.0,
                        help='of the samples: 100, 100Hz or 2kHz (default: %(default)g)')
    parser.add_argument('--duration', metavar='TIME', type=duration, default=3600.0,
                        help='length of the recording: 90 or 90s, 10min, 3h (default: 1h)')
    parser.add_argument('--seed', metavar='N', type=whole_number, default=0,
                        help='another number gives other noise (default: %(default)s)')
    parser.add_argument('--no-progress', action='store_true', help='show no progress bar')
    parser.set_defaults(run=run, inputs=('model',), outputs={'output': ''})


def run(args: argparse.Namespace) -> int:
    """Write the recording and print its path."""
    from imu_allan.recordings.write import write_recording
    from imu_allan.sensor.noise_model import find_model, load_model
    from imu_allan.sensor.simulated_imu import simulated_blocks

    model = load_model(find_model(args.model))
    output = Path(args.output if args.output is not None else Path(args.model).stem)
    if output.exists():
        raise ImuAllanError(f'{output}: exists already; name another folder with --output')
    samples = round(args.rate * args.duration)
    if samples < 1:
        raise ImuAllanError(f'--duration {args.duration:g}: shorter than one sample at '
                            f'--rate {args.rate:g}; simulate for longer')
    # 2026-01-01, fixed so that the same command always writes the same file.
    blocks = simulated_blocks(model, args.rate, samples, seed=args.seed,
                              start_ns=1_767_225_600 * 10**9)
    with progress_bar(output, samples, wanted=not args.no_progress, in_bytes=False) as progress:
        write_recording(output, _counted(blocks, progress), storage=args.storage)
    print(output)
    return 0


def _counted(blocks: 'Iterator[ImuBlock]',
             progress: 'Callable[[int], None]') -> 'Iterator[ImuBlock]':
    done = 0
    for block in blocks:
        yield block
        done += len(block)
        progress(done)
