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
import traceback
from typing import Any

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
def fails_with(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run the command here, of which one line is expected on stderr; gives its output."""
    from imu_allan.cli.main import main
    from whole_lines import Varying

    def run(line: str, *arguments: object) -> str:
        capsys.readouterr()
        assert main([*map(str, arguments)]) == 1
        shown = capsys.readouterr()
        assert shown.err == Varying(f'imu_allan: {line}\n')
        return shown.out
    return run


@pytest.fixture
def output_of(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run the command here, which is to end well without a word on stderr; gives its output."""
    from imu_allan.cli.main import main

    def run(*arguments: object) -> str:
        capsys.readouterr()
        try:
            status: object = main([*map(str, arguments)])
        except SystemExit as stop:
            # As --help and --version do.
            status = stop.code
        shown = capsys.readouterr()
        assert shown.err == ''
        assert status == 0
        return shown.out
    return run


@pytest.fixture
def wrong_usage(capsys: pytest.CaptureFixture[str]) -> Callable[..., None]:
    """Run the command here, of which its usage is expected, and a line that ends so."""
    from imu_allan.cli.main import main
    from whole_lines import Varying

    def run(line: str, *arguments: object) -> None:
        capsys.readouterr()
        with pytest.raises(SystemExit) as stop:
            main([*map(str, arguments)])
        assert stop.value.code == 2
        shown = capsys.readouterr()
        assert shown.out == ''
        usage, error = shown.err.splitlines()
        assert usage.startswith('usage: imu_allan')
        assert error == Varying(f'imu_allan{line}')
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


@pytest.fixture
def children_unmeasured(monkeypatch: pytest.MonkeyPatch) -> None:
    """Start no coverage in child processes: it imports modules and writes files of its own."""
    for name in ('COVERAGE_PROCESS_CONFIG', 'COVERAGE_PROCESS_START'):
        monkeypatch.delenv(name, raising=False)


ON_PYPI_ALONE = frozenset((
    'allantools', 'isal', 'lz4', 'mcap', 'plotly', 'rich', 'rosbags', 'zstandard'))
"""A test that needs one of them skips where it is missing."""
ROOT = Path(__file__).parents[1]
MAY_ASK = ('test', 'imu_allan/recordings', 'imu_allan/cli', 'imu_allan/writers')
"""Tests and the offline tool. Where numerics or nodes ask, a missing package is a fault."""


def _lacking(error: BaseException | None) -> str | None:
    """Name the package of PyPI for want of which a test ended; None where that is no excuse."""
    while error is not None:
        name = error.name if isinstance(error, ModuleNotFoundError) else None
        if name is not None and name.partition('.')[0] in ON_PYPI_ALONE:
            places = [Path(frame.filename) for frame in traceback.extract_tb(error.__traceback__)]
            asking = [place for place in places if ROOT in place.parents]
            if asking and asking[-1].relative_to(ROOT).as_posix().startswith(MAY_ASK):
                return name.partition('.')[0]
        error = error.__cause__
    return None


def _said(text: str, path: Path) -> str | None:
    """Name the package of PyPI that a program of a test said it lacks, and that is lacking."""
    # A node has no excuse for a traceback.
    words = 'needs the Python package ' + ('' if 'node' in path.parts else "|No module named '")
    for name in re.findall(rf'(?:{words})(\w+)', text):
        if name in ON_PYPI_ALONE:
            try:
                import_module(name)
            except ModuleNotFoundError:
                return str(name)
    return None


def _skip_if_lacking(report: Any, error: BaseException | None, path: Path) -> None:
    if report.failed and (name := _lacking(error) or _said(report.longreprtext + ''.join(
            text for _, text in report.sections), path)):
        report.outcome = 'skipped'
        report.longrepr = (str(path), 1, f'Skipped: needs {name}, which rosdep does not install: '
                                         f'pip install {name}')


@pytest.hookimpl(hookwrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[None]:
    """Skip a file of tests that imports what only PyPI has, where that is missing."""
    outcome: Any = yield
    report = outcome.get_result()
    call = getattr(report, 'call', None)
    _skip_if_lacking(report, call and call.excinfo and call.excinfo.value, collector.path)


@pytest.hookimpl(hookwrapper=True)
def pytest_runtest_makereport(item: pytest.Item,
                              call: pytest.CallInfo[None]) -> Iterator[None]:
    """Skip a test that comes upon something that only PyPI has, where that is missing."""
    outcome: Any = yield
    _skip_if_lacking(outcome.get_result(), call.excinfo and call.excinfo.value, item.path)
