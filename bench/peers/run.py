# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Compare Allan tools and write docs/peers.md.

    python bench/peers/run.py                        # everything; `make bench-peers` calls it
    python bench/peers/run.py --parts accuracy --cases a b --records 2
    python bench/peers/run.py --parts accuracy published --tools ours
    python bench/peers/run.py --row b wavelets
    python bench/peers/run.py --parts                # the page from the figures that there are

Figures are kept in bench/peers/figures.json: a part, a case or a tool that is run anew replaces
what was there of it.
"""

import argparse
import json
from pathlib import Path
import sys

import accuracy
from adapters import adapter, KEYS
from page import page
from simulated import CASES

HERE = Path(__file__).parent
FIGURES = HERE / 'figures.json'
PAGE = HERE.parents[1] / 'docs' / 'peers.md'
PARTS = ('accuracy', 'published', 'speed')


def main() -> int:
    """Run what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('--parts', nargs='*', choices=PARTS, default=list(PARTS))
    parser.add_argument('--cases', nargs='+', choices=list(CASES), default=list(CASES))
    parser.add_argument('--tools', nargs='+', choices=KEYS, default=list(KEYS))
    parser.add_argument('--records', type=int, default=4, help='of six axes, each case')
    parser.add_argument('--row', nargs=2, metavar=('CASE', 'TOOL'),
                        help='print the scores of one tool in one case, and write nothing')
    parser.add_argument('--messages', type=int, nargs='+', default=[100_000, 1_000_000, 3_000_000])
    parser.add_argument('--repeats', type=int, default=3)
    options = parser.parse_args()
    if options.row:
        case, tool = options.row
        if case not in CASES or tool not in KEYS:
            parser.error(f'--row takes one of {", ".join(CASES)} and one of {", ".join(KEYS)}')
        print(json.dumps(accuracy.run([case], [tool], options.records)[case]['tools'][tool],
                         indent=1))
        return 0
    figures = json.loads(FIGURES.read_text()) if FIGURES.is_file() else {}
    if options.parts:
        figures['tools'] = {key: {'name': adapter(key).NAME, 'origin': adapter(key).ORIGIN}
                            for key in KEYS}
    for part in options.parts:
        if part == 'accuracy':
            for case in options.cases:
                old = figures.get('accuracy', {})
                found = accuracy.run([case], options.tools, options.records)[case]
                if old.get(case, {}).get('records') == options.records:
                    found['tools'] = old[case]['tools'] | found['tools']
                old = old | {case: found}
                figures['accuracy'] = {key: old[key] for key in CASES if key in old}
                FIGURES.write_text(json.dumps(figures, indent=1) + '\n')
        elif part == 'published':
            import published
            found = published.run(options.tools)
            found['tools'] = figures.get('published', {}).get('tools', {}) | found['tools']
            figures['published'] = found
        else:
            import speed
            figures['speed'] = speed.run(options.messages, options.repeats)
        FIGURES.write_text(json.dumps(figures, indent=1) + '\n')
    PAGE.write_text(page(figures))
    print(f'{PAGE} written')
    return 0


if __name__ == '__main__':
    sys.exit(main())
