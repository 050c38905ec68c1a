# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Write docs/commands.md from the parsers of the command itself.

    .venv/bin/python docs/make_commands.py
"""

import argparse
from pathlib import Path

from imu_allan.cli.main import command_parser

HEAD = """\
# Every option of the command

Results go to stdout, messages to stderr. A traceback means a bug.

| exit status | |
| --- | --- |
| 0 | done |
| 1 | a known error, in one line |
| 2 | wrong usage |
| 3 | `check` found a limit that is not met |
| 4 | `check` cannot tell |
| 130, 143 | after Ctrl-C, SIGTERM |
"""
READERS = 'Options of every verb that reads a recording'
BOTH = 'Options of analyze and check'


def page() -> str:
    """Return the text of the page; options that several verbs share are described once."""
    parser = command_parser()
    [verbs] = [action for action in parser._actions
               if isinstance(action, argparse._SubParsersAction)]
    rows = {name: described(verb) for name, verb in verbs.choices.items()}
    both = [row for row in rows['analyze'] if row in rows['check'] and row not in rows['info']]
    readers = [row for row in rows['info'] if row in rows['analyze'] and row in rows['tune']]
    lines = [HEAD]
    for name, verb in verbs.choices.items():
        apart = [(title, shared) for title, shared in ((BOTH, both), (READERS, readers))
                 if {*shared} <= {*rows[name]}]
        own = [row for row in rows[name] if not any(row in shared for _, shared in apart)]
        names = ' '.join(argument(action) for action in verb._actions
                         if not action.option_strings)
        lines += [f'## imu_allan {name} {names}', '', f'{purpose(verb)}.', '', *entries(own)]
        if apart:
            lines += [f'Also: {" and ".join(title.lower() for title, _ in apart)}.', '']
    for title, shared in ((BOTH, both), (READERS, readers)):
        lines += [f'## {title}', '', *entries(shared)]
    return '\n'.join(lines)


def purpose(verb: argparse.ArgumentParser) -> str:
    """Return the first sentence of what the help of a verb says."""
    return (verb.description or '').partition('. ')[0].rstrip('.')


def entries(rows: list[str]) -> list[str]:
    """Return rows as a list, and an empty line."""
    return [*rows, ''] if rows else []


def described(verb: argparse.ArgumentParser) -> list[str]:
    """Return an entry of each argument of a verb that its help shows."""
    rows = []
    for action in verb._actions:
        if action.help in (None, argparse.SUPPRESS) or {'--help', '--help-all'} & {
                *action.option_strings}:
            continue
        text = action.help % {**vars(action), 'prog': verb.prog}
        rows.append(f'- `{argument(action)}`: {text}')
    return rows


def argument(action: argparse.Action) -> str:
    """Write an argument as a user types it."""
    value = action.metavar if isinstance(action.metavar, str) else '|'.join(action.choices or ())
    if not action.option_strings:
        return f'{value}...' if action.nargs == '+' else value
    name = action.option_strings[-1]
    return name if action.nargs == 0 else f'{name} {value}'


if __name__ == '__main__':
    (Path(__file__).parent / 'commands.md').write_text(page())
