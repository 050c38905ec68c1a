# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The exception that imu_allan raises for unusable input, and functions that make text safe."""


class ImuAllanError(ValueError):
    """
    A problem the user can act on.

    The message is one line: it names the file, topic, field or option and says what to do. The
    command prints it on stderr and exits with status 1; any other exception is a bug and keeps its
    traceback.
    """


def printable(text: object) -> str:
    r"""
    Make text from files (paths, topics, frame_id) safe for one line of a terminal.

    Newlines, escape sequences, lone surrogates and other control characters appear as escapes
    such as ``\n``; printable characters are unchanged.
    """
    return ''.join(
        character if character.isprintable() else character.encode('unicode_escape').decode()
        for character in str(text))


def shorten(text: str, longest: int = 200) -> str:
    """Return `text`, with its middle left out if it is longer than `longest`."""
    if len(text) <= longest:
        return text
    half = (longest - 1) // 2
    return f'{text[:half]}…{text[-half:]}'


def brief(text: str, longest: int = 200) -> str:
    """Return text from a file for one line of a terminal, shortened as by `shorten`."""
    return printable(shorten(text, longest))
