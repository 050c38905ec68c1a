# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Where the command `imu_allan`, which is `python -m imu_allan`, begins."""

import os
import signal

EXIT_INTERRUPTED = 130
"""As a shell reports the signal: 128 + SIGINT."""


def main() -> int:
    """Run the command; Ctrl-C during its imports ends it without a word, too."""
    before = signal.getsignal(signal.SIGINT)
    if before is signal.default_int_handler:
        # An exception would be told with a traceback, and forgotten in a callback of an import.
        signal.signal(signal.SIGINT, lambda *_: os._exit(EXIT_INTERRUPTED))
    from imu_allan.cli.main import main as run

    signal.signal(signal.SIGINT, before)
    return run()


if __name__ == '__main__':
    raise SystemExit(main())
