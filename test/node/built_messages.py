# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Message packages built as a workspace builds them, with the generators of ROS and a compiler."""

from collections.abc import Mapping
import ctypes
import os
from pathlib import Path
import re
import shutil
import subprocess
import sys
import sysconfig

import numpy as np
import pytest

_PREFIX = Path(sys.prefix)
_GENERATE = """
import sys
from importlib import import_module
from pathlib import Path
package, output, *files = sys.argv[1:]
share = Path(sys.prefix) / 'share'
for kind, name in (('rosidl_generator_c', 'GenerateC'), ('rosidl_generator_py', 'GeneratePython'),
                   ('rosidl_typesupport_c', 'GenerateCTypesupport'),
                   ('rosidl_typesupport_fastrtps_c', 'GenerateFastRTPSCTypesupport'),
                   ('rosidl_typesupport_introspection_c', 'GenerateIntrospectionCTypesupport')):
    maker = getattr(import_module(kind + '.cli'), name)(kind)
    maker.generate(package, files, [str(share)], Path(output) / kind)
"""


def build(folder: Path, package: str, definitions: Mapping[str, str]) -> dict[str, str]:
    """
    Build a package of message types; return the environment in which it is sourced.

    A definition is the text of a type, and behind lines of ``=`` those of other types, each with
    ``MSG: package/Name`` above it. Types of installed packages are taken from there.
    """
    if shutil.which('g++') is None or not (_PREFIX / 'share' / 'rosidl_generator_py').is_dir():
        pytest.skip('no compiler, or no generators of messages')
    texts = {}
    for kind, definition in definitions.items():
        first, *others = re.split(r'\n?={10,}\n', definition)
        texts[kind.split('/')[2]] = first
        for text in others:
            head, _, body = text.partition('\n')
            owner, _, name = head.removeprefix('MSG: ').replace('/msg/', '/').partition('/')
            if owner == package:
                texts[name] = body
    source = folder / package
    (source / 'msg').mkdir(parents=True)
    for name, text in texts.items():
        (source / 'msg' / f'{name}.msg').write_text(text + '\n')
    generated = folder / 'generated'
    subprocess.run([sys.executable, '-c', _GENERATE, package, str(generated),
                    *(f'msg/{name}.msg' for name in texts)], cwd=source, check=True,
                   env={**os.environ, 'AMENT_PREFIX_PATH': str(_PREFIX)}, capture_output=True)
    return _compiled(folder, package, generated)


def _compiled(folder: Path, package: str, generated: Path) -> dict[str, str]:
    headers, libraries, python = (folder / name for name in ('include', 'lib', 'python'))
    libraries.mkdir()
    for part in generated.iterdir():
        if part.name != 'rosidl_generator_py':
            shutil.copytree(part / 'msg', headers / package / 'msg', dirs_exist_ok=True)
    shutil.copytree(generated / 'rosidl_generator_py' / 'msg', python / package / 'msg')
    (python / package / '__init__.py').touch()
    includes = [f'-I{path}' for path in (
        headers, _PREFIX / 'include', *(_PREFIX / 'include').iterdir(),
        sysconfig.get_paths()['include'], np.get_include())]
    found = [f'-L{libraries}', f'-L{_PREFIX / "lib"}', f'-Wl,-rpath,{_PREFIX / "lib"}',
             f'-Wl,-rpath,{libraries}']
    others = [f'-l{file.stem.removeprefix("lib")}' for file in (_PREFIX / 'lib').glob('lib*.so')
              if re.fullmatch(r'lib((std|sensor|geometry)_msgs|builtin_interfaces)__rosidl_'
                              r'(generator_c|generator_py|typesupport_(c|fastrtps_c|'
                              r'introspection_c))\.so', file.name)]

    def compiled(target: Path, sources: list[Path], *linked: str) -> Path:
        cpp = any(path.suffix == '.cpp' for path in sources)
        subprocess.run(['g++' if cpp else 'gcc', '-shared', '-fPIC', '-O0', *(
            ['-std=c++17'] if cpp else []), f'-Wl,-soname,{target.name}', *includes,
            *map(str, sources), '-o', str(target), *found, *(f'-l{name}' for name in linked),
            *others, '-lrosidl_runtime_c', '-lrcutils'], check=True, capture_output=True)
        return target

    def library(name: str, sources: list[Path], *linked: str) -> Path:
        return compiled(libraries / f'lib{package}__{name}.so', sources, *linked)

    def of(kind: str, pattern: str) -> list[Path]:
        return sorted((generated / kind / 'msg').glob(pattern))

    own = f'{package}__rosidl_generator_c'
    built = [
        library('rosidl_generator_c', of('rosidl_generator_c', 'detail/*.c')),
        library('rosidl_typesupport_fastrtps_c', of(
            'rosidl_typesupport_fastrtps_c', 'detail/*.cpp'), own, 'rosidl_typesupport_fastrtps_c',
            'rosidl_typesupport_fastrtps_cpp', 'fastcdr'),
        library('rosidl_typesupport_introspection_c', of(
            'rosidl_typesupport_introspection_c', 'detail/*.c'), own,
            'rosidl_typesupport_introspection_c'),
        library('rosidl_typesupport_c', of('rosidl_typesupport_c', '*.cpp'), own,
                'rosidl_typesupport_c'),
        library('rosidl_generator_py', of('rosidl_generator_py', '*_s.c'), own)]
    compiled(python / package / f'{package}_s__rosidl_typesupport_c.so',
             [generated / 'rosidl_generator_py' / f'_{package}_s.ep.rosidl_typesupport_c.c'],
             f'{package}__rosidl_generator_py', f'{package}__rosidl_typesupport_c', own)
    # A process that runs already looks for libraries where it did when it began.
    for path in built:
        ctypes.CDLL(str(path), mode=ctypes.RTLD_GLOBAL)
    before = os.environ.get('LD_LIBRARY_PATH', ''), os.environ.get('PYTHONPATH', '')
    return {'LD_LIBRARY_PATH': os.pathsep.join(filter(None, [str(libraries), before[0]])),
            'PYTHONPATH': os.pathsep.join(filter(None, [str(python), before[1]]))}
