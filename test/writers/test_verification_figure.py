# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""The picture of the drift that filters met in another recording."""

from imu_allan.result import Coast
from imu_allan.tuning.field_test import FieldTest, Outcome
from imu_allan.writers.verification_figure import verification_figure


def met(*horizons: float) -> FieldTest:
    """Return a test of one axis in which everything was predicted by half."""
    outcome = Outcome((), tuple(Coast(h, 1e-4, 2e-4) for h in horizons),
                      tuple((5e-5, 3e-4) for _ in horizons))
    return FieldTest(1000.0, 10, outcome, outcome, 1.0, 1.0, (0.9, 1.1), (0.9, 1.1))


def test_a_single_horizon_shows_what_was_predicted_and_nothing_hides_it():
    figure = verification_figure({f'gyro_{letter}': met(10.0) for letter in 'xyz'}, 'drive')
    [panel] = figure.axes
    # A line through one point is none: the bar says it.
    bars = [line for line in panel.lines if line.get_marker() == '_']
    assert len(bars) == 3
    low, high = panel.get_xlim()
    assert low < 10 / 1.3 < 10 * 1.3 < high
    figure.canvas.draw()
    assert panel.get_legend().get_window_extent().y0 >= panel.get_window_extent().y1 - 1


def test_several_horizons_are_lines_within_the_panel():
    figure = verification_figure({'accel_x': met(10.0, 60.0, 300.0)}, 'drive')
    [panel] = figure.axes
    low, high = panel.get_xlim()
    assert low < 10 < 300 < high < 1000
