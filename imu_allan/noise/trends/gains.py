# Copyright 2026 The imu_allan authors
# SPDX-License-Identifier: Apache-2.0
"""
How much of the slowest coefficients of a record a trend of the mean would explain.

The gain of a trend is the chi-square that its regression explains beyond the ramp, for noise of a
given spectrum. It is computed along the grid of the nuisance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from imu_allan.arrays import Array
from imu_allan.noise.trends.kinds import Found, TrendKind, TRENDS, waveforms
from imu_allan.noise.trends.regressors import RecordSpectrum
import numpy as np

SLOWEST = 128
"""Number of the slowest coefficients of the record that are searched for trends."""


class Bank:
    """Transforms of all candidate trends at the slowest coefficients, shared by all axes."""

    def __init__(self, record: RecordSpectrum, kinds: Sequence[TrendKind] = TRENDS) -> None:
        self.kinds, self.duration_s = kinds, record.duration_s
        self._record = record

    @cached_property
    def grids(self) -> list[Array]:
        """Return the values of the nuisance of every kind."""
        return [kind.grid(self.duration_s) for kind in self.kinds]

    @cached_property
    def columns(self) -> list[tuple[Array, Array]]:
        """Transform the candidates of every kind; computed on first use."""
        return [self.regressors(kind, grid)
                for kind, grid in zip(self.kinds, self.grids, strict=True)]

    def regressors(self, kind: TrendKind, values: Array, slowest: int = SLOWEST
                   ) -> tuple[Array, Array]:
        """
        Transform candidates, shape (values, columns of the kind, coefficients).

        Returns: also the products of the columns of a candidate, shape (values, columns, columns,
        coefficients), which take longer than all that is done with them.
        """
        trends = [kind.columns(float(value), self.duration_s) for value in values]
        transforms = self._record.regressors(
            [column for trend in trends for column in trend], slowest)
        columns = transforms.T.reshape(len(values), len(trends[0]), -1)
        return columns, np.einsum('vin,vjn->vijn', columns, columns)


class AxisBank:
    """Candidate trends at the slowest coefficients of one axis, without those of lines."""

    def __init__(self, bank: Bank, record: RecordSpectrum, slowest: int = SLOWEST) -> None:
        self.shared, self.record, self._slowest, bins = bank, record, slowest, record.bins
        slow = bins.whole & (bins.index <= slowest)
        used = slow & record.keep
        # Which of the slowest coefficients are not part of a line
        self._used = used[slow]
        self._frequency, self._ramp = bins.frequency[used], bins.of_ramp[used]
        self._coefficient = bins.coefficient[record.axis, used]

    @cached_property
    def _columns(self) -> list[tuple[Array, Array]]:
        return list(map(self._without_lines, self.shared.columns))

    def _without_lines(self, found: tuple[Array, Array]) -> tuple[Array, Array]:
        columns, products = found
        return found if self._used.all() else (columns[..., self._used], products[..., self._used])

    def whitened(self, frequency: Array, power: Array, others: Sequence[Found]) -> 'Whitened':
        """
        Whiten the coefficients and remove the ramp and the trends in `others`.

        `power`, shape (noises, groups): expected power of noise models, at each `frequency`.
        """
        group = np.searchsorted(frequency, self._frequency * 0.99999).clip(0, len(frequency) - 1)
        # The lower limit keeps products with the reciprocal finite.
        scale = 1 / np.sqrt(np.maximum(np.atleast_2d(power)[:, group], 1e-200))
        trends = [*self.record.in_every_fit, *waveforms(others, self.shared.duration_s)]
        columns = np.column_stack((
            self._ramp, self.record.regressors(trends, self._slowest)[self._used]))
        basis = np.linalg.qr(columns * scale[:, :, None])[0]
        residual = (self._coefficient * scale)[:, :, None]
        residual = residual - basis @ (basis.transpose(0, 2, 1) @ residual)
        return Whitened(self, others, scale, basis * scale[:, :, None], residual[:, :, 0] * scale)

    def columns(self, number: int, values: Array | None = None) -> tuple[Array, Array]:
        """Return the candidates of a kind along its grid, or at `values`, with their products."""
        return self._columns[number] if values is None else self._without_lines(
            self.shared.regressors(self.shared.kinds[number], values, self._slowest))


@dataclass(frozen=True)
class Whitened:
    """
    Coefficients of a record, whitened by noise models, without the part that other trends explain.

    Attributes
    ----------
    bank : AxisBank
    others : sequence of Found
        The other trends, besides the ramp.
    scale : ndarray, shape (noises, coefficients)
        Reciprocal of the standard deviation.
    basis : ndarray, shape (noises, coefficients, other trends)
        Orthonormal basis of the whitened other trends, times `scale`.
    residual : ndarray, shape (noises, coefficients)
        Whitened residual, times `scale`.

    """

    bank: AxisBank
    others: Sequence[Found]
    scale: Array
    basis: Array
    residual: Array

    def of_noise(self, noise: int) -> 'Whitened':
        """Return the arrays of one of the noise models."""
        return replace(self, **{name: getattr(self, name)[[noise]]
                                for name in ('scale', 'basis', 'residual')})

    def gains(self, number: int, values: Array | None = None) -> Array:
        """
        Return the chi-square that a kind explains along its grid, or at `values`.

        `number`: of the kind in the bank. Returns shape (noises, values).
        """
        columns, products = self.bank.columns(number, values)
        target = np.tensordot(self.residual, columns, (1, 2))
        explained = np.tensordot(self.basis, columns, (1, 2))
        gram = np.tensordot(self.scale**2, products, (1, 3))
        # The ridge rejects trends that no coefficient shows, such as a step between two runs, and
        # trends that are almost a combination of the others.
        ridge = (1e-9 * np.trace(gram, axis1=2, axis2=3)
                 + np.finfo(np.float64).tiny)[:, :, None, None]
        gram = gram - np.einsum('abvi,abvj->avij', explained, explained)
        if columns.shape[1] == 1:
            return np.asarray(target[:, :, 0]**2 / np.maximum(gram, ridge)[:, :, 0, 0])
        gram += ridge * np.eye(columns.shape[1])
        return np.asarray((target * np.linalg.solve(gram, target[..., None])[..., 0]).sum(axis=2))

    def likeliest(self, number: int, gains: Array) -> Found:
        """
        Find the best value of a nuisance, and the log of what integrating over it contributes.

        `gains`: along the grid of the kind, for the only noise model.
        """
        kind, grid = self.bank.shared.kinds[number], self.bank.shared.grids[number]
        values, gains = self._profile(number, gains)
        likelihood_ratio = np.exp((gains - gains.max()) / 2)
        # The integral runs over the index, because grid values are equally likely.
        place = np.interp(values, grid, np.arange(len(grid)) / max(len(grid) - 1, 1))
        share = (float(((likelihood_ratio[1:] + likelihood_ratio[:-1]) * np.diff(place)).sum()) / 2
                 if len(grid) > 1 else float(likelihood_ratio.mean()))
        low, high = _interval(values, gains)
        # A lag that is not seen counts as none. During a warm-up it would only scale the slope,
        # whose interval does not include it. No other nuisance can be zero.
        value = 0.0 if low <= 0 <= high else float(values[largest(gains)])
        return Found(kind, value, (low, high), float(np.log(max(share, 1e-12))))

    def _profile(self, number: int, gains: Array) -> tuple[Array, Array]:
        """Return nuisance values of a kind and their gains, refined around the best value."""
        kind, values = self.bank.shared.kinds[number], self.bank.shared.grids[number]
        gains = self._apart(kind, values, gains)
        if len(values) < 3:
            return values, gains
        # Refine the grid around the best value until the gain hardly changes.
        for _ in range(8):
            best = largest(gains)
            near = values[max(best - 1, 0):best + 2]
            between = np.setdiff1d(np.linspace(near[:-1], near[1:], 5), near)
            if not len(between):
                break
            more = self._apart(kind, between, self.gains(number, between)[0])
            values, gains = np.append(values, between), np.append(gains, more)
            order = np.argsort(values)
            values, gains = values[order], gains[order]
            if float(np.ptp(np.sort(gains)[-3:])) < 0.02:
                break
        return values, gains

    def _apart(self, kind: TrendKind, values: Array, gains: Array) -> Array:
        """Return gains, zero near another trend of the same kind."""
        # Two nearly equal trends of opposite sign are the derivative of one, not two trends.
        for other in self.others:
            if other.kind.key == kind.key:
                near = (np.abs(np.log(values / other.value)) < np.log(2) if kind.smooth else
                        np.abs(values - other.value) < self.bank.shared.duration_s / 64)
                gains = np.where(near, 0.0, gains)
        return gains


def largest(gains: Array) -> int:
    """Return the first of the largest gains; those of a step within one block are equal."""
    # Which of equal gains is the largest would depend on rounding.
    return int(np.argmax(gains > gains.max() - 1e-6))


def _interval(values: Array, gains: Array) -> tuple[float, float]:
    """Return the 95 % interval of the nuisance from the profile of the likelihood ratio."""
    # Twice the log likelihood ratio at the ends of the interval (Wilks).
    near = np.flatnonzero(gains > gains.max() - 3.841)
    return (float(values[max(near[0] - 1, 0)]), float(values[min(near[-1] + 1, len(values) - 1)]))
