# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Entry point of the command `imu_allan`.

Each verb is a module of this package with ``register(verbs)``, which describes its options, and
``run(args)``, which does the work and returns the exit status. Only ``run`` imports what the work
needs, so ``imu_allan --help`` loads neither numpy nor matplotlib nor a bag reader.
"""

import argparse
from collections.abc import Sequence
from contextlib import nullcontext, redirect_stdout
from difflib import get_close_matches
import errno
import os
from pathlib import Path
import sys
from typing import Any

from imu_allan.cli import analyze, check, explain, export, info, report, simulate, tune
from imu_allan.cli.arguments import Shown
from imu_allan.errors import ImuAllanError, printable, shorten
from imu_allan.process import drop_stdout, EXIT_BROKEN_PIPE, exit_status
from imu_allan.version import __version__


def command_parser() -> argparse.ArgumentParser:
    """Build the parser of the whole command, with every verb."""
    parser = _Parser(
        prog='imu_allan',
        description='How noisy is this IMU? Allan deviation and the noise coefficients that '
                    'filters want, each with its 95 % interval, from a recording made while the '
                    'IMU lay still.',
        epilog='exit status: 0 done; 1 known error, one line on stderr; 2 wrong usage; '
               '3 check: a limit is not met; 4 check cannot tell.',
        examples=('analyze imu_at_rest --output out',
                  'export out --for kalibr --output imu.yaml',
                  'simulate consumer_mems --output imu_at_rest'))
    parser.add_argument('--version', action='version', version=f'imu_allan {__version__}')
    verbs = parser.add_subparsers(title='verbs', metavar='VERB', dest='verb', required=True)
    for verb in (analyze, info, simulate, check, tune, export, report, explain):
        verb.register(verbs)
    for verb_parser in verbs.choices.values():
        verb_parser.set_defaults(parser=verb_parser)
    return parser


class _Parser(argparse.ArgumentParser):
    """
    Parser whose help begins with the most common options, and whose errors take two lines.

    Parameters
    ----------
    short : str, optional
        The options that --help shows, without their dashes; --help-all shows all options.
    examples : sequence of str, optional
        Command lines, without `imu_allan`, to show at the end of the help.

    """

    def __init__(self, *args: Any, short: str = '', examples: Sequence[str] = (), **kwargs: Any
                 ) -> None:
        super().__init__(*args, **kwargs)
        self._short = {f'--{name}' for name in f'help help-all {short}'.split()} if short else None
        self._examples = ''.join(f'  imu_allan {line}\n' for line in examples)
        if short:
            self.add_argument('--help-all', action=Shown, nargs=0,
                              const=lambda: self.format_help(whole=True),
                              help='show every option and exit')

    def format_help(self, *, whole: bool = False) -> str:
        """Return the help; unless `whole`, without the options that few users need."""
        formatter = self._get_formatter()
        formatter.add_text(self.description)
        for group in self._action_groups:
            actions = [action for action in group._group_actions
                       if whole or self._short is None or not action.option_strings
                       or {*action.option_strings} & self._short]
            if actions:
                formatter.start_section(group.title)
                formatter.add_arguments(actions)
                formatter.end_section()
        formatter.add_text(self.epilog)
        examples = f'\nexamples:\n{self._examples}' if self._examples else ''
        return f'{self.format_usage()}\n{formatter.format_help()}{examples}'


def _parsed(argv: Sequence[str] | None) -> argparse.Namespace:
    """Parse the arguments; report an unknown one with the usage of its verb."""
    parser = command_parser()
    args, unknown = parser.parse_known_args(argv)
    if unknown:
        verb: _Parser = args.parser
        options = [name for action in verb._actions for name in action.option_strings
                   if action.help is not argparse.SUPPRESS]
        near = get_close_matches(unknown[0].partition('=')[0], options, n=1)
        hint = f'; did you mean {near[0]}?' if near else ''
        [place, *_] = [action for action in verb._actions if not action.option_strings]
        if place.nargs in (None, '?') and not unknown[0].startswith('-'):
            hint = f'; {verb.prog} takes one {place.metavar} at a time'
        verb.error(f'unrecognized arguments: {shorten(printable(" ".join(unknown)), 100)}{hint}')
    return args


def _require_apart(args: argparse.Namespace) -> None:
    """
    Refuse an output that is an input, or an existing file of another kind.

    The defaults `inputs` and `outputs` of each verb list which of its arguments are which. Outputs
    have a kind (`imu_allan.writers.atomic`), which is empty for a folder.
    """
    from imu_allan.writers.atomic import require_replaceable

    given = [(name.replace('_', ' '), path) for name in getattr(args, 'inputs', ())
             for path in _paths(args, name)]
    written = [(f'--{name}', path, kind) for name, kind in getattr(args, 'outputs', {}).items()
               for path in _paths(args, name)]
    for name, path, *_ in (*given, *written):
        if not path:
            raise ImuAllanError(f"{name} '': names no file; is a variable of the shell empty?")
    for name, path, kind in written:
        if path == '-' and not kind:
            raise ImuAllanError(f'{name} -: standard output is no folder; name one')
        is_file = Path(path).is_file()
        if is_file and any(Path(other).exists() and Path(path).samefile(other)
                           for _, other in given):
            raise ImuAllanError(f'{name} {printable(path)}: is an input of this command, which '
                                'would be overwritten; name another file')
        if is_file and kind:
            require_replaceable(path, kind)


def _leave_stdout(args: argparse.Namespace) -> bool:
    """Name standard output where an output is -; return whether nothing else may go there."""
    names = [name for name in getattr(args, 'outputs', ()) if getattr(args, name) == '-']
    for name in names:
        setattr(args, name, '/dev/stdout')
    return bool(names)


def _paths(args: argparse.Namespace, name: str) -> list[str]:
    found = getattr(args, name)
    return [] if found is None else [found] if isinstance(found, str) else list(found)


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command with arguments, by default those of the process; return its exit status."""
    for stream in (sys.stdout, sys.stderr):
        # A terminal that cannot show a micro sign must not end the program.
        getattr(stream, 'reconfigure', lambda **_: None)(errors='backslashreplace')
    try:
        args = _parsed(argv)
        _require_apart(args)
        with redirect_stdout(sys.stderr) if _leave_stdout(args) else nullcontext():
            status = args.run(args)
        sys.stdout.flush()
        return int(status)
    except ImuAllanError as error:
        return _fail(str(error))
    except ModuleNotFoundError as error:
        package = (error.name or '').partition('.')[0]
        # These may be missing after rosdep; their names are the same in pip and in Python.
        if package not in ('isal', 'lz4', 'mcap', 'rich', 'rosbags', 'scipy', 'zstandard'):
            raise
        return _fail(f'needs the Python package {package}, which is not installed: '
                     f'pip install {package}')
    except BrokenPipeError:
        drop_stdout()
        return EXIT_BROKEN_PIPE
    except KeyboardInterrupt:
        return exit_status()
    except OSError as error:
        if error.filename is None and error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            # Functions that write files name them in errors, so this is standard output.
            drop_stdout()
            return _fail(f'standard output: {error.strerror}')
        if error.filename is None or error.strerror is None:
            raise
        return _fail(f'{os.fsdecode(error.filename)}: {error.strerror}')


def _fail(message: str) -> int:
    print(f'imu_allan: {printable(message)}', file=sys.stderr)
    # Not 2, which argparse uses for wrong usage.
    return 1


if __name__ == '__main__':
    sys.exit(main())
