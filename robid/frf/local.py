"""Local polynomial and rational models of the response over neighbouring lines; what their overlap does to errors."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.blocks import BlockEstimate
from robid.frf.distortion import FEWEST
from robid.frf.options import EstimateOptions
from robid.frf.reading import Windows
from robid.frf.spectra import Blocks

_FEWEST = 1e-9  # share of a realization's own variance that the fit left


def _window_correlation(gain: ComplexArray, index: IntArray) -> FloatArray:
    """Correlation (n_freq, n_next) of each line's error with those of the next lines, mean over the inputs.

    An error at one bin is in all windows (n_freq, width) that hold the bin: the correlation is that of the weights
    (n_freq, n_in, n_row) there, rows bin after bin of each experiment; 0 where windows have no bin in common.
    """
    n_freq, width = index.shape
    weights = gain.reshape(n_freq, -1, width)
    size = np.sqrt((np.abs(weights) ** 2).sum(axis=(1, 2)))
    found: list[FloatArray] = []
    for ahead in range(1, n_freq):
        # Windows are runs of bins: how far the next one is shifted says which bins both hold.
        shift = index[ahead:, 0] - index[:-ahead, 0]
        correlation = np.zeros(n_freq)
        for step in np.unique(shift[shift < width]):
            first = np.flatnonzero(shift == step)
            # cov(e_a, e_b) of white bins is the product of both weights, summed over shared bins.
            shared = weights[first, :, step:].conj() * weights[first + ahead, :, : width - step]
            correlation[first] = np.real(shared.sum(axis=(1, 2))) / (size[first] * size[first + ahead])
        if not (shift < width).any():
            break
        found.append(correlation)
    return np.stack(found, axis=1) if found else np.zeros((n_freq, 0))


def _realization_scale(
    gain: ComplexArray, residual: ComplexArray, orthonormal: ComplexArray, covariance: ComplexArray, n_real: int
) -> FloatArray:
    """Variance of each element between realizations over that of independent rows (n_out, n_in), mean over the lines.

    Distortion errs alike at all lines and experiments of a realization. What a realization's residuals add to the
    response is compared with what independent ones would, less the part that the fit itself took out.

    Rows (n_freq, n_row, n_out) go realization after realization; a single one has no scale of its own.
    """
    n_freq, n_in, _ = gain.shape
    n_out = residual.shape[-1]
    if n_real < 2:
        return np.ones((n_out, n_in))
    weights = gain.reshape(n_freq, n_in, n_real, -1)
    rows = residual.reshape(n_freq, n_real, -1, n_out)
    basis = orthonormal.reshape(n_freq, n_real, rows.shape[2], -1)
    # What each realization's residuals add to the response, squared; independent rows would add level times kept.
    added = (np.abs(np.einsum("fimk,fmko->fmoi", weights, rows, optimize=True)) ** 2).sum(axis=1)
    own = (np.abs(weights) ** 2).sum(axis=(2, 3))
    # Residuals lack what the fit took out: the share of a realization's weights that lies in its column space.
    kept = own - (np.abs(np.einsum("fimk,fmkq->fimq", weights, basis, optimize=True)) ** 2).sum(axis=(2, 3))
    level = np.real(np.diagonal(covariance, axis1=1, axis2=2))
    expected = level[:, :, None] * kept[:, None, :]
    usable = (expected > 0) & (kept > _FEWEST * own)[:, None, :]
    return np.asarray(np.divide(added, expected, out=np.ones_like(added), where=usable).mean(axis=0))


def mean_correlation(correlation: FloatArray, told: BoolArray) -> FloatArray:
    """Mean correlation (n_conf, n_next) of a line's error with those of the next lines, where both tell something.

    Args:
        correlation (n_conf, n_freq, n_next): Of each line's error with those of the next lines.
        told (n_conf, n_freq): Lines that tell something; nothing is correlated with the others.
    """
    n_conf, n_freq, n_next = correlation.shape
    mean = np.zeros((n_conf, n_next))
    for ahead in range(1, min(n_next, n_freq - 1) + 1):
        both = told[:, :-ahead] & told[:, ahead:]
        shared = (correlation[:, :-ahead, ahead - 1] * both).sum(axis=1)
        mean[:, ahead - 1] = shared / np.maximum(both.sum(axis=1), 1)
    return mean


_CONDITION_LIMIT = 1e8
# Variance of a response with a transient beside it, over that without, from which it passes for the transient.
_HIDDEN = 30.0


@dataclass(frozen=True)
class LocalEstimate(BlockEstimate):
    """A response with the covariance that its local fits' residuals show.

    The weights' experiments are all bins of all experiments, `n_real n_exp width`, of a single block.
    """

    covariance: ComplexArray  # (n_freq, n_out, n_out) Covariance of one experiment's output residual
    freedom: float  # Complex degrees of freedom of each
    element_scale: FloatArray  # (n_out, n_in) Variance of each element over that of the product, mean over the lines
    # (n_freq, n_next) Correlation of each line's error with those of the next lines, whose windows hold the same bins;
    # the denominator's part is taken to be alike
    line_correlation: FloatArray
    determined: BoolArray  # (n_window,) Whether the bins of each window determine a model; all else is of those that do
    # (n_freq, n_in) Whether an input acts so near to an end of the record that its response looks like the transient
    hidden: BoolArray


def local_fit(blocks: Blocks, windows: Windows, options: EstimateOptions) -> LocalEstimate:
    """Fits `D Y = N U + T` around every line by linear least squares, over all experiments at once.

    N is a matrix polynomial in the frequency, D a polynomial common to all outputs (1 without `local_denominator`), T
    the transient of each experiment (`local` only). Where the reference was recorded, inputs and outputs are both
    fitted to it and the response is their ratio, as the loop is closed. The covariance is of first order in the noise.

    Raises:
        DataError: If the bins around hardly any line determine the model.

    Source:
        Pintelon and Schoukens (2012), ch. 7; McKelvey and Guerin (2012), IFAC SYSID (rational); docs/methods, sec. 4.
    """
    n_in, n_power = blocks.inputs.shape[2], options.local_order + 1
    inputs, outputs = windows.rows(blocks.inputs), windows.rows(blocks.outputs)
    indirect, regressor, explained = blocks.reference is not None, inputs, outputs
    if blocks.reference is not None:
        regressor, explained = windows.rows(blocks.reference), np.concatenate([inputs, outputs], axis=-1)
    powers = windows.offset[:, :, None] ** np.arange(n_power)
    # The transient is a polynomial of each experiment: projecting it out spares its coefficients (Frisch and Waugh).
    silence = _transient_projection(powers) if options.estimator == "local" else None
    fit = _Fit(_flat(_products(powers, regressor), silence), n_in)
    if not fit.determined.all():
        return replace(local_fit(blocks, windows.at(fit.determined), options), determined=fit.determined)
    observed = _flat(explained, silence)
    # Each experiment's transient, each input's numerator, and the denominator take their coefficients' freedom.
    own = n_power * (n_in + regressor.shape[1] * (silence is not None))
    freedom = float(observed.shape[1] - own - options.local_denominator)
    denominator = None
    if options.local_denominator:
        degrees = windows.offset[:, :, None] ** np.arange(1, options.local_denominator + 1)
        denominator = _Denominator(fit, observed, _flat(_products(degrees, explained), silence), degrees.shape[-1])
        observed = observed + denominator.change
    found = _estimate(fit, observed, denominator, freedom, n_in, len(blocks.inputs), windows, indirect=indirect)
    return found if silence is None else replace(found, hidden=_hidden(_products(powers, inputs), silence, n_in))


def _refuse_undriven(followed: ComplexArray) -> None:
    """Refuses references that some input (n_freq, n_in, n_in) does not follow at any of some lines.

    Raises:
        DataError: With how many lines there are.
    """
    rank = np.linalg.matrix_rank(followed)
    lost = int((rank < followed.shape[-1]).sum())
    if lost:
        message = f"D604 at {lost} of {len(followed)} lines an input does not follow the reference"
        raise DataError(message, where="record", remedy="check the inputs' channels, or estimate without the reference")


def _hidden(columns: ComplexArray, silence: FloatArray, n_in: int) -> BoolArray:
    """Whether each input's response (n_freq, n_in) is known much worse with the transients than alone.

    Asked of the inputs even where a reference stands for them: a position that ends elsewhere than it began looks like
    a transient, whatever it makes the motors do.
    """
    fits = (_Fit(_flat(columns, kept), n_in) for kept in (silence, None))
    size, without = ((np.abs(each.gain(n_in)) ** 2).sum(axis=2) for each in fits)
    return np.asarray(size > _HIDDEN * without)


def _estimate(
    fit: _Fit,
    observed: ComplexArray,
    denominator: _Denominator | None,
    freedom: float,
    n_in: int,
    n_real: int,
    windows: Windows,
    *,
    indirect: bool,
) -> LocalEstimate:
    """Reads the response off a fit; of an indirect one the first observations are the inputs."""
    # At the line itself the offset is zero: the model there is its constant coefficient.
    centre, output = fit.centre(observed, n_in), fit.residual(observed)
    turn = np.eye(n_in)[None].astype(complex)
    response = np.swapaxes(centre, 1, 2)
    if indirect:
        _refuse_undriven(centre[..., :n_in])
        # Both sides are fitted to the reference: G = (Y/R) (U/R)^-1.
        turn = np.linalg.inv(centre[..., :n_in])
        response = np.swapaxes(turn @ centre[..., n_in:], 1, 2)
        output = _output_part(output, response, n_in)
    gain = turn @ fit.gain(n_in)
    # Residuals over the freedom that coefficients and transients leave.
    covariance = np.einsum("fro,frp->fop", output, output.conj()) / freedom
    scale = _realization_scale(gain, output, fit.orthonormal, covariance, n_real)
    if denominator is not None:
        slope = turn[:, None] @ denominator.sensitivity(n_in)
        slope = _output_part(slope, response[:, None], n_in) if indirect else slope
        scale = scale * _element_scale(slope, denominator.covariance(freedom), gain, covariance)
    correlation = _window_correlation(gain, windows.index)
    weights = np.swapaxes(gain, 1, 2)[None]
    hidden = np.zeros((len(response), n_in), bool)
    return LocalEstimate(response, weights, covariance, freedom, scale, correlation, fit.determined, hidden)


class _Fit:
    """Least squares of all lines at once by QR."""

    def __init__(self, columns: ComplexArray, n_in: int) -> None:
        # QR instead of normal equations, which would square the condition.
        self.orthonormal, self._triangle = np.linalg.qr(columns)
        # Columns of one input over their largest size, so that units of inputs do not enter the condition.
        size = np.linalg.norm(self._triangle, axis=1).reshape(len(columns), -1, n_in).max(axis=1)
        divisor = np.where(size > 0, size, 1.0)
        scaled = self._triangle / np.tile(divisor, columns.shape[2] // n_in)[:, None]
        self.determined = (size > 0).all(axis=1)
        self.determined[self.determined] = np.linalg.cond(scaled[self.determined]) < _CONDITION_LIMIT
        needed, left = min(FEWEST, len(columns)), int(self.determined.sum())
        if left < needed:
            message = (
                "D021 the spectrum around a line is too empty to determine a local model of every motor's response:"
                f" {left} of {len(columns)} lines have one, {needed} are needed"
            )
            remedy = "use `robust_local` for sparse lines of periodic data; else excite all motors, or widen the window"
            raise DataError(message, remedy=remedy)

    def centre(self, observed: ComplexArray, n_in: int) -> ComplexArray:
        """Transposed model (n_freq, n_in, n_observed) at the lines themselves."""
        solution = np.linalg.solve(self._triangle, self._adjoint @ observed)
        return np.asarray(solution[:, :n_in])

    def gain(self, n_in: int) -> ComplexArray:
        """What turns observations into `centre` (n_freq, n_in, n_row)."""
        return np.asarray(np.linalg.solve(self._triangle, self._adjoint)[:, :n_in])

    def residual(self, observed: ComplexArray) -> ComplexArray:
        """What the model leaves of the observations."""
        return np.asarray(observed - self.orthonormal @ (self._adjoint @ observed))

    @property
    def _adjoint(self) -> ComplexArray:
        return np.asarray(np.swapaxes(self.orthonormal.conj(), 1, 2))


class _Denominator:
    """Coefficients of the denominator that all outputs share, weighted by the residual of each."""

    def __init__(self, fit: _Fit, observed: ComplexArray, flat: ComplexArray, order: int) -> None:
        products = flat.reshape(*flat.shape[:2], order, -1)
        self._fit, self._products = fit, products
        # The numerator is eliminated: only what it leaves of (D - 1) Y tells the denominator.
        left, moved = fit.residual(observed), fit.residual(flat).reshape(products.shape)
        rest = left
        # The weights settle after one step; noise-free outputs keep a floor.
        for _ in range(2):
            variance = np.mean(np.abs(rest) ** 2, axis=1) + 1e-24 * np.mean(np.abs(observed) ** 2, axis=1)
            # Each output weighs by its own residual's variance, as all share one denominator.
            weighted = moved.conj() / variance[:, None, None]
            self._normal = np.einsum("frso,frto->fst", weighted, moved)
            self._coefficients = -np.linalg.solve(self._normal, np.einsum("frso,fro->fs", weighted, left)[..., None])
            rest = left + np.einsum("frso,fs->fro", moved, self._coefficients[..., 0])
        self._rows = products.shape[1]

    @property
    def change(self) -> ComplexArray:
        """`(D - 1) Y` of all bins."""
        return np.asarray(np.einsum("frso,fs->fro", self._products, self._coefficients[..., 0]))

    def sensitivity(self, n_in: int) -> ComplexArray:
        """Derivative (n_freq, n_den, n_in, n_observed) of the transposed model at the line."""
        flat = self._products.reshape(*self._products.shape[:2], -1)
        moved = self._fit.centre(flat, n_in)
        return np.asarray(np.moveaxis(moved.reshape(*moved.shape[:2], *self._products.shape[2:]), 2, 1))

    def covariance(self, freedom: float) -> ComplexArray:
        """Covariance (n_freq, n_den, n_den) of the coefficients."""
        return np.asarray(np.linalg.inv(self._normal) * self._rows / freedom)


def _products(powers: FloatArray, spectra: ComplexArray) -> ComplexArray:
    """Powers (n_freq, width, n) times spectra (n_freq, n_exp, width, m), joined to columns n m."""
    return (powers[:, None, :, :, None] * spectra[:, :, :, None, :]).reshape(*spectra.shape[:3], -1)


def _transient_projection(powers: FloatArray) -> FloatArray:
    """What takes a polynomial of each experiment's own out of its window (n_freq, width, width)."""
    return np.asarray(np.eye(powers.shape[1]) - powers @ np.linalg.pinv(powers))


def _flat(windowed: ComplexArray, silence: FloatArray | None) -> ComplexArray:
    """Joins experiments and bins (n_freq, n_exp, width, n) to rows, their transients removed."""
    kept = windowed if silence is None else silence[:, None] @ windowed
    return kept.reshape(len(kept), -1, kept.shape[-1])


def _output_part(joint: ComplexArray, response: ComplexArray, n_in: int) -> ComplexArray:
    """`V_y - G V_u` of rows (..., n_row, n_in + n_out)."""
    return np.asarray(joint[..., n_in:] - joint[..., :n_in] @ np.swapaxes(response, -1, -2))


def _element_scale(
    moved: ComplexArray, denominator: ComplexArray, gain: ComplexArray, covariance: ComplexArray
) -> FloatArray:
    """Variance (n_out, n_in) with that of the denominator, over the product's, mean over the lines."""
    # Variance through the denominator: its sensitivity times its covariance, to first order.
    added = np.real(np.einsum("fsio,fst,ftio->foi", moved, denominator, moved.conj()))
    rows = np.real(np.diagonal(covariance, axis1=1, axis2=2))
    product = rows[:, :, None] * (np.abs(gain) ** 2).sum(axis=2)[:, None]
    return np.asarray(1 + np.divide(added, product, out=np.zeros_like(product), where=product > 0).mean(axis=0))
