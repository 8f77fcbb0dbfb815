"""Poles, zeros and static gains of transfer functions as an estimate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from robid.arrays import BoolArray, FloatArray
from robid.fit.estimate import Estimate
from robid.fit.external.options import ExternalOptions
from robid.fit.external.transfer import TransferMatrix

_REAL = 1e-9  # of a root's magnitude
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
    found = _Collected([], [], [], [], [], [])
    nyquist = np.pi / model.sampling_period_s
    n_pole, n_power = len(model.denominator) - 1, model.numerator.shape[2]
    below = slice(model.numerator.size, None)
    poles = np.concatenate([np.zeros((1, root.shape[1])), root[below]])
    _add_roots(found, f"{name}.pole", "pole", model.denominator, poles, nyquist)
    for place, (channel, unit) in enumerate(zip(channels, units, strict=True)):
        numerator = model.numerator.reshape(-1, n_power)[place]
        above = root[place * n_power : (place + 1) * n_power]
        gain = numerator[-1] / model.denominator[-1]
        slope = above[-1] / model.denominator[-1] - gain * root[below][n_pole - 1] / model.denominator[-1]
        found.add(f"{channel}.gain", "gain", unit, gain, abs(gain), slope, reachable=True)
        _add_roots(found, f"{channel}.zero", "zero", numerator, above, nyquist)
    return found.done()


def _add_roots(
    found: _Collected, name: str, kind: str, polynomial: FloatArray, rows: FloatArray, nyquist: float
) -> None:
    """Adds the roots of a polynomial (n_power,), of whose covariance `rows` (n_power, n_root) is a root."""
    roots = np.roots(polynomial)
    order = np.argsort(np.abs(roots))
    powers = np.arange(len(polynomial) - 1, -1, -1)
    count = 0
    for each in roots[order]:
        if each.imag < -_REAL * abs(each):
            continue
        count += 1
        with np.errstate(divide="ignore", invalid="ignore"):
            slope = -(each**powers @ rows) / np.polyval(np.polyder(polynomial), each)
        size, reachable = abs(each), bool(abs(each) < nyquist)
        if each.imag <= _REAL * size:
            found.add(f"{name}{count}", kind, "rad/s", -each.real, size, -slope.real, reachable=reachable)
            continue
        along = (each.conjugate() * slope).real / size
        damping = -each.real / size
        turned = -(slope.real + damping * along) / size
        found.add(f"{name}{count}.frequency", f"{kind}_frequency", "rad/s", size, size, along, reachable=reachable)
        natural = max(abs(damping), _LEAST_DAMPING)
        found.add(f"{name}{count}.damping", f"{kind}_damping", "1", damping, natural, turned, reachable=reachable)


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


@dataclass(frozen=True)
class _Collected:
    names: list[str]
    kinds: list[str]
    units: list[str]
    values: list[tuple[float, float]]
    rows: list[FloatArray]
    reachable: list[bool]

    def add(
        self, name: str, kind: str, unit: str, value: float, scale: float, row: FloatArray, *, reachable: bool
    ) -> None:
        self.names.append(name)
        self.kinds.append(kind)
        self.units.append(unit)
        self.values.append((float(value), float(scale)))
        self.rows.append(row)
        self.reachable.append(reachable)

    def done(self) -> Parameters:
        value, scale = np.array(self.values).T
        return Parameters(
            tuple(self.names),
            tuple(self.kinds),
            tuple(self.units),
            value,
            scale,
            np.array(self.rows),
            np.array(self.reachable, bool),
        )


def _diagonal(blocks: Sequence[FloatArray]) -> FloatArray:
    ends = np.cumsum([0, *(len(block) for block in blocks)])
    whole = np.zeros((ends[-1], ends[-1]))
    for first, block in zip(ends, blocks, strict=False):
        whole[first : first + len(block), first : first + len(block)] = block
    return whole
