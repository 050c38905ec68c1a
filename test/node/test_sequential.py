# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""A fit every few seconds is a look every few seconds: chance is not published."""

from collections.abc import Sequence
from dataclasses import replace

from imu_allan.node.checkpoint import decode_state, encode_state
from imu_allan.node.run import new_run, pack, Setup, unpack
from imu_allan.node.sequential import SequentialLooks
from imu_allan.result import Coefficient, Result
from imu_allan.timeline import TimelineOptions
import pytest
from ros_harness import at_rest, result_of

RANDOM_WALK = 'rate_random_walk'


@pytest.fixture(scope='module')
def fitted() -> Result:
    return result_of(at_rest(2000))


def at(result: Result, seconds: float, observable: bool, wait_s: float | None = None,
       presence: float | None = None) -> Result:
    """Give the result as that of another time, in which K of one axis shows or not."""
    axis = result.axes['gyro_x']
    walk = (Coefficient('K', 'u', True, 2.0, (1.0, 3.0), None, presence=presence) if observable
            else Coefficient('K', 'u', False, None, None, 4.0, observable_in_s=wait_s))
    return replace(
        result, timeline=replace(result.timeline, samples=round(100 * seconds),
                                 sample_rate_hz=100.0, duration_s=seconds),
        axes={'gyro_x': replace(axis, coefficients={**axis.coefficients, RANDOM_WALK: walk})})


def seen(looks: SequentialLooks, fits: Sequence[Result]) -> list[Coefficient]:
    return [looks.judged(fit).axes['gyro_x'].coefficients[RANDOM_WALK] for fit in fits]


def test_a_term_is_published_once_every_fit_has_shown_it_since_a_third_of_the_record(
        fitted: Result) -> None:
    shows = [seconds >= 30 and seconds != 70 for seconds in range(10, 240, 10)]
    found = seen(SequentialLooks(), [
        at(fitted, 10.0 * number, shown) for number, shown in enumerate(shows, 1)])
    # Not seen at 20 s; seen at 30 to 60, thrice as much; lost at 70, and back at 210.
    assert [coefficient.observable for coefficient in found] == [
        False] * 5 + [True] + [False] * 14 + [True] * 3
    withheld = found[7]
    assert (withheld.value, withheld.ci95, withheld.upper95) == (None, None, 3.0)
    assert withheld.observable_in_s == pytest.approx(3 * 70 - 80)


def test_the_first_look_at_a_long_record_is_one_look(fitted: Result) -> None:
    [found] = seen(SequentialLooks(), [at(fitted, 3600.0, True)])
    assert found.observable
    # A short one is the first of many.
    first, *_, last = seen(SequentialLooks(), [at(fitted, time, True) for time in (10., 20., 30.)])
    assert (first.observable, last.observable) == (False, True)


def test_where_the_fit_tells_how_probable_a_term_is_it_has_to_be_probable_too(
        fitted: Result) -> None:
    found = seen(SequentialLooks(), [
        at(fitted, 10.0 * number, True, presence=presence)
        for number, presence in enumerate((0.995, 0.98, 0.98, 0.995, 0.8), 1)])
    # At 30 s the record is thrice as long, but only at 40 s it is probable; what is shown stays.
    assert [coefficient.observable for coefficient in found] == [False] * 3 + [True] * 2
    assert [coefficient.observable_in_s for coefficient in found[:3]] == [20.0, None, None]
    assert (found[0].value, found[0].upper95) == (None, 3.0)


def test_a_look_after_a_restart_is_one_more_and_not_the_first(fitted: Result) -> None:
    setup = Setup('/imu', TimelineOptions())
    run = new_run(setup)
    seen(run.sequential, [at(fitted, 800.0, False)])
    # As often as it is started anew: a run is one.
    for seconds, observable in ((900.0, False), (1000.0, False), (2800.0, True), (2900.0, True)):
        run = unpack(decode_state(encode_state(pack(run, setup))), setup)
        [found] = seen(run.sequential, [at(fitted, seconds, seconds > 900)])
        assert found.observable == observable


def test_a_wait_that_recedes_is_not_said(fitted: Result) -> None:
    times = [10.0 * number for number in range(1, 21)]
    recedes = seen(SequentialLooks(), [at(fitted, time, False, 2 * time) for time in times])
    assert [coefficient.observable_in_s for coefficient in recedes] == [None] * len(times)
    stands = seen(SequentialLooks(), [at(fitted, time, False, 500 - time) for time in times])
    # At 30 s the record is thrice as long as at the first look.
    assert [coefficient.observable_in_s for coefficient in stands] == [
        None, None, *(500 - time for time in times[2:])]
