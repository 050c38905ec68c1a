# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
The result of a characterization, which all writers read and nothing changes.

The dataclasses mirror the JSON schema
``imu_allan.result/1`` field by field. All values are in SI units, all times in seconds from the
first sample. An unknown number is None, never NaN.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from math import pi, sqrt
from typing import Annotated, Any, Literal

from imu_allan.errors import ImuAllanError, shorten
from imu_allan.finding import Finding
from imu_allan.json_of_dataclasses import ABOVE_ZERO, json_text, NOT_NEGATIVE, plain, typed

SCHEMA = 'imu_allan.result/1'
LISTED_SPANS = 1000
"""Most gaps, and most spans of motion, that are listed; further ones are only in the totals."""

Interval = tuple[float, float]
Fault = Literal['constant', 'dead', 'saturated', 'zeroed']
AboveZero = Annotated[float, ABOVE_ZERO]
NotNegative = Annotated[float, NOT_NEGATIVE]


@dataclass(frozen=True)
class Coefficient:
    """
    One noise coefficient with its interval, or an upper bound if the data cannot show it.

    Attributes
    ----------
    symbol, unit : str
        Letter of IEEE Std 952 and SI unit.
    observable : bool
        Whether this data shows the term.
    value : float or None
        Median of the posterior; None if not observable.
    ci95 : (float, float) or None
        95 % credible interval; None if not observable.
    upper95 : float or None
        95 % upper bound (for a signed term, of its magnitude) if not observable.
    observable_in_s : float or None
        Further recording time after which the term is expected to become observable.
    ci_halves_in_s : float or None
        Further recording time after which the interval is expected to be half as wide.
    between : float or None
        Spread of the value between segments or recordings beyond measurement error, as a standard
        deviation in `unit`.
    presence : float or None
        Probability that the term is present, from 0 to 1.

    """

    symbol: str
    unit: str
    observable: bool
    value: float | None
    ci95: Interval | None
    upper95: NotNegative | None
    observable_in_s: NotNegative | None = None
    ci_halves_in_s: NotNegative | None = None
    between: NotNegative | None = None
    presence: float | None = None

    def __str__(self) -> str:
        """Return ``N 0.001 [0.0009, 0.0011] rad/s/sqrt(Hz)``, or the bound."""
        if self.value is not None and self.ci95 is not None:
            low, high = self.ci95
            return f'{self.symbol} {self.value:.4g} [{low:.4g}, {high:.4g}] {self.unit}'
        if self.upper95 is not None:
            return f'{self.symbol} < {self.upper95:.3g} {self.unit}'
        return f'{self.symbol} unknown'


@dataclass(frozen=True)
class Tone:
    """A narrow line in the spectrum; its amplitude is in the unit of a sample."""

    frequency_hz: AboveZero
    amplitude: NotNegative


@dataclass(frozen=True)
class GaussMarkov:
    """
    First-order Gauss-Markov process: standard deviation, and correlation time in seconds.

    The 95 % intervals are set if the process was measured.
    """

    sigma: NotNegative
    correlation_time_s: AboveZero
    sigma_ci95: Interval | None = None
    correlation_time_ci95: Interval | None = None


@dataclass(frozen=True)
class PowerLaw:
    """
    Slow noise other than flicker, whose two-sided density is ``psd_1hz / f**exponent``.

    Attributes
    ----------
    exponent : float
        Exponent of the frequency; 1 would be flicker.
    exponent_ci95 : (float, float)
    psd_1hz : float
        Density at 1 Hz, in the squared unit of a sample per Hz.

    """

    exponent: float
    exponent_ci95: Interval
    psd_1hz: AboveZero

    @property
    def amplitude(self) -> float:
        """Return the coefficient of the law, which for flicker would be the bias instability."""
        return sqrt(self.psd_1hz * (2 * pi)**self.exponent)


@dataclass(frozen=True)
class DriftModel:
    """
    Model to predict the sensor: white noise, random walk and first-order Gauss-Markov processes.

    Attributes
    ----------
    noise_density, rate_random_walk : float
        In the units of the coefficients of that name; never negative, zero if absent.
    processes : tuple of GaussMarkov
        At most four, by increasing correlation time.
    from_s, to_s : float
        Range of horizons for which the record supports the model.

    """

    noise_density: NotNegative
    rate_random_walk: NotNegative
    processes: tuple[GaussMarkov, ...]
    from_s: AboveZero
    to_s: AboveZero


@dataclass(frozen=True)
class Ramp:
    """A steady drift: slope in the unit of a sample per second, with its 95 % interval."""

    value: float
    ci95: Interval


@dataclass(frozen=True)
class WarmUp:
    """
    An exponential approach to the steady value, as after switching on.

    Attributes
    ----------
    amplitude : float
        Value of the exponential at the first sample, in the unit of a sample; signed.
    time_constant_s : float
    ci95 : (float, float)
        95 % interval of the amplitude.
    time_constant_ci95 : (float, float) or None
        95 % interval of the time constant.

    """

    amplitude: float
    time_constant_s: AboveZero
    ci95: Interval
    time_constant_ci95: Interval | None = None


@dataclass(frozen=True)
class TemperatureDependence:
    """
    Change of the mean with temperature.

    Attributes
    ----------
    per_kelvin : float
        Slope at the mean temperature of the record, in the unit of a sample.
    ci95 : (float, float)
        95 % interval of the slope.
    lowest_c, highest_c : float
        Temperature range of the data, in degrees Celsius.
    lag_s : float or None
        Time constant with which the thermometer follows the sensor, if observable; negative if the
        sensor follows the thermometer.
    lag_ci95 : (float, float) or None

    """

    per_kelvin: float
    ci95: Interval
    lowest_c: float
    highest_c: float
    lag_s: float | None = None
    lag_ci95: Interval | None = None


@dataclass(frozen=True)
class Trend:
    """
    Deterministic drift of the mean; None for each part that the data does not show.

    Attributes
    ----------
    ramp : Ramp or None
    warm_up : WarmUp or None
    temperature : TemperatureDependence or None
    second_warm_up : WarmUp or None
        A smaller exponential in addition to the first, if one does not suffice: for example for a
        die and its housing.
    cycle_s : float or None
        Period of a slow cycle, such as a heater's.

    """

    ramp: Ramp | None = None
    warm_up: WarmUp | None = None
    temperature: TemperatureDependence | None = None
    second_warm_up: WarmUp | None = None
    cycle_s: float | None = None


@dataclass(frozen=True)
class Segment:
    """
    One of the equal parts of a record.

    Attributes
    ----------
    start_s, duration_s : float
    mean : float
    noise_density : float or None
        With its 95 % interval `ci95`; None if the segment is too short.
    ci95 : (float, float) or None
    drift_sigma : float or None
        Standard deviation of the slow part of the signal within the segment. It is hardly more
        than a slope, so one segment says little about another.

    """

    start_s: NotNegative
    duration_s: AboveZero
    mean: float
    noise_density: AboveZero | None
    ci95: Interval | None
    drift_sigma: NotNegative | None


@dataclass(frozen=True)
class Stationarity:
    """Whether the noise is the same in all segments of the record, and the segments."""

    steady: bool
    p_value: float | None
    segments: tuple[Segment, ...]


@dataclass(frozen=True)
class Innovations:
    """Mean normalized innovation squared of means over `interval_s`; above 1 is overconfident."""

    interval_s: AboveZero
    nis: NotNegative
    steps: Annotated[int, ABOVE_ZERO]


@dataclass(frozen=True)
class Coast:
    """Predicted and observed deviation of the mean over a horizon without correction."""

    horizon_s: AboveZero
    predicted_sigma: AboveZero
    observed_rms: NotNegative


@dataclass(frozen=True)
class Backtest:
    """Test of the drift model of one part of the record against the rest."""

    trained_s: AboveZero
    tested_s: AboveZero
    innovations: tuple[Innovations, ...]
    coast: tuple[Coast, ...]


@dataclass(frozen=True)
class GoodnessOfFit:
    """How well the fitted model describes the spectrum of the data."""

    p_value: float | None
    worst_relative_misfit: float | None
    acceptable: bool


@dataclass(frozen=True)
class Curve:
    """
    Allan deviation at octave averaging times; every tuple has the length of `tau_s`.

    `model_adev` is the Allan deviation of the reported coefficients, processes and tones together;
    0 if there are none.
    """

    tau_s: tuple[AboveZero, ...]
    adev: tuple[NotNegative, ...]
    edf: tuple[AboveZero, ...]
    ci68: tuple[Interval, ...]
    ci95: tuple[Interval, ...]
    model_adev: tuple[NotNegative, ...]


@dataclass(frozen=True)
class Spectrum:
    """
    Two-sided power spectral density in bands of an eighth of an octave, lines included.

    `passed` is the share of the white noise that a low-pass lets pass; empty without a low-pass.
    """

    frequency_hz: tuple[AboveZero, ...]
    psd: tuple[NotNegative, ...]
    passed: tuple[NotNegative, ...] = ()


@dataclass(frozen=True)
class Signal:
    """
    The samples over time, as lowest, mean and highest value of segments of equal length.

    Attributes
    ----------
    step_s : float
        Length of a segment; the first one begins at the first sample. Parts between clock jumps
        follow each other directly.
    low, mean, high : tuple of float or None
        In the unit of a sample; None for a segment without samples.

    """

    step_s: AboveZero
    low: tuple[float | None, ...]
    mean: tuple[float | None, ...]
    high: tuple[float | None, ...]


@dataclass(frozen=True)
class Span:
    """A span of the record: start and duration in seconds."""

    start_s: float
    duration_s: float


@dataclass(frozen=True)
class Saturation:
    """Clipping of an axis: the value at which it is cut off, and the share of samples there."""

    value: float
    share: float


@dataclass(frozen=True)
class Deadband:
    """Small values of an axis set to zero: the largest such magnitude, and the share of zeros."""

    width: float
    share: float


@dataclass(frozen=True)
class AxisResult:
    """
    Everything known about one axis.

    `band_limit_s` is the effective window of a low-pass, if one was found. `band_edge_hz` is the
    highest fitted frequency, if higher ones were excluded. `sample_rate_hz` and `rest_s` (see
    `Timeline`) are set where each of the two sensors has its own. `tones` are the lines excluded
    from the fit, the strongest first. They are part of the noise of a sample. `coarse_step` is the
    step of an output that is coarser than that noise.

    An axis has no coefficients if it was constant during `stood_still`, is `saturated` or has a
    `deadband`. Neither has one from a filter that removes everything slower than `high_passed_hz`,
    the mean included.
    """

    quantity: str
    unit: str
    mean: float | None
    band_limit_s: NotNegative | None
    tones: tuple[Tone, ...]
    coefficients: Mapping[str, Coefficient] = field(hash=False)
    goodness_of_fit: GoodnessOfFit
    curve: Curve
    gauss_markov: GaussMarkov | None = None
    spectrum: Spectrum | None = None
    drift_model: DriftModel | None = None
    trend: Trend | None = None
    stationarity: Stationarity | None = None
    backtest: Backtest | None = None
    signal: Signal | None = None
    sample_rate_hz: AboveZero | None = None
    band_edge_hz: AboveZero | None = None
    stood_still: Span | None = None
    high_passed_hz: AboveZero | None = None
    saturated: Saturation | None = None
    deadband: Deadband | None = None
    coarse_step: float | None = None
    power_law: PowerLaw | None = None
    rest_s: NotNegative | None = None

    @property
    def constant(self) -> bool:
        """Return whether all samples have the same value."""
        return bool(self.curve.adev) and not any(self.curve.adev)

    @property
    def fault(self) -> Fault | None:
        """Return why the axis fails to measure, at least at times; a deadband is 'zeroed'."""
        seen: dict[Fault, object] = {'constant': self.constant, 'dead': self.stood_still,
                                     'saturated': self.saturated, 'zeroed': self.deadband}
        return next((fault for fault, found in seen.items() if found), None)

    def __str__(self) -> str:
        """Return the coefficients in one line, in SI units, with their 95 % intervals."""
        return ', '.join(map(str, self.coefficients.values()))

    def __repr__(self) -> str:
        """Return the coefficients in one line."""
        return f'<AxisResult of {self.quantity}: {self}>'

    def to_dict(self) -> dict[str, Any]:
        """Return the axis object of the JSON schema."""
        return plain(self)  # type: ignore[no-any-return]


@dataclass(frozen=True)
class Total:
    """Number and duration of all spans of a kind, listed or not."""

    count: int
    duration_s: NotNegative


@dataclass(frozen=True)
class Timeline:
    """
    Rate, number and faults of the samples, as found by the timeline.

    `all_gaps` and `all_motion` are set if there are more spans than are listed.
    """

    sample_rate_hz: AboveZero | None
    samples: int
    duration_s: NotNegative
    missing: int = 0
    duplicates: int = 0
    out_of_order: int = 0
    rejected: int = 0
    gaps: tuple[Span, ...] = ()
    motion: tuple[Span, ...] = ()
    all_gaps: Total | None = None
    all_motion: Total | None = None

    @property
    def totals(self) -> tuple[Total, Total]:
        """Return number and duration of the gaps, and of the spans of motion."""
        return self.all_gaps or _total(self.gaps), self.all_motion or _total(self.motion)

    @property
    def rest_s(self) -> float:
        """Return the seconds of samples in use, without gaps and motion."""
        if not self.sample_rate_hz:
            return self.duration_s
        _, moved = self.totals
        sampled_s = min(self.duration_s, self.samples / self.sample_rate_hz)
        return max(sampled_s - moved.duration_s, 0.0)


def _total(listed: tuple[Span, ...]) -> Total:
    return Total(len(listed), sum(span.duration_s for span in listed))


@dataclass(frozen=True)
class Source:
    """
    Where the samples came from.

    A datasheet has no samples: its numbers replace a result, to write a filter configuration.
    `files` distinguishes the files of a recording from others of the same name (`files_digest`).
    """

    kind: Literal['recording', 'topic', 'datasheet']
    path: str | None
    topic: str | None
    frame_id: str | None
    start_time: str | None
    clock: Literal['header', 'receive'] | None
    files: str | None = None


@dataclass(frozen=True)
class SensorVerdict:
    """
    Whether the numbers of a sensor can be used, and the codes of the findings that decide it.

    'with_care': something has to be done first, or is less certain than it should be.
    'not_usable': there are no numbers, or they describe something else.
    """

    verdict: Literal['good', 'with_care', 'not_usable']
    because: tuple[str, ...] = ()


@dataclass(frozen=True)
class RecordingPart:
    """One recording of a joint result, with the mean of each axis in it."""

    path: str
    start_time: str | None
    duration_s: float
    means: Mapping[str, float]


@dataclass(frozen=True)
class TurnOnBias:
    """Spread of the mean between power-ons: standard deviation, with 95 % interval."""

    sigma: float
    ci95: Interval


@dataclass(frozen=True)
class Inspection:
    """Which unit was measured, by whom and where, for the records of a production line."""

    serial: str | None = None
    operator: str | None = None
    station: str | None = None


@dataclass(frozen=True)
class Result:
    """
    The complete result, as in the result file.

    `recordings` and `turn_on_bias` are set in a joint result. `temperature`, in degrees Celsius,
    is from a thermometer beside the sensor, on the time axis of the signals. `sensors` has the
    verdicts on ``gyro`` and ``accel``.
    """

    imu_allan_version: str
    source: Source
    timeline: Timeline
    axes: Mapping[str, AxisResult]
    warnings: tuple[Finding, ...] = ()
    recordings: tuple[RecordingPart, ...] = ()
    turn_on_bias: Mapping[str, TurnOnBias] = field(default_factory=dict)
    inspection: Inspection | None = None
    temperature: Signal | None = None
    sensors: Mapping[str, SensorVerdict] = field(default_factory=dict)
    schema: str = field(default=SCHEMA)

    def __str__(self) -> str:
        """Return the table that the command prints, 80 columns wide."""
        # The table is made by a writer; nothing else here depends on writers.
        text: str = import_module('imu_allan.writers.table').result_text(self)
        return text

    def __repr__(self) -> str:
        """Return one line about the recording; `str` returns the table."""
        timeline = self.timeline
        names = [str(name) for name in (self.source.path, self.source.topic) if name]
        rate = '' if timeline.sample_rate_hz is None else f' at {timeline.sample_rate_hz:.6g} Hz'
        return (f'<Result of {" ".join(names) or "samples"}: {timeline.samples:,} samples{rate}, '
                f'{timeline.duration_s:.6g} s, axes={len(self.axes)}, '
                f'findings={len(self.warnings)}>')

    def rest_of(self, part: str) -> float:
        """Return the seconds of samples in use of a sensor (``gyro``) or axis (``gyro_x``)."""
        return next((axis.rest_s for name, axis in self.axes.items()
                     if name.startswith(part) and axis.rest_s is not None), self.timeline.rest_s)

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object, schema first."""
        document = plain(self)
        return {'schema': document.pop('schema'), **document}

    def to_json(self) -> str:
        """Return the JSON text with each series on one line; numbers are read back exactly."""
        return json_text(self.to_dict()) + '\n'

    @classmethod
    def from_dict(cls, document: object, name: str = 'result') -> 'Result':
        """
        Read the JSON object back.

        Raises
        ------
        ImuAllanError
            If `document` is not of the schema; the message names the field, prefixed by `name`.

        """
        schema = document.get('schema') if isinstance(document, Mapping) else None
        if schema != SCHEMA:
            before, _, version = str(schema).rpartition('/')
            if before == SCHEMA.rpartition('/')[0] and version.isdecimal():
                raise ImuAllanError(
                    f'{name}: written by a newer imu_allan (schema {shorten(str(schema), 40)}, '
                    f'this one reads {SCHEMA}); update imu_allan')
            raise ImuAllanError(
                f'{name}: not an imu_allan result file (no "schema": "{SCHEMA}"); '
                'write one with: imu_allan analyze RECORDING --json FILE')
        return typed(cls, document, name)  # type: ignore[no-any-return]
