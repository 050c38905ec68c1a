# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The one exception that imu_allan raises for input it cannot use."""


class ImuAllanError(ValueError):
    """
    A problem the user can act on.

    The message is one line: it names the file, topic, field or option and says what to do. The
    command prints it on stderr and exits with status 1; any other exception is a bug and keeps its
    traceback.
    """
