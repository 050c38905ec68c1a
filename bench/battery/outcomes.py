# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
What became of each record: reported or not, inside or not, how wide, at what score.

This is run in the checkout that is judged, and writes a line of JSON for every record:

    python -m battery.outcomes --only standard bends --records 4 --seed 7 > outcomes.jsonl
"""

import argparse
from collections.abc import Iterator, Sequence
from concurrent.futures import as_completed, ProcessPoolExecutor
from dataclasses import asdict, dataclass
import json
import math
import sys
from zlib import crc32

from battery import cases, doors, recordings
from battery.bounds import corner_costs, reference_widths
from battery.cases import Case
from battery.doors import Answer, Said
from battery.sensors import TERMS
import numpy as np

_AT_ONCE = 10
"""Spectra that are drawn and fitted as one job."""
_MISS = 2 / 0.05
"""What a miss costs beside a width of as much: Gneiting and Raftery, JASA 102 (2007), eq. 43."""


@dataclass(frozen=True)
class Verdict:
    """
    What became of one term.

    Attributes
    ----------
    truth : float
        Zero for a term that is not there.
    reported : bool
    inside : bool or None
        An upper bound holds the truth where that is below it; None where nothing is said.
    width : float or None
        Of the interval, over that of the Cramer-Rao bound; None for a bound alone.
    free : float or None
        The same over the bound of one who does not know the corner of the filter.
    score : float or None
        Of the interval, or of (0, bound), over the width of the Cramer-Rao bound; None where
        nothing is said.

    """

    truth: float
    reported: bool
    inside: bool | None
    width: float | None
    free: float | None
    score: float | None


def verdict(said: Said, truth: float, reference: float, corner_cost: float) -> Verdict:
    """Hold what is said of a term against the truth."""
    if said.interval is not None:
        low, high = said.interval
    elif said.bound is not None:
        low, high = 0.0, said.bound
    else:
        return Verdict(truth, False, None, None, None, None)
    miss = max(low - truth, truth - high, 0.0)
    score = (high - low + _MISS * miss) / reference
    width = (high - low) / reference if said.value is not None else None
    return Verdict(truth, said.value is not None, miss == 0, width,
                   None if width is None else width / corner_cost,
                   score if math.isfinite(score) else None)


def outcome(part: str, case: Case, seed: int, answer: Answer, references: dict[str, float],
            costs: dict[str, float]) -> dict[str, object]:
    """Gather what became of one record."""
    terms = {key: asdict(verdict(answer.terms[key], case.sensor.terms.get(key, 0.0),
                                 references[key], costs[key]))
             for key in TERMS if key not in case.unknown}
    return {'part': part, 'family': case.family, 'case': case.name, 'seed': seed,
            'cpu_s': answer.cpu_s, 'codes': answer.codes, 'terms': terms}


def of_record(number: int, seed: int) -> list[dict[str, object]]:
    """Draw a record of a case, characterize it and judge what is said."""
    case = cases.RECORDS[number]
    rng = np.random.default_rng([seed, crc32(f'{case.family} {case.name}'.encode())])
    answer = doors.of_samples(case.sensor.record(rng), case.sensor.rate_hz)
    return [outcome('records', case, seed, answer, reference_widths(case.sensor),
                    corner_costs(case.sensor))]


def of_spectra(number: int, seed: int, count: int) -> list[dict[str, object]]:
    """Draw some spectra, fit them and judge what is said; the seed is that of all of them."""
    case = cases.SPECTRA[number]
    references, costs = reference_widths(case.sensor), corner_costs(case.sensor)
    own = crc32(f'{case.family} {case.name} {seed}'.encode())
    return [outcome('spectra', case, seed + one, answer, references, costs)
            for one, answer in enumerate(doors.of_spectra(case.sensor, count, own))]


def chosen(found: Sequence[Case], only: Sequence[str]) -> list[tuple[int, Case]]:
    """Return the cases that are named, by family or by name, with their numbers."""
    return [(number, case) for number, case in enumerate(found)
            if not only or case.family in only or case.name in only]


def run(parts: Sequence[str], only: Sequence[str], records: int | None, seed: int, jobs: int
        ) -> Iterator[dict[str, object]]:
    """Yield what became of every record, as they are done."""
    with ProcessPoolExecutor(jobs) as pool:
        work = []
        if 'recordings' in parts and not only:
            work += [pool.submit(recordings.of_axis, *axis) for axis in recordings.axes()]
        if 'records' in parts:
            some = chosen(cases.RECORDS, only)
            # The longest first, lest one process waits for the other at the end.
            for number, case in sorted(some, key=lambda one: -one[1].sensor.samples):
                work += [pool.submit(of_record, number, seed + one)
                         for one in range(records or case.records)]
        if 'spectra' in parts:
            for number, case in chosen(cases.SPECTRA, only):
                count = records or case.records
                work += [pool.submit(of_spectra, number, seed + first,
                                     min(_AT_ONCE, count - first))
                         for first in range(0, count, _AT_ONCE)]
        for done, future in enumerate(as_completed(work), 1):
            print(f'\r{done} of {len(work)} jobs ', end='', file=sys.stderr, flush=True)
            yield from future.result()
    print(file=sys.stderr)


def main() -> int:
    """Write the outcomes to standard output."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--parts', nargs='+', choices=cases.PARTS, default=cases.PARTS)
    parser.add_argument('--only', nargs='*', default=[])
    parser.add_argument('--records', type=int)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--jobs', type=int, default=2)
    options = parser.parse_args()
    for one in run(options.parts, options.only, options.records, options.seed, options.jobs):
        print(json.dumps(one), flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(main())
