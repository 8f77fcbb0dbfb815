"""Poles, zeros and static gains of transfer functions as an estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from robid.arrays import BoolArray, FloatArray
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.roots import Root, poles_of, zeros_of
from robid.models.external.fit.transfer import TransferMatrix
from robid.results.estimate import Estimate

_LEAST_DAMPING = 0.05


@dataclass(frozen=True)
class Parameters:
    """Parameters of a block.

    Attributes:
        names: Their names.
        kinds: Their kinds.
        units: Their units.
        value (n_param,): Their values.
        scale (n_param,): What relative deviations are related to.
        rows (n_param, n_root): A root of their covariance.
        reachable (n_param,): Whether each lies below half the sampling rate.
    """

    names: tuple[str, ...]
    kinds: tuple[str, ...]
    units: tuple[str, ...]
    value: FloatArray
    scale: FloatArray
    rows: FloatArray
    reachable: BoolArray


def block_parameters(
    name: str, channels: Sequence[str], units: Sequence[str], model: TransferMatrix, root: FloatArray
) -> Parameters:
    """Turns the coefficients of a block into poles, zeros and static gains.

    A real root is given as its rate, positive in the left half plane, a pair as natural frequency and damping ratio.

    Args:
        name: Name of the block, which names of its poles begin with.
        channels: Name of each of its channels, output by output.
        units: Unit of each channel's static gain.
        model: Its transfer functions.
        root (n_coefficient, n_root): Root of the coefficients' covariance: numerators, then the denominator without
            its first.
    """
    nyquist = np.pi / model.sampling_period_s
    rows = _rows_of_roots(name, "pole", poles_of(model, root), nyquist)
    for channel, unit, place in zip(channels, units, np.ndindex(model.numerator.shape[:2]), strict=True):
        gain, slope = _gain(model, root, place)
        rows.append(_Row(f"{channel}.gain", "gain", unit, gain, abs(gain), slope))
        rows += _rows_of_roots(channel, "zero", zeros_of(model, root, *place), nyquist)
    return Parameters(
        names=tuple(row.name for row in rows),
        kinds=tuple(row.kind for row in rows),
        units=tuple(row.unit for row in rows),
        value=np.array([row.value for row in rows]),
        scale=np.array([row.scale for row in rows]),
        rows=np.array([row.moves for row in rows]),
        reachable=np.array([row.reachable for row in rows], bool),
    )


@dataclass(frozen=True)
class _Row:
    name: str
    kind: str
    unit: str
    value: float
    scale: float
    moves: FloatArray
    reachable: bool = True


def _rows_of_roots(owner: str, kind: str, found: Sequence[Root], nyquist: float) -> list[_Row]:
    """Describes real roots by their rates, pairs by natural frequencies and damping ratios."""
    rows = []
    for number, each in enumerate(found, start=1):
        name, size, reachable = f"{owner}.{kind}{number}", abs(each.place), bool(abs(each.place) < nyquist)
        if each.place.imag == 0:
            rows.append(_Row(name, kind, "rad/s", -each.place.real, size, -each.moves.real, reachable))
            continue
        along, damping = (np.conj(each.place) * each.moves).real / size, -each.place.real / size
        turned = -(each.moves.real + damping * along) / size
        natural = max(abs(damping), _LEAST_DAMPING)
        rows.append(_Row(f"{name}.frequency", f"{kind}_frequency", "rad/s", size, size, along, reachable))
        rows.append(_Row(f"{name}.damping", f"{kind}_damping", "1", damping, natural, turned, reachable))
    return rows


def _gain(model: TransferMatrix, root: FloatArray, place: tuple[int, ...]) -> tuple[float, FloatArray]:
    """Static gain of a channel, and what each column of the covariance root (n_coefficient, n_root) moves it by."""
    n_power, level = model.numerator.shape[2], model.denominator[-1]
    last = int(np.ravel_multi_index(place, model.numerator.shape[:2])) * n_power + n_power - 1
    with np.errstate(divide="ignore", invalid="ignore"):
        gain = model.numerator[place][-1] / level
        return float(gain), np.asarray((root[last] - gain * root[-1]) / level)


def estimate_of(
    blocks: Sequence[Parameters], options: ExternalOptions, undetermined: Sequence[str], status: str, advice: str
) -> Estimate:
    """Puts the parameters of all blocks together; blocks are independent of each other.

    Args:
        blocks: Parameters of each block.
        options: Options of the fit.
        undetermined: What the data do not determine, a sentence each.
        status: How the fit ended.
        advice: What to try next.
    """
    value, scale = (np.concatenate([getattr(one, field) for one in blocks]) for field in ("value", "scale"))
    covariance = _diagonal([one.rows @ one.rows.T for one in blocks])
    std = np.sqrt(np.diag(covariance))
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.where(scale > 0, std / scale, np.inf)
    half = norm.ppf(0.5 + 0.5 * options.confidence)
    reachable = np.concatenate([one.reachable for one in blocks])
    return Estimate(
        names=tuple(name for one in blocks for name in one.names),
        kinds=tuple(kind for one in blocks for kind in one.kinds),
        units=tuple(unit for one in blocks for unit in one.units),
        nominal=np.full(value.size, np.nan),
        value=value,
        lower=value - half * std,
        upper=value + half * std,
        covariance=covariance,
        degrees_of_freedom=np.full(value.size, np.inf),
        confidence=options.confidence,
        interval_rule="the residual, as coloured as it is",
        relative_std=relative,
        predicted_relative_std=relative,
        prior_relative_std=np.full(value.size, np.inf),
        relative_half_width=half * relative,
        identifiable=(relative <= options.identifiable_relative_std) & reachable,
        identifiable_relative_std=options.identifiable_relative_std,
        undetermined=tuple(undetermined),
        status=status,
        advice=advice,
    )


def _diagonal(blocks: Sequence[FloatArray]) -> FloatArray:
    ends = np.cumsum([0, *(len(block) for block in blocks)])
    whole = np.zeros((ends[-1], ends[-1]))
    for first, block in zip(ends, blocks, strict=False):
        whole[first : first + len(block), first : first + len(block)] = block
    return whole
