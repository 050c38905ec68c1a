# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""Chart of the power spectral density: measured, fitted, and the lines left out."""

from collections.abc import Mapping

from imu_allan.noise.terms import AXES
from imu_allan.result import AxisResult, Timeline
from imu_allan.sensor.units import engineering, typeset
from imu_allan.wording import number
from imu_allan.writers.charts.chart import box_of, Chart, sensor_chart, worst_axis
from imu_allan.writers.curves import coefficients_of, density_limits, in_bands, model_density
from imu_allan.writers.svg import Drawing, group
import numpy as np


def density_chart(sensor: str, axes: Mapping[str, AxisResult], timeline: Timeline) -> Chart | None:
    """
    Draw the power spectral density, measured and fitted, and the lines left out.

    Parameters
    ----------
    sensor : str
        'gyro' or 'accel'.
    axes : mapping of name to AxisResult
        Of the sensor.
    timeline : Timeline
        Of the same result.

    Returns
    -------
    Chart or None
        None where neither a spectrum nor a model is known.

    """
    known = {name: axis for name, axis in axes.items()
             if axis.spectrum is not None or coefficients_of(axis)}
    rate = timeline.sample_rate_hz
    if not known or rate is None or timeline.duration_s <= 0:
        return None
    unit = AXES[next(iter(known))].unit
    factor, shown = engineering(1.0, unit)
    low, high = density_limits(known.values(), timeline)
    lowest = min(1 / timeline.duration_s, rate / 4)
    frequency = np.geomspace(lowest, rate / 2, 160)

    def draw(drawing: Drawing, narrow: bool) -> None:
        panel = drawing.panel(box_of(drawing, narrow), (lowest / 1.2, rate / 2 * 1.2, True),
                              (low * factor**2, high * factor**2, True))
        for name, axis in known.items():
            if axis.band_edge_hz is not None:
                panel.parts.append(group(name[-1], 'detail', [panel.span(
                    axis.band_edge_hz, rate / 2, 'beyond-band',
                    f'{name[-1]} axis: not fitted above {axis.band_edge_hz:.3g} Hz')]))
            # The strongest: of more the labels hide each other.
            for tone in axis.tones[:12]:
                amount = number(tone.amplitude * factor, 3)
                panel.parts.append(group(name[-1], 'detail', [panel.upright(
                    tone.frequency_hz, 'tone',
                    f'{name[-1]} axis: line at {tone.frequency_hz:.4g} Hz, {amount} '
                    f'{typeset(shown)}, left out of the fit')]))
        panel.frame('frequency [Hz]',
                    f'power spectral density, two-sided [({typeset(shown)})²/Hz]',
                    None if narrow else (factor**-2, f'[({typeset(unit)})²/Hz]'))
        inside = []
        for name, axis in known.items():
            if axis.spectrum is not None:
                at, power = in_bands(axis.spectrum)
                inside.append(group(name[-1], f'axis-{name[-1]}', [
                    panel.line(at, power * factor**2, 'measured')]))
        for name, axis in known.items():
            model = model_density(axis, frequency, rate) * factor**2
            inside.append(group(name[-1], f'axis-{name[-1]}', [
                panel.line(frequency, np.where(model > 0, model, np.nan), 'curve model')]))
        drawing.add(panel, inside)

    shaded = any(axis.band_edge_hz is not None for axis in known.values())
    return sensor_chart(
        sensor, 'psd', 'power spectral density', 'power spectral density against frequency',
        'Thin: measured, in bands of a quarter of an octave. Thick: fitted model, low-pass '
        'included; white noise of density N stands at N². Upright: lines that were left out of '
        'the fit.' + (' Shaded: frequencies that were left out.' if shaded else ''), (400, 320),
        draw, known, worst_axis(known))
