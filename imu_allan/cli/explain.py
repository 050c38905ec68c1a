# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Explain what a finding means, how it is found, and what to do about it."""

import argparse
from difflib import get_close_matches
from typing import Any

from imu_allan.errors import ImuAllanError, printable
from imu_allan.writers.terminal import columns_of


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'explain', help='what a finding means and what to do about it',
        examples=('explain not_steady',),
        description='Say what a finding of a result means, how it is found, and what to do about '
                    'it. Without CODE all findings are listed.')
    parser.add_argument('code', metavar='CODE', nargs='?',
                        help='code of a finding, such as not_steady')
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the explanation of a code, or a list of all codes."""
    import sys
    from textwrap import fill

    from imu_allan.writers.sentences import WORDS
    from imu_allan.writers.words import explained

    if args.code is None:
        width = max(map(len, WORDS))
        print('\n'.join(f'{code:<{width}}  {words.title}' for code, words in WORDS.items()))
        return 0
    code = args.code.strip().lower().replace(' ', '_').replace('-', '_')
    by_title = {words.title.replace(' ', '_'): name for name, words in WORDS.items()}
    code = code if code in WORDS else by_title.get(code, code)
    if code not in WORDS:
        near = get_close_matches(code, [*WORDS, *by_title], n=1)
        hint = f'; did you mean {by_title.get(near[0], near[0])}?' if near else ''
        asked = printable(args.code) if args.code.strip() else repr(args.code)
        raise ImuAllanError(f'{asked}: no finding has this code{hint} '
                            '(all: imu_allan explain)')
    columns = columns_of(sys.stdout) or 80
    print('\n'.join(fill(line, columns, subsequent_indent='  ', break_on_hyphens=False)
                    for line in explained(code)))
    return 0
