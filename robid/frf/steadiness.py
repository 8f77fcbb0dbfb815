"""Whether the periods of a record repeat each other, channel by channel, and whether they begin with a transient."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from scipy.fft import rfft

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.frf.checks import RecordFinding
from robid.frf.spectra import Blocks, output_factor, period_contrasts
from robid.signals.record import Record

CHANGING_LIMIT = 0.1  # Relative change of the response from period to period above which periods cannot be averaged
_CHANGING = 0.03  # The same above which it is told
_REPEATS = 0.999  # of a channel's energy; the rest is what a good record has of noise
_SIGMAS = 5.0  # Standard deviations that a change stands out of what noise alone gives
_PATTERN = 0.5  # Share of the scatter of the periods that a single pattern has, beyond chance, where it is no noise
_BIAS = 0.01  # Bias by noise of the inputs above which it is told
_GAIN = 0.5  # Variance of the mean without its first period, over that with it, below which that period is a transient
# Share of how the first periods differ that the outputs' own shape has, above which it is a size and no transient.
_SIZED = 0.5
_LEFT_LINES = 8  # Lines from which on two periods that are left tell their own variance
_DRIFT_GAIN = 0.1  # The same where slopes count: drift that comes and goes makes large ones by chance
_SHOWN = 4  # Channels of a side that are told one by one

_Deviations: TypeAlias = ComplexArray


@dataclass(frozen=True)
class Steadiness:
    """How the periods of a record differ at the excited lines."""

    input_share: FloatArray  # (n_in,) Share of each input's energy that repeats
    output_share: FloatArray  # (n_out,) Share of each output's
    input_bias: float  # What noise of the inputs takes from the response, relative
    input_change: FloatArray  # (n_in,) Relative change of each input's size from period to period
    output_change: FloatArray  # (n_out,) The same of each output
    # Relative change of the response from period to period, of all lines alike; 0 where noise explains it
    change: float
    pattern: float  # The same of one pattern over the lines that comes back
    leading: int  # Periods at the beginning that are a transient
    gain: float  # Variance of the mean without them, over that with them

    @property
    def is_noise(self) -> bool:
        """Whether nothing but noise lets the periods differ."""
        changes = (self.change, self.pattern, *self.input_change)
        return not self.leading and max(changes) <= _CHANGING


def measure_steadiness(
    blocks: Blocks, response: ComplexArray, record: Record, *, accelerations: bool = True
) -> Steadiness | None:
    """Compares the periods of a record with each other; None with a single one.

    Inputs may change as long as the outputs follow: what counts against a record is a change of `Y - G U`. It is no
    noise where all lines change alike, or where one pattern over the lines comes back.

    Args:
        blocks: Its spectra at the excited lines, with the scatter of the periods.
        response (n_freq, n_out, n_in): The response.
        record: The record.
        accelerations: Whether motions were brought to accelerations.
    """
    n_period = record.inputs.shape[3]
    if n_period < 2 or blocks.scatter_freedom != n_period - 1:
        return None
    moved_in, moved_out = (_plain(scatter, blocks, record) for scatter in (blocks.input_scatter, blocks.output_scatter))
    power = (np.abs(blocks.outputs) ** 2).sum(axis=(0, 1, 3), keepdims=True)
    unit = np.where(power > 0, np.sqrt(power), 1.0)  # an output that never moves has no size
    # A change of inputs that outputs follow is no fault: V = dY - G dU is looked at, over the outputs' size.
    residual = (moved_out - response @ moved_in) / unit[:, None]
    factor = output_factor(record, blocks.lines, accelerations=accelerations)
    leading, gain = _transient(residual, _without_slope(residual, factor, unit, blocks.lines, record.inputs.shape[4]))
    if leading and _is_size(residual, blocks.outputs / unit, leading):
        leading, gain = 0, 1.0
    steady = slice(leading, None)
    rest = residual[:, steady] - residual[:, steady].mean(axis=1, keepdims=True)
    inputs, outputs = _scatter_share(moved_in, blocks.inputs), _scatter_share(moved_out, blocks.outputs)
    return Steadiness(
        input_share=1 - inputs,
        output_share=1 - outputs,
        input_bias=float((inputs / (1 - inputs)).max()) * _unfollowed(moved_in, response, residual, unit) / n_period,
        input_change=_change(moved_in[:, steady], blocks.inputs)[0],
        output_change=_change(moved_out[:, steady], blocks.outputs)[0],
        change=_alike(rest, blocks.outputs / unit),
        pattern=_pattern(rest),
        leading=leading,
        gain=gain,
    )


def steadiness_notes(found: Steadiness, record: Record) -> tuple[str, ...]:
    """Tells how much of each channel repeats, where it is less than nearly all."""
    if min(found.input_share.min(), found.output_share.min()) >= _REPEATS:
        return ()
    sides = (("inputs", record.input_names, found.input_share), ("outputs", record.output_names, found.output_share))
    told = "; ".join(f"{side} {_shares(names, share)}" for side, names, share in sides)
    return (f"Energy at the excited lines that repeats from period to period: {told}.",)


def steadiness_findings(found: Steadiness, record: Record) -> list[RecordFinding]:
    """What of it spoils a response: periods that differ by more than noise, noise of inputs, a transient."""
    findings = []
    n_period = record.inputs.shape[3]
    if max(found.change, found.pattern) > _CHANGING:
        sizes = [*found.input_change, *found.output_change]
        names = [f"input {name}" for name in record.input_names] + [f"output {name}" for name in record.output_names]
        worst = sorted(zip(sizes, names, strict=True), reverse=True)[:3]
        each = ", ".join(f"{name} {_percent(size)}" for size, name in worst)
        what = (
            f"D232 the response changes from period to period by {_percent(max(found.change, found.pattern))}, which "
            "is no"
            f" noise; the sizes of the channels change by: {each}"
        )
        remedy = "check that these channels were logged throughout, or leave out the periods that differ"
        findings.append(RecordFinding("unsteady", what, remedy, found.change > CHANGING_LIMIT))
    elif found.input_bias > _BIAS:
        worst_input = int(np.argmin(found.input_share))
        share = _percent(float(found.input_share[worst_input]))
        what = (
            f"D233 input {record.input_names[worst_input]} repeats to {share} only, and the outputs do not follow: "
            "the mean"
            f" of {n_period} periods biases the response by about {_percent(found.input_bias)}"
        )
        findings.append(RecordFinding("noisy_input", what, "record more periods, or log the reference too", False))
    if found.leading:
        noun = "first period is" if found.leading == 1 else f"first {found.leading} periods are"
        what = (
            f"D234 the {noun} a transient: without, the variance of the mean is {_percent(found.gain)} of what it is "
            "now"
        )
        remedy = (
            f"drop {found.leading} more at the beginning (`drop_periods` of a log, `transient_periods` of a simulation)"
        )
        findings.append(RecordFinding("transient", what, remedy, False))
    return findings


def _plain(scatter: ComplexArray, blocks: Blocks, record: Record) -> _Deviations:
    """Deviations (n_real, n_period, n_freq, n_channel, n_exp) of each period from the mean of all."""
    n_period, excited = record.inputs.shape[3], record.excited_lines
    beside = np.isin(blocks.lines - 1, excited) | np.isin(blocks.lines + 1, excited)
    part = np.where(beside, 1.0, 1 / (n_period + 1)) / n_period
    plain = scatter[:, : n_period - 1] / np.sqrt(part)[:, None, None]
    # Contrasts are orthonormal: their transpose makes deviations of them again.
    return np.asarray(np.einsum("dp,rdfce->rpfce", period_contrasts(n_period), plain))


def _scatter_share(moved: _Deviations, mean: ComplexArray) -> FloatArray:
    """Share of each channel's energy (n_channel,) that does not repeat, below 1."""
    n_period = moved.shape[1]
    scatter = (np.abs(moved) ** 2).sum(axis=(0, 1, 2, 4)) / (n_period - 1)
    # The mean over P holds 1 / P of the scatter's power too.
    repeating = np.maximum((np.abs(mean) ** 2).sum(axis=(0, 1, 3)) - scatter / n_period, 0.0)
    return np.asarray(np.minimum(scatter / np.maximum(scatter + repeating, np.finfo(float).tiny), 1 - 1e-6))


def _transient(residual: _Deviations, level: _Deviations) -> tuple[int, float]:
    """Periods at the beginning whose loss lowers the variance of the mean most, and to what share."""
    leading, used = _leading(level, _GAIN), level
    if not leading:  # a slow decay is a slope in its first period mostly
        leading, used = _leading(residual, _DRIFT_GAIN), residual
    return leading, _variance(used[:, leading:]) / max(_variance(residual), float(np.finfo(float).tiny))


def _leading(moved: _Deviations, gain: float) -> int:
    """Periods at the beginning of which each, left out, lowers the variance of the mean to less than a share of it."""
    # Two periods that are left say little of their own variance at a few lines.
    kept = 2 if moved.shape[2] >= _LEFT_LINES else 3
    tried = [_variance(moved[:, first:]) for first in range(max(moved.shape[1] - kept + 1, 1))]
    leading = 0
    while leading + 1 < len(tried) and tried[leading + 1] < gain * tried[leading]:
        leading += 1
    return leading


def _is_size(residual: _Deviations, outputs: ComplexArray, leading: int) -> bool:
    """Whether the first periods of an output differ as it times a factor, beyond noise: an input of another size.

    Outputs are looked at each by itself: a transient of one hides no change of another one's size.
    """
    # The first periods against the others; along the outputs' own shape it is a size, not a decay.
    apart = residual[:, :leading].mean(axis=1) - residual[:, leading:].mean(axis=1)
    power = (np.abs(outputs) ** 2).sum(axis=(0, 1, 3))
    along = np.abs((apart * outputs.conj()).sum(axis=(0, 1, 3))) ** 2 / np.maximum(power, np.finfo(float).tiny)
    change, noise = _change(residual, outputs)
    sized = along > _SIZED * (np.abs(apart) ** 2).sum(axis=(0, 1, 3))
    return bool((sized & (change > np.maximum(_SIGMAS * noise, _CHANGING))).any())


def _variance(moved: _Deviations) -> float:
    """Variance of the mean of some periods, summed over lines and channels."""
    count = moved.shape[1]
    total = float((np.abs(moved - moved.mean(axis=1, keepdims=True)) ** 2).sum())
    return float(total / (count * max(count - 1, 1)))


def _change(moved: _Deviations, mean: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Relative change of each channel's size (n_channel,) from period to period, and what noise makes of it."""
    moved = moved - moved.mean(axis=1, keepdims=True)
    n_period = moved.shape[1]
    power = np.maximum((np.abs(mean) ** 2).sum(axis=(0, 1, 3)), np.finfo(float).tiny)
    # Regression of each period's deviation on the mean spectrum: a size that changes is a real gain on all lines.
    gains = np.einsum("rpfce,rfce->pc", moved, mean.conj()) / power
    scatter = (np.abs(moved) ** 2).sum(axis=1) / max(n_period - 1, 1)
    noise = np.sqrt((scatter * np.abs(mean) ** 2).sum(axis=(0, 1, 3))) / power
    return np.sqrt((np.abs(gains) ** 2).sum(axis=0) / max(n_period - 1, 1)), noise


def _alike(residual: _Deviations, outputs: ComplexArray) -> float:
    """Relative change of the response that all lines share and no noise explains."""
    change, noise = _change(residual, outputs)
    return float(np.max(np.where(change > _SIGMAS * noise, change, 0.0)))


def _pattern(residual: _Deviations) -> float:
    """Relative size of the pattern over the lines that dominates how periods differ; 0 where none does."""
    n_period, rows = residual.shape[1], np.moveaxis(residual, 1, 0).reshape(residual.shape[1], -1)
    # Principal components of the periods by their small Gram matrix, n_period square.
    strength = np.linalg.eigvalsh(np.real(rows @ rows.conj().T))
    total = float(strength.sum())
    if n_period < _SHOWN or total <= 0:
        return 0.0
    # Upper edge of the eigenvalues of noise alone (Marchenko and Pastur), over their sum.
    chance = (1 + np.sqrt(n_period / rows.shape[1])) ** 2 / (n_period - 1)
    size = float(np.sqrt(strength[-1] / (n_period - 1) / residual.shape[3]))
    return size if strength[-1] / total > chance + _PATTERN else 0.0


def _unfollowed(moved_in: _Deviations, response: ComplexArray, residual: _Deviations, unit: FloatArray) -> float:
    """Share of the inputs' scatter that the outputs do not follow."""
    told = (np.abs(response @ moved_in / unit[:, None]) ** 2).sum(axis=(0, 1, 2, 4))
    left = (np.abs(residual) ** 2).sum(axis=(0, 1, 2, 4))
    return float(np.divide(np.minimum(left, told), told, out=np.zeros_like(told), where=told > 0).max())


def _without_slope(
    residual: _Deviations, factor: FloatArray | ComplexArray, unit: FloatArray, lines: IntArray, n_sample: int
) -> _Deviations:
    """Deviations of each period without what a slope makes of it: the drift that is removed spreads over periods."""
    ramp = rfft((np.arange(n_sample) + 0.5) / n_sample)[lines]
    shape = (ramp[:, None] * factor)[None, None, :, :, None] / unit[:, None]
    # Projection on the spectrum of a slope, as it passes the outputs' factor.
    part = (shape.conj() * residual).sum(axis=2, keepdims=True) / (np.abs(shape) ** 2).sum(axis=2, keepdims=True)
    return np.asarray(residual - part * shape)


def _shares(names: tuple[str, ...], share: FloatArray) -> str:
    if len(names) <= _SHOWN:
        return ", ".join(f"{name} {_percent(value)}" for name, value in zip(names, share.tolist(), strict=True))
    worst = int(np.argmin(share))
    return f"{_percent(float(share[worst]))} ({names[worst]}) to {_percent(float(share.max()))}"


def _percent(value: float) -> str:
    """Writes a share with as many nines as tell it from all."""
    if 0.99 <= value < 1:
        missing = 100 * (1 - value)
        return f"{100 - missing:.{max(1 - int(np.floor(np.log10(missing))), 0)}f} %"
    return f"{100 * value:.3g} %"
