# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Rows of a CSV file that are not what its header says."""

from bags import read, refusal
import numpy as np
import pytest

HEADER = 'time_s,gyro_x,gyro_y,gyro_z'
AXES = HEADER.partition(',')[2]
ROWS = np.random.default_rng(4).normal(0, 0.01, (30, 3)).round(6)
FIRST = 1_700_000_000_000_000_001
FIVE_FIELDS = (
    'the rows have 5 fields, the header names 4, so that none can be recognized by its name; name '
    'every column, the number of the row, too, as R does with col.names=NA')
EIGHT_FIELDS = (
    'the rows have 8 fields, the header names 4, so that none can be recognized by its name; '
    'where that comes of decimal commas, write semicolons between the cells')
NO_TIME = ('no time_s column; give the sample rate with --rate, or say which column is the time: '
           "--columns 'time=NAME ms'")


@pytest.fixture
def path(tmp_path):
    return tmp_path / 'imu.csv'


def table(header, row, mark=','):
    lines = [mark.join(row(place, map(str, values))) for place, values in enumerate(ROWS.tolist())]
    return '\n'.join([header, *lines, ''])


def plain(place, values):
    return [str(place / 100), *values]


@pytest.mark.parametrize(('header', 'row', 'mark', 'reason'), [
    (HEADER, lambda place, values: [str(place + 1), *plain(place, values)], ',', FIVE_FIELDS),
    (HEADER.replace(',', ' '), lambda place, values: [*plain(place, values), '1'], ' ',
     FIVE_FIELDS),
    (HEADER, lambda place, values: [cell.replace('.', ',') for cell in plain(place, values)], ',',
     EIGHT_FIELDS)],
    ids=['number', 'blanks', 'decimal commas'])
def test_rows_of_more_fields_than_names_are_refused(path, header, row, mark, reason):
    assert refusal(path, table(header, row, mark)) == reason


@pytest.mark.parametrize(('header', 'row'), [
    (HEADER, lambda place, values: [
        f'"{value}"'.replace('.', ',') for value in (f'{place / 100:.2f}', *values)]),
    ('note,' + HEADER, lambda place, values: ['"a, b"', *plain(place, values)]),
    (HEADER, lambda place, values: [*plain(place, values), *['7'][:place == 3]]),
    ('note,' + HEADER, lambda place, values: [['"open', ''][place > 0], *plain(place, values)])],
    ids=['decimal commas in quotes', 'commas in quotes', 'one long row',
         'quote that is not closed'])
def test_rows_that_are_only_written_unusually_are_read(path, header, row):
    path.write_text(table(header, row))
    assert read(path)[0].samples[:, :3].tolist() == ROWS.tolist()


SPLIT = f'seconds,nanoseconds,{AXES}'


@pytest.mark.parametrize('times', [
    lambda place: (f'{place / 8}', f'{125_000_000 * (place % 8)}'),
    lambda place: (f'{place // 8}', f'{125_000_000 * place}')])
def test_seconds_and_nanoseconds_that_are_no_two_parts_are_refused(path, times):
    text = table(SPLIT, lambda place, values: [*times(place), *values])
    assert refusal(path, text) == NO_TIME
    path.write_text(text.replace('seconds,nano', 'time,seconds,nano').replace('\n', '\n1.5,'))
    assert set(read(path)[0].header_ns.tolist()) == {1_500_000_000}


@pytest.mark.parametrize(('grouped', 'comma'), [(',', False), ('.', True)])
def test_times_with_a_mark_between_thousands_are_refused(path, grouped, comma):
    def row(place, values):
        time = f'{900 + 10 * place:,}'.replace(',', grouped)
        return [time, *(value.replace('.', ',') if comma else value for value in values)]

    assert refusal(path, table(f'time_ms;{AXES.replace(",", ";")}', row, ';')) == (
        'the time 1.000 comes after 990: it is written with a mark between thousands; write the '
        'times without')


@pytest.mark.parametrize(('before', 'cut', 'end'), [
    # A quote that is not closed, part of a line, more lines of another topic than are looked at.
    ('', 0, '"open'), ('', 17, ''), (',,,,1.5\n' * 10_000, 0, '')],
    ids=['quote', 'part', 'another topic'])
def test_the_digits_and_the_unit_of_times_are_those_of_most_rows(path, before, cut, end):
    head, _, rows = table(f'timestamp,{AXES},height', lambda place, values: [
        str(FIRST + place * 10_000_001), *values, '' if place else end]).partition('\n')
    path.write_text(f'{head}\n{before}{rows[cut:]}')
    assert (read(path)[0].header_ns - FIRST).tolist()[-29:] == [
        place * 10_000_001 for place in range(1, 30)]
