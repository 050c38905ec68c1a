# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
Headers of the records of ROS 1 bags: fields of ``name=value``, each after its length.

References
----------
ROS wiki, Bags/Format/2.0

"""

from enum import IntEnum


class Operation(IntEnum):
    """What a record is: its field `op`."""

    MESSAGE = 2
    BAG_HEADER = 3
    INDEX = 4
    CHUNK = 5
    CHUNK_INFO = 6
    CONNECTION = 7


class DamagedHeader(ValueError):
    """Bytes that are no record header, or a field that is missing or of another size."""


class Ros1Header:
    """The fields of one record header; raises DamagedHeader."""

    def __init__(self, data: bytes) -> None:
        self._fields: dict[str, tuple[bytes, int]] = {}
        at = 0
        while at < len(data):
            stop = at + 4 + int.from_bytes(data[at:at + 4], 'little')
            name, equals, value = data[at + 4:stop].partition(b'=')
            if stop > len(data) or not equals or not name.isascii():
                raise DamagedHeader(f'no field at byte {at} of the record header')
            self._fields[name.decode()] = value, stop - len(value)
            at = stop

    def get(self, name: str) -> bytes:
        """Return the bytes of a field; none where it is missing."""
        return self._fields.get(name, (b'', 0))[0]

    def value(self, name: str, size: int | None = None) -> bytes:
        """Return the bytes of a field of some size; raises DamagedHeader."""
        value, _ = self._fields.get(name, (None, 0))
        if value is None or size not in (None, len(value)):
            raise DamagedHeader(f'no field {name} of that size in the record header')
        return value

    def number(self, name: str, size: int) -> int:
        """Return a field of `size` bytes as unsigned number; raises DamagedHeader."""
        return int.from_bytes(self.value(name, size), 'little')

    def text(self, name: str) -> str:
        """Return a field as text; raises DamagedHeader."""
        try:
            return self.value(name).decode()
        except UnicodeDecodeError as error:
            raise DamagedHeader(f'field {name} is not UTF-8') from error

    def operation(self) -> Operation:
        """Tell what the record is; raises DamagedHeader."""
        try:
            return Operation(self.number('op', 1))
        except ValueError as error:
            raise DamagedHeader('no such record') from error

    def place(self, name: str) -> int:
        """Return where the value of a field begins, in bytes from the start of the header."""
        return self._fields[name][1]
