# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Rows of a CSV file that are not what its header says."""

from bags import read, refusal, said
from imu_allan.recordings import RecordingOptions
import numpy as np
import pytest

HEADER = 'time_s,gyro_x,gyro_y,gyro_z'
ROWS = np.random.default_rng(4).normal(0, 0.01, (30, 3)).round(6)
FIVE_FIELDS = (
    'the rows have 5 fields, the header names 4, so that none can be recognized by its name; name '
    'every column, the number of the row, too, as R does with col.names=NA')


def samples_of(tmp_path, text):
    path = tmp_path / 'imu.csv'
    path.write_text(text)
    return read(path)[0].samples[:, :3]


def table(header, row, mark=','):
    lines = [mark.join(row(place, map(str, values))) for place, values in enumerate(ROWS.tolist())]
    return '\n'.join([header, *lines, ''])


@pytest.mark.parametrize('row', [
    lambda place, values: [str(place + 1), str(place / 100), *values],
    lambda place, values: [f'"{place + 1}"', str(place / 100), *values],
    lambda place, values: [str(place / 100), *values, '1']])
def test_rows_of_more_fields_than_names_are_refused(tmp_path, row):
    assert refusal(tmp_path / 'imu.csv', table(HEADER, row)) == FIVE_FIELDS
    assert refusal(tmp_path / 'imu.csv', table(HEADER.replace(',', ' '), row, ' ')) == FIVE_FIELDS


def test_decimal_commas_between_commas_are_refused(tmp_path):
    text = table(HEADER, lambda place, values: [
        value.replace('.', ',') for value in (str(place / 100), *values)])
    assert refusal(tmp_path / 'imu.csv', text) == (
        'the rows have 8 fields, the header names 4, so that none can be recognized by its '
        'name; where that comes of decimal commas, write semicolons between the cells')


def test_decimal_commas_in_quotes_are_read(tmp_path):
    plain = table(HEADER, lambda place, values: [str(place / 100), *values])
    quoted = table(HEADER, lambda place, values: [
        f'"{value}"'.replace('.', ',') for value in (f'{place / 100:.2f}', *values)])
    assert samples_of(tmp_path, quoted).tolist() == samples_of(tmp_path, plain).tolist()


def test_commas_in_quotes_part_no_cells(tmp_path):
    text = table('note,' + HEADER, lambda place, values: ['"a, b"', str(place / 100), *values])
    assert samples_of(tmp_path, text).tolist() == ROWS.tolist()


def test_empty_fields_at_the_end_and_single_long_rows_are_no_hindrance(tmp_path):
    text = table(HEADER, lambda place, values: [str(place / 100), *values, ''])
    assert samples_of(tmp_path, text).tolist() == ROWS.tolist()
    text = table(HEADER, lambda place, values: [
        str(place / 100), *values, *(['7'] if place == 3 else [])])
    assert len(samples_of(tmp_path, text)) == len(ROWS)


def test_an_unnamed_column_at_the_end_has_its_place(tmp_path):
    text = table(HEADER + ',', lambda place, values: [str(place / 100), *values, 'OK'])
    assert samples_of(tmp_path, text).tolist() == ROWS.tolist()
    text = table(HEADER + ',', lambda place, values: [str(place), str(place / 100), *values, ''])
    assert refusal(tmp_path / 'imu.csv', text) == FIVE_FIELDS


@pytest.mark.parametrize('damage', ['\r', '\0', '"\r\0"'])
def test_marks_of_damage_cost_a_line_at_most(tmp_path, damage):
    text = table(HEADER + ',note', lambda place, values: [
        str(place / 100) + (damage if place == 3 else ''), *values, '"a, b"'])
    path = tmp_path / 'imu.csv'
    path.write_text(text, newline='')
    samples = read(path)[0].samples[:, :3]
    assert samples[:3].tolist() == ROWS[:3].tolist()
    assert samples[-26:].tolist() == ROWS[4:].tolist()


SPLIT = HEADER.replace('time_s', 'seconds,nanoseconds')


@pytest.mark.parametrize('times', [
    lambda place: (f'{7 + place / 8}', f'{125_000_000 * (place % 8)}'),
    lambda place: (f'{place / 8}', f'{125_000_000 * place}'),
    lambda place: (f'{place // 8}', f'{125_000_000 * place}'),
    lambda place: (f'{place // 8}', f'{125_000_000 * (place % 8) - 500_000_000}')])
def test_seconds_and_nanoseconds_that_are_no_two_parts_are_refused(tmp_path, times):
    text = table(SPLIT, lambda place, values: [*times(place), *values])
    assert refusal(tmp_path / 'imu.csv', text) == (
        'no time_s column; give the sample rate with --rate, or say which column is the time: '
        "--columns 'time=NAME ms'")
    path = tmp_path / 'imu.csv'
    path.write_text(text.replace('seconds,nano', 'time,seconds,nano').replace('\n', '\n1.5,'))
    assert set(read(path)[0].header_ns.tolist()) == {1_500_000_000}


def test_a_damaged_line_does_not_part_seconds_from_their_nanoseconds(tmp_path):
    text = table(SPLIT, lambda place, values: [
        f'{place // 8}', f'{125_000_000 * (place % 8) if place != 9 else 10**11}', *values])
    path = tmp_path / 'imu.csv'
    path.write_text(text)
    messages, [remark] = read(path)
    assert messages.header_ns.tolist() == [
        125_000_000 * place for place in range(len(ROWS)) if place != 9]
    assert remark == said(path, 'malformed_messages', what='line', count=1,
                          first='line 11: 1,100000000000,' + ','.join(map(str, ROWS[9].tolist())))


@pytest.mark.parametrize(('mark', 'grouped', 'comma'), [
    (';', '1.000', False), (';', '1,000', False), (';', '1.000', True)])
def test_times_with_a_mark_between_thousands_are_refused(tmp_path, mark, grouped, comma):
    def row(place, values):
        time = f'{900 + 10 * place:,}'.replace(',', grouped[1])
        return [time, *(value.replace('.', ',') if comma else value for value in values)]

    text = table('time_ms;gyro_x;gyro_y;gyro_z', row, mark)
    assert refusal(tmp_path / 'imu.csv', text) == (
        'the time 1.000 comes after 990: it is written with a mark between thousands; write the '
        'times without')


@pytest.mark.parametrize('step_s', [0.005, 0.125, 0.1])
def test_fractions_of_three_digits_are_no_thousands(tmp_path, step_s):
    for first in (0, 9, 99, 990):
        text = table(HEADER, lambda place, values, first=first: [
            f'{first + step_s * place:.3f}'.removesuffix('.000'), *values])
        assert len(samples_of(tmp_path, text)) == len(ROWS)


def test_a_column_named_twice_is_refused(tmp_path):
    text = table(HEADER, lambda place, values: [str(place / 100), *values])
    assert refusal(tmp_path / 'imu.csv', text, options=RecordingOptions(
        columns=(('gyro_x', 'gyro_y'), ('gyro_y', 'gyro_y')))) == (
        '--columns: column gyro_y is named twice')


FIRST = 1_700_000_000_000_000_001
AXES = HEADER.partition(',')[2]


def stamps_of(path, text):
    path.write_text(text)
    return (read(path)[0].header_ns - FIRST).tolist()


def test_a_quote_that_is_not_closed_hides_neither_cells_nor_digits(tmp_path):
    text = table(f'note,timestamp,{AXES}', lambda place, values: [
        '' if place else '"open', str(FIRST + place * 10_000_001), *values])
    assert samples_of(tmp_path, text).tolist() == ROWS.tolist()
    text = table(f'timestamp,{AXES},note', lambda place, values: [
        str(FIRST + place * 10_000_001), *values, '' if place else '"open'])
    assert stamps_of(tmp_path / 'imu.csv', text) == [place * 10_000_001 for place in range(30)]


def test_the_unit_of_times_is_that_of_most_and_of_those_that_come_late(tmp_path):
    text = table(f'timestamp,{AXES},height', lambda place, values: [
        str(FIRST + place * 10_000_001), *values, ''])
    head, _, rows = text.partition('\n')
    stamps = [place * 10_000_001 for place in range(30)]
    # A part of a line, and more lines of another topic than are looked at.
    for before, cut in (('', 17), (',,,,1.5\n' * 10_000, 0)):
        assert stamps_of(tmp_path / 'imu.csv', f'{head}\n{before}{rows[cut:]}')[-29:] == (
            stamps[1:])
