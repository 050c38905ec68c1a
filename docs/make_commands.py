# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Write docs/commands.md from the parsers of the command itself.

    .venv/bin/python docs/make_commands.py
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

from imu_allan.cli.main import command_parser

HEAD = """\
# Every option of the command

Made from the command's own help by `docs/make_commands.py`.

Results go to stdout, messages to stderr. Exit status: 0 done; 1 a known error, as one line on
stderr that names the file, topic or option and what to do; 2 wrong usage; 3 `check` found a
specification that is not met; 4 `check` cannot tell; 130 after Ctrl-C. A traceback
means a bug.
"""


def page() -> str:
    """Return the text of the page."""
    parser = command_parser()
    [verbs] = [action for action in parser._actions
               if isinstance(action, argparse._SubParsersAction)]
    return '\n'.join([HEAD, *(line for name, verb in verbs.choices.items()
                              for line in section(name, verb))])


def section(name: str, verb: argparse.ArgumentParser) -> Iterator[str]:
    """Yield the lines about one verb."""
    names = ' '.join(argument(action) for action in verb._actions if not action.option_strings)
    yield f'## imu_allan {name} {names}'
    yield ''
    yield verb.description or ''
    yield ''
    yield '| | |'
    yield '| --- | --- |'
    for action in verb._actions:
        if action.help in (None, argparse.SUPPRESS) or {'--help', '--help-all'} & {
                *action.option_strings}:
            continue
        text = action.help % {**vars(action), 'prog': verb.prog}
        yield '| {} | {} |'.format(*(cell.replace('|', '\\|')
                                     for cell in (f'`{argument(action)}`', text)))
    yield ''


def argument(action: argparse.Action) -> str:
    """Write an argument as a user types it."""
    value = action.metavar if isinstance(action.metavar, str) else '|'.join(action.choices or ())
    if not action.option_strings:
        return f'{value}...' if action.nargs == '+' else value
    name = action.option_strings[-1]
    return name if action.nargs == 0 else f'{name} {value}'


if __name__ == '__main__':
    (Path(__file__).parent / 'commands.md').write_text(page())
