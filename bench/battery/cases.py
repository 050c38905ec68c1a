# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The sensors of the battery by family: full records, and spectra drawn from the model.

N, B and K are those of a consumer gyroscope; WALKING has a random walk that an hour shows. An hour
at 100 Hz is the rule, and 50 Hz where the filter runs at a multiple of that.
"""

from dataclasses import dataclass, replace
from math import pi, sqrt

from battery import trends
from battery.sensors import Array, B, Filter, K, N, Q, Sensor, Trend
import numpy as np
from scipy.signal import bessel, butter, cheby1, firwin
from scipy.signal.windows import gaussian

DEGREE = pi / 180
HOUR = 3600.0
WHITE = {N: 0.0045 * DEGREE}
STILL = {**WHITE, B: 0.0014 * DEGREE}
CONSUMER = {**STILL, K: 6.5e-5 * DEGREE}
WALKING = {**STILL, K: 2.5e-4 * DEGREE}
FLICKER = STILL[B]


@dataclass(frozen=True)
class Case:
    """
    Some records of a sensor.

    Attributes
    ----------
    family, name : str
    sensor : Sensor
    records : int
        How many, unless asked for otherwise.
    unknown : tuple of str
        Terms whose true value is a matter of words.

    """

    family: str
    name: str
    sensor: Sensor
    records: int
    unknown: tuple[str, ...] = ()


HOUR_OF_STILL = Sensor(100, HOUR, STILL)
HOUR_OF_WALK = Sensor(100, HOUR, WALKING)


def _standard(family: str, records: int) -> list[Case]:
    counted = {**STILL, Q: 3e-6}
    sensors = {'N': Sensor(100, HOUR, WHITE), 'NB': HOUR_OF_STILL, 'NBK': HOUR_OF_WALK,
               'NK': Sensor(100, HOUR, {**WHITE, K: WALKING[K]}),
               'QNB': Sensor(100, HOUR, counted),
               'A': Sensor(100, 3 * HOUR, CONSUMER), 'B': Sensor(200, HOUR, WALKING)}
    return [Case(family, name, sensor, records) for name, sensor in sensors.items()]


def _behind(family: str, filters: dict[str, Filter], records: int) -> list[Case]:
    return [Case(family, name, Sensor(50 if through.times > 1 else 100, HOUR, WALKING,
                                      through=through), records)
            for name, through in filters.items()]


def _gauss(sigma: float) -> Array:
    window = gaussian(2 * round(5 * sigma) + 1, sigma)
    return np.asarray(window / window.sum(), np.float64)


def _low_passes() -> dict[str, Filter]:
    """Those that the estimator knows; the analog ones run at four times the rate."""
    return {'recursive mean of .2': Filter([0.2], [1.0, -0.8]),
            'recursive mean of .05': Filter([0.05], [1.0, -0.95]),
            'mean of 8': Filter(np.full(8, 1 / 8)),
            'sinc2 of 6': Filter(np.convolve(np.full(6, 1 / 6), np.full(6, 1 / 6))),
            'Butterworth 1': Filter(*butter(1, 0.05), times=4),
            'Butterworth 2': Filter(*butter(2, 0.1), times=4),
            'Butterworth 2, deep': Filter(*butter(2, 5, fs=100)),
            'Butterworth 3': Filter(*butter(3, 10, fs=100)),
            'Butterworth 4': Filter(*butter(4, 0.06), times=4),
            'Gauss': Filter(_gauss(3.0))}


def _unlisted() -> dict[str, Filter]:
    return {'Chebyshev 3': Filter(*cheby1(3, 0.5, 0.3)),
            'Bessel 3': Filter(*bessel(3, 0.06, norm='mag'), times=4),
            'Bessel 2, deep': Filter(*bessel(2, 0.02, norm='mag')),
            'FIR of 31': Filter(firwin(31, 0.3)), 'FIR of 63': Filter(firwin(63, 0.15)),
            'FIR of 151': Filter(firwin(151, 0.02))}


def _bend(share: float) -> Filter:
    """Weighted mean with the sample before, which takes a share of the highest power."""
    other = (1 - sqrt(1 - share)) / 2
    return Filter([1 - other, other])


def _bends(family: str, records: int) -> list[Case]:
    return [Case(family, f'bend of {percent} %', replace(HOUR_OF_STILL,
                 through=_bend(percent / 100)), records) for percent in (1, 2, 3)]


def _weak_q(family: str, records: int) -> list[Case]:
    # Its square is one standard error, in an hour at 100 Hz.
    one = WHITE[N] * sqrt(sqrt(2 / 360_000) * 0.01 / 2 * 1.15)
    return [Case(family, f'Q of {errors} errors',
                 Sensor(100, HOUR, {**STILL, Q: one * sqrt(errors)}), records)
            for errors in (1, 2, 4)]


def _processes(family: str, records: int) -> list[Case]:
    sensors = {
        '20 s, 1.5 B, 1 h': (1, STILL, 1.5, 20.0), '60 s, 2 B, 1 h': (1, STILL, 2, 60.0),
        '60 s, 4 B, 1 h': (1, STILL, 4, 60.0), '300 s, 3 B, 1 h': (1, STILL, 3, 300.0),
        '60 s, no flicker, 1 h': (1, WHITE, 2, 60.0), '60 s, 1 B, 3 h': (3, STILL, 1, 60.0),
        '60 s, 2 B, 3 h': (3, STILL, 2, 60.0), '100 s, 2 B, 3 h': (3, STILL, 2, 100.0),
        '300 s, 4 B, 3 h': (3, STILL, 4, 300.0)}
    return [Case(family, name, Sensor(20, hours * HOUR, terms,
                                      process=(size * FLICKER, time_s)), records)
            for name, (hours, terms, size, time_s) in sensors.items()]


def _exponents(family: str, records: int) -> list[Case]:
    def crossing(exponent: float, frequency_hz: float) -> Sensor:
        amplitude = WHITE[N] * (2 * pi * frequency_hz)**(exponent / 2)
        return Sensor(100, HOUR, WHITE, law=(amplitude, exponent))

    # What the flicker of another exponent is worth is a matter of words.
    cases = [Case(family, f'f^-{exponent:g} from {frequency_hz:g} Hz',
                  crossing(exponent, frequency_hz), records, (B,))
             for exponent, frequency_hz in ((0.7, 1.0), (0.7, 5.0), (0.85, 1.0), (1.2, 1.0),
                                            (1.3, 1.0), (1.3, 5.0))]
    return [*cases, Case(family, 'f^-1.2 from 0.1 Hz', crossing(1.2, 0.1), 2 * records, (B,))]


def _high_passes(family: str, records: int) -> list[Case]:
    def behind(terms: dict[str, float], time_s: float, hours: float) -> Sensor:
        return Sensor(50, hours * HOUR, terms, through=Filter(
            *butter(1, 1 / (2 * pi * time_s), 'high', fs=50), settling_s=15 * time_s))

    sensors = {'N, 10 s': behind(WHITE, 10, 1), 'NB, 10 s': behind(STILL, 10, 1),
               'NB, 60 s': behind(STILL, 60, 1), 'NB, 60 s, 3 h': behind(STILL, 60, 3)}
    return [Case(family, name, sensor, records) for name, sensor in sensors.items()]


def _trends() -> list[Case]:
    hour = {'ramp of 10 B': trends.ramp(10), 'settling 10 B': trends.settling(10, 600),
            'settling 300 B': trends.settling(300, 300), 'step 5 B': trends.step(5, 0.37),
            'step 30 B': trends.step(30, 0.62), 'cycle 2 B': trends.cycle(2, 1200),
            'bump 10 B': trends.bump(10), 'two steps 5 B': trends.two_steps(5)}
    cases = [Case('trends', name, replace(HOUR_OF_STILL, mean=_scaled(trend)), 12)
             for name, trend in hour.items()]
    for name, trend in (('ramp of 10 B', trends.ramp(10)),
                        ('settling 30 B', trends.settling(30, 600))):
        cases.append(Case('trends', f'{name} beside K', replace(
            HOUR_OF_WALK, mean=_scaled(trend)), 12))
    two_hours = Sensor(50, 2 * HOUR, STILL)
    return [*cases,
            Case('trends', 'settling 10 B in 2 h', replace(
                two_hours, mean=_scaled(trends.settling(10, 600))), 20),
            Case('trends', 'cycle 2 B in 2 h', replace(
                two_hours, mean=_scaled(trends.cycle(2, 1200))), 12),
            Case('trends', 'louder half', replace(HOUR_OF_STILL, louder=1.2), 8)]


def _scaled(trend: Trend) -> Trend:
    return lambda time: FLICKER * trend(time)


def _short() -> list[Case]:
    # Of ten seconds the white noise that such a filter bends passes for strong flicker.
    slow, slower = Filter([0.2], [1.0, -0.8]), Filter([0.05], [1.0, -0.95])
    return [Case('short', '10 s, NB, recursive mean', Sensor(100, 10, STILL, through=slow), 48),
            Case('short', '10 s, NB, 400 Hz, recursive mean',
                 Sensor(400, 10, STILL, through=slower), 48),
            Case('short', '10 s, N', Sensor(100, 10, WHITE), 24),
            Case('short', '10 s, NB', Sensor(100, 10, STILL), 48),
            Case('short', '10 s, NBK, 400 Hz', Sensor(400, 10, WALKING), 24),
            Case('short', '1 min, NB', Sensor(100, 60, STILL), 24),
            Case('short', '5 min, NBK', Sensor(100, 300, WALKING), 24),
            # What shows first of the slow noise is seen at its least frequencies alone.
            *(Case('short', f'6 min, B from 1/{part} of it', Sensor(100, 360, {
                **WHITE, B: WHITE[N] * sqrt(2 * pi * part / 360)}), 24) for part in (5, 10))]


def _rates() -> list[Case]:
    slow = Filter(*butter(1, 0.2, fs=100), settling_s=60)
    slow2 = Filter(*butter(2, 0.2, fs=100), settling_s=60)
    mean = Filter(np.full(8, 1 / 8), settling_s=100)
    return [Case('rates', 'NB, 1 Hz, 24 h', Sensor(1, 24 * HOUR, STILL), 12),
            Case('rates', 'NBK, 10 Hz, 3 h', Sensor(10, 3 * HOUR, WALKING), 12),
            Case('rates', 'NB, 1 kHz, 10 min', Sensor(1000, 600, STILL), 6),
            Case('rates', 'NBK, 8 kHz, 2 min', Sensor(8000, 120, WALKING), 4),
            Case('rates', 'N, mean of 8 at 1 Hz', Sensor(1, 6 * HOUR, WHITE, through=mean), 8),
            Case('rates', 'NB, mean of 8 at 1 Hz', Sensor(1, 24 * HOUR, STILL, through=mean), 8),
            Case('rates', 'N behind .2 Hz', Sensor(100, HOUR, WHITE, through=slow), 8),
            Case('rates', 'N behind .2 Hz, order 2', Sensor(100, HOUR, WHITE, through=slow2), 8)]


def _records() -> list[Case]:
    """Return the cases of full records."""
    return [*_standard('standard', 20), *_behind('low-passes', _low_passes(), 10),
            *_behind('unlisted', _unlisted(), 10), *_bends('bends', 16),
            *_weak_q('weak Q', 10), *_processes('processes', 10), *_exponents('exponents', 10),
            *_high_passes('high-pass', 8),
            *_trends(), *_short(), *_rates()]


def _spectra() -> list[Case]:
    """Return the cases of which spectra are drawn: what needs no time within the record."""
    def digital(filters: dict[str, Filter]) -> dict[str, Filter]:
        return {name: one for name, one in filters.items() if one.times == 1}

    still = {'ramp of 10 B': trends.ramp(10), 'settling 10 B': trends.settling(10, 600),
             'cycle 2 B': trends.cycle(2, 1200)}
    return [*_standard('standard', 150), *_behind('low-passes', digital(_low_passes()), 60),
            *_behind('unlisted', digital(_unlisted()), 60), *_high_passes('high-pass', 30),
            *_bends('bends', 100), *_weak_q('weak Q', 100), *_processes('processes', 50),
            *_exponents('exponents', 50),
            *(Case('trends', name, replace(HOUR_OF_STILL, mean=_scaled(trend)), 60)
              for name, trend in still.items())]


PARTS = ('records', 'spectra', 'recordings')
RECORDS = tuple(_records())
SPECTRA = tuple(_spectra())
NAMES = {name for case in (*RECORDS, *SPECTRA) for name in (case.family, case.name)}
"""By which cases can be chosen."""
