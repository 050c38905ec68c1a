# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Explain what a finding means, how it is found, and what to do about it."""

import argparse
from difflib import get_close_matches
from typing import Any

from imu_allan.errors import ImuAllanError, printable
from imu_allan.writers.terminal import console_of, wrapped


def register(verbs: Any) -> None:
    """Add the verb and its options to the command."""
    parser = verbs.add_parser(
        'explain', help='what a finding means and what to do about it',
        usage='%(prog)s [CODE] [options]',
        examples=('explain not_steady',),
        description='Say what a finding of a result means, how it is found, and what to do about '
                    'it. Without CODE all findings are listed.')
    parser.add_argument('code', metavar='CODE', nargs='*',
                        help='code or name of a finding, such as not_steady')
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the explanation of a code, or a list of all codes."""
    from imu_allan.finding_messages import explained
    from imu_allan.finding_texts import WORDS

    if not args.code:
        width = max(map(len, WORDS))
        print('\n'.join(f'{code:<{width}}  {words.title}' for code, words in WORDS.items()))
        return 0
    given = ' '.join(args.code)
    asked = _plain(given)
    # A result shows the name, which two codes may share.
    codes = [code for code, words in WORDS.items() if asked in (code, _plain(words.title))]
    if not codes:
        by_name = {_plain(words.title): code for code, words in WORDS.items()}
        near = get_close_matches(asked, [*WORDS, *by_name], n=1)
        hint = f'; did you mean {by_name.get(near[0], near[0])}?' if near else ''
        shown = printable(given) if given.strip() else repr(given)
        raise ImuAllanError(f'{shown}: no finding has this code{hint} '
                            '(all: imu_allan explain)')
    console = console_of()
    for place, code in enumerate(codes):
        console.print(*([''] if place else []),
                      *wrapped(explained(code), min(console.width, 80)), sep='\n')
    return 0


def _plain(name: str) -> str:
    """Write a code or a name as codes are written."""
    return '_'.join(name.lower().replace('-', ' ').split())
