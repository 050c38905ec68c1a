# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What holds for every test."""

import os
import signal

from hypothesis import settings
from imu_allan.blas_threads import use_one_thread
import pytest

# A line that is not the one expected is shown beside it.
pytest.register_assert_rewrite('whole_lines')
# As the command and the node do.
use_one_thread()
# A suite that a script starts in the background inherits that Ctrl-C is ignored, and so would
# every process that the tests start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# Workers of pytest-xdist are told that they are 80 columns wide; what is tested is a pipe.
os.environ.pop('COLUMNS', None)
# GNU readline, which pytest imports, says so to children alone, past os.environ.
os.unsetenv('COLUMNS')
# Hypothesis judges one example by the clock, the first of them with its imports; on a machine that
# is shared that says nothing. Who must be fast has a test of its own.
settings.register_profile('unhurried', deadline=None)
settings.load_profile('unhurried')


@pytest.fixture
def children_unmeasured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Start no coverage in child processes: it imports modules and writes files of its own."""
    for name in ('COVERAGE_PROCESS_CONFIG', 'COVERAGE_PROCESS_START'):
        monkeypatch.delenv(name, raising=False)
