# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The log says every transition once, and how far the run has come."""

from dataclasses import replace
from typing import Any

from changed import only, with_coefficient
from imu_allan.node.announcements import Announcements, progress_line
from imu_allan.node.diagnostics import reception_conditions, timeline_conditions
from imu_allan.node.log import Log
from imu_allan.result import Timeline
import pytest
from ros_harness import at_rest, facts, Heard, result_of, summary


@pytest.fixture
def announcements(heard: Any) -> Announcements:
    return Announcements(Log(heard), '/imu')


def test_a_condition_is_reported_once_when_it_begins_and_once_when_it_is_over(
        announcements: Announcements, heard: Heard) -> None:
    counts = {'malformed': 1, 'lost': 3, 'rejected': 1, 'clock_jumps': 1}
    bad = facts(counts, publishers=2, mixed=True, looping=True, namesakes=1, expected_rate=200.0,
                temperature_topic='/warmth', temperature_missing=True)
    moving = summary(moving=True, clock_jumps=1)
    for now in range(100):
        announcements.see_reception(bad)
        announcements.see_timeline(now, bad, moving)
    begun = [one for one in (*reception_conditions(bad), *timeline_conditions(bad, moving))
             if one.present and one.over is not None]
    assert len(begun) == 11
    first = "info first samples on /imu: frame_id 'imu', 100 Hz, header stamps"
    assert [line for line in heard.lines if line != first] == [
        f'warning {one.message}' for one in begun]
    assert heard.lines.count(first) == 1
    heard.lines.clear()
    good = facts(malformed=1, lost=3, pause_s=4.0, expected_rate=100.0,
                 temperature_topic='/warmth')
    for now in range(101, 200):
        announcements.see_reception(good)
        announcements.see_timeline(now, good, summary(
            timeline=Timeline(100.0, 1000, 10.0, rejected=1)))
    assert heard.lines == [
        'info no other node has the same name any more',
        'info the messages on /imu are of one publisher again; call ~/reset if it is another IMU',
        'info one publisher is left on /imu',
        'info the messages on /imu are new again',
        'info every message on /imu can be decoded again; 1 message could not be in all',
        'info no message on /imu is lost any more; 3 were in all',
        'info the thermometer on /warmth is there',
        'info messages come on /imu again after 4 s without',
        'info the IMU is at rest again',
        'info the rate is the expected one again',
        'info no message is rejected any more; 1 was in all']


def test_progress_is_reported_every_minute_and_later_every_hour(
        announcements: Announcements, heard: Heard) -> None:
    result = with_coefficient(only(result_of(at_rest(6000, seed=2)), 'gyro'), 'gyro_x',
                              'bias_instability', observable_in_s=60.0)
    announcements.see_timeline(0.0, facts(), summary())
    heard.lines.clear()
    for second in range(2 * 3600 + 700):
        announcements.see_progress(float(second), facts(), result)
    # At 1 to 10 minutes, then after an hour each.
    assert len(heard.lines) == 10 + 2
    shown = ('observable of 3 axes: noise density of 3; next: bias instability of gyro x in about '
             '60 s')
    assert heard.lines[0] == f'info 6,000 samples at 100 Hz in 60 s; {shown}'
    assert progress_line(result, 20.0) == (
        f'6,000 samples at 100 Hz in 60 s, 40 s of it at rest; {shown}')
    assert progress_line(replace(result, axes={})) == (
        '6,000 samples at 100 Hz in 60 s; observable of 0 axes: nothing yet')
