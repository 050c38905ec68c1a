# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Messages are compared as whole lines: a part of one holds neither its sense nor its words."""

from imu_allan.errors import ImuAllanError
import pytest
from whole_lines import refused, Varying


@pytest.mark.parametrize('said', ['a.csv: empty; record again', 'b/a.csv: empty', 'empty', ''])
def test_a_line_that_holds_more_or_less_is_another(said: str) -> None:
    with pytest.raises(AssertionError), refused('a.csv: empty'):
        raise ImuAllanError(said)
    with refused('a.csv: empty'):
        raise ImuAllanError('a.csv: empty')


def test_numbers_and_words_vary_only_where_the_line_says_so() -> None:
    line = Varying('<number> of 1,024 messages are lost (<words>)')
    assert line == '3 of 1,024 messages are lost (disk full)'
    assert line == '-1,200.5e-06 of 1,024 messages are lost (x)'
    assert line != '3 of 1,025 messages are lost (disk full)'
    assert line != 'about 3 of 1,024 messages are lost (disk full)'
    assert line != '3 of 1,024 messages are lost ()'
    assert line != '3 of 1,024 messages are lost (disk\nfull)'
