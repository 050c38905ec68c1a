# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The battery: what a checkout says of a frozen set of sensors, and where two of them differ.

Some 900 records go through the door that users take, some 3,000 spectra are drawn and fitted, and
real recordings are held against their own parts. Sensors, seeds and simulators are the battery's
own. Of every term it is written down whether it was reported, whether its interval holds the
truth, how wide that is over the exact Cramer-Rao bound's, and its interval score: width plus 40
times the miss, over the same; a bound alone counts as the interval (0, bound).

    make battery                                          # this checkout
    make battery BASE=../older                            # and where it differs from another
    make battery BASE=older.json BATTERY_ARGS='--only standard bends --records 40 --seed 1000'

What a checkout says follows from its commit, so no outcomes are kept in the repository: `--output`
writes them to a file, which can be the base, in place of the checkout, of a later run.
"""

import argparse
from collections.abc import Sequence
import json
import os
from pathlib import Path
import subprocess
import sys
from typing import Any

from battery.cases import NAMES, PARTS
from battery.tables import differences, table

BENCH = Path(__file__).resolve().parents[1]


def outcomes_of(checkout: Path, arguments: Sequence[str]) -> list[dict[str, Any]]:
    """Run the battery with the package of a checkout, or read what an earlier run has written."""
    if checkout.is_file():
        return list(json.loads(checkout.read_text())['outcomes'])
    if not (checkout / 'imu_allan' / '__init__.py').is_file():
        sys.exit(f'{checkout}: no checkout of imu_allan, and no file of outcomes')
    path = os.pathsep.join((str(BENCH), str(checkout)))
    # Two processes of one thread each, whatever the machine: times are those of one core.
    environment = {**os.environ, 'PYTHONPATH': path, 'OMP_NUM_THREADS': '1',
                   'OPENBLAS_NUM_THREADS': '1', 'MKL_NUM_THREADS': '1'}
    if data := os.environ.get('IMU_ALLAN_DATA'):
        environment['IMU_ALLAN_DATA'] = str(Path(data).resolve())
    print(f'{checkout} ...', file=sys.stderr)
    # Python looks into the current folder first, which may be another checkout.
    done = subprocess.run([sys.executable, '-m', 'battery.outcomes', *arguments], cwd=checkout,
                          env=environment, stdout=subprocess.PIPE, text=True, check=False)
    if done.returncode:
        sys.exit(f'the battery failed in {checkout}')
    return ordered([json.loads(line) for line in done.stdout.splitlines()])


def ordered(outcomes: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return outcomes in an order that does not depend on which was done first."""
    return sorted(outcomes, key=lambda one: (one['part'], one['family'], one['case'],
                                             one['seed']))


def commit(checkout: Path) -> str:
    """Return the commit of a checkout, with a word where it has changes besides."""
    done = subprocess.run(['git', '-C', checkout, 'describe', '--always', '--dirty'],
                          capture_output=True, text=True, check=False)
    return done.stdout.strip() or 'unknown'


def main() -> int:
    """Run the battery in one checkout, or in two."""
    parser = argparse.ArgumentParser(prog='battery', description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--checkout', type=Path, default=BENCH.parent, metavar='FOLDER|FILE',
                        help='what is judged (this one), or the outcomes of it')
    parser.add_argument('--base', type=Path, metavar='FOLDER|FILE',
                        help='the checkout it is compared with, or the outcomes of it')
    parser.add_argument('--output', type=Path, metavar='FILE', help='write the outcomes as JSON')
    parser.add_argument('--parts', nargs='+', choices=PARTS, help='of the battery (all)')
    parser.add_argument('--only', nargs='+', metavar='NAME', help='families or cases (all)')
    parser.add_argument('--records', type=int, help='of every case')
    parser.add_argument('--seed', type=int, default=0, help='other records of the same sensors')
    parser.add_argument('--jobs', type=int, default=2, help='processes')
    options = parser.parse_args()
    unknown = set(options.only or ()) - NAMES
    if unknown:
        parser.error(f'--only: no family and no case is called {", ".join(sorted(unknown))}')
    arguments = ['--seed', str(options.seed), '--jobs', str(options.jobs)]
    for name in ('parts', 'only'):
        if getattr(options, name):
            arguments += [f'--{name}', *getattr(options, name)]
    if options.records:
        arguments += ['--records', str(options.records)]
    found = outcomes_of(options.checkout.resolve(), arguments)
    if options.output is not None:
        options.output.write_text(json.dumps({
            'commit': commit(options.checkout), 'seed': options.seed, 'outcomes': found}) + '\n')
    print('\n'.join(table(found)))
    if options.base is not None:
        before = outcomes_of(options.base.resolve(), arguments)
        print('\n'.join(('', *differences(before, found))))
    return 0


if __name__ == '__main__':
    sys.exit(main())
