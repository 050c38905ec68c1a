# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Folders that everybody may write to, and what another user puts there."""

import os
from pathlib import Path

import pytest

SOMEBODY_ELSE = 12345


def shared_folder(folder: Path) -> Path:
    """Make a folder like /tmp: everybody may write to it, nobody may remove what is not theirs."""
    folder.mkdir()
    folder.chmod(0o1777)
    return folder


def planted(link: Path, target: Path) -> Path:
    """Make a link of another user; skip where that is not allowed."""
    link.symlink_to(target)
    try:
        os.lchown(link, SOMEBODY_ELSE, SOMEBODY_ELSE)
    except PermissionError:
        pytest.skip('acting as another user needs root')
    return link
