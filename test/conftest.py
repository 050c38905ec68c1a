# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""What holds for every test."""

from collections.abc import Callable, Iterator
from importlib import import_module
import os
from pathlib import Path
import re
import signal
import tempfile
from typing import Any, TYPE_CHECKING

from hypothesis import settings
from imu_allan.process import use_one_thread
import pytest
from sources import ON_PYPI_ALONE

if TYPE_CHECKING:
    from browser import Browser
    from imu_allan.result import Result

# A line that is not the one expected is shown beside it.
pytest.register_assert_rewrite('whole_lines')
# As the command and the node do.
use_one_thread()
# A suite that a script starts in the background inherits that Ctrl-C is ignored, and so would
# every process that the tests start and interrupt.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)
# No node of a test leaves anything in the home of whoever runs it.
os.environ['ROS_HOME'] = tempfile.mkdtemp(prefix='imu_allan_test_ros_home_')
# Workers of pytest-xdist are given 80 columns; what is tested is a pipe.
os.environ.pop('COLUMNS', None)
# Hundreds of commands and nodes are started; each would compile the whole package again.
os.environ.pop('PYTHONDONTWRITEBYTECODE', None)
# GNU readline, which pytest imports, says so to children alone, past os.environ.
os.unsetenv('COLUMNS')
# Hypothesis judges one example by the clock, the first of them with its imports; on a machine that
# is shared that says nothing. Who must be fast has a test of its own.
settings.register_profile('unhurried', deadline=None)
settings.load_profile('unhurried')


@pytest.fixture
def ran(capsys: pytest.CaptureFixture[str]) -> Callable[..., tuple[object, str, str]]:
    """Run the command here; gives its status, its output, and what it wrote to stderr."""
    from imu_allan.cli.main import main

    def run(*arguments: object) -> tuple[object, str, str]:
        capsys.readouterr()
        try:
            status: object = main([*map(str, arguments)])
        except SystemExit as stop:
            # As wrong usage, --help and --version do.
            status = stop.code
        return status, *capsys.readouterr()
    return run


@pytest.fixture
def fails_with(ran: Callable[..., tuple[object, str, str]]) -> Callable[..., str]:
    """Run the command here, of which one line is expected on stderr; gives its output."""
    from whole_lines import Varying

    def run(line: str, *arguments: object) -> str:
        status, out, err = ran(*arguments)
        assert err == Varying(f'imu_allan: {line}\n')
        assert status == 1
        return out
    return run


@pytest.fixture
def output_of(ran: Callable[..., tuple[object, str, str]]) -> Callable[..., str]:
    """Run the command here, which is to end well without a word on stderr; gives its output."""
    def run(*arguments: object) -> str:
        status, out, err = ran(*arguments)
        # Apart from the status, of which a failure shows the whole.
        assert err == ''
        assert status == 0
        return out
    return run


@pytest.fixture(scope='session')
def short_recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Half a minute of a simulated gyroscope, topic /imu/data_raw, MCAP."""
    from imu_allan.recordings.write import write_recording
    from imu_allan.sensor.noise_model import parse_model
    from imu_allan.sensor.simulated_imu import simulated_blocks

    blocks = simulated_blocks(parse_model('gyro: {noise_density: 0.3 deg/sqrt(h)}'), 100.0, 3000,
                              start_ns=10**18)
    return write_recording(tmp_path_factory.mktemp('recordings') / 'a', blocks)


@pytest.fixture(scope='session')
def result() -> 'Result':
    """Give a result that is looked at from every side."""
    from exact_results import build_result

    return build_result()


@pytest.fixture(scope='module')
def browser() -> 'Iterator[Browser]':
    """Run a browser for pages."""
    from browser import running_browser

    with running_browser() as browser:
        yield browser


@pytest.fixture
def children_unmeasured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Start no coverage in child processes: it imports modules and writes files of its own."""
    for name in ('COVERAGE_PROCESS_CONFIG', 'COVERAGE_PROCESS_START'):
        monkeypatch.delenv(name, raising=False)


def _skip_if_lacking(report: Any, call: Any, path: Path) -> None:
    """Skip what failed for want of a package that only PyPI has, where that is missing."""
    if not report.failed:
        return
    error = call and call.excinfo and call.excinfo.value
    while error is not None and not isinstance(error, ModuleNotFoundError):
        error = error.__cause__
    # A program of a test may have said so; a node has no excuse for a traceback.
    words = 'needs the Python package ' + ('' if 'node' in path.parts else "|No module named '")
    said = report.longreprtext + ''.join(text for _, text in report.sections)
    for name in ([] if error is None else [str(error.name).partition('.')[0]]) + re.findall(
            rf'(?:{words})(\w+)', said):
        if name in ON_PYPI_ALONE and not _importable(name):
            report.outcome = 'skipped'
            report.longrepr = (str(path), 1, f'Skipped: needs {name}, which rosdep does not '
                                             f'install: pip install {name}')
            return


def _importable(name: str) -> bool:
    try:
        return bool(import_module(name))
    except ModuleNotFoundError:
        return False


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[None]:
    """Skip a file of tests that imports what only PyPI has, where that is missing."""
    outcome: Any = yield
    report = outcome.get_result()
    _skip_if_lacking(report, getattr(report, 'call', None), collector.path)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item, call: pytest.CallInfo[None]) -> Iterator[None]:
    """Skip a test that comes upon something that only PyPI has, where that is missing."""
    outcome: Any = yield
    _skip_if_lacking(outcome.get_result(), call, item.path)
