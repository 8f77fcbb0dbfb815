"""What load, hysteresis and cubic stiffness do to the gears of a robot under the motion of a measurement."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.fft
from scipy.special import erf

from robid.arrays import ComplexArray, FloatArray, IntArray
from robid.errors import DataError
from robid.frf.frf import Frf
from robid.models.elastic.fit.nuisance.effects import LoadDamping, Nuisance, SlipTorque
from robid.robot.model import HYSTERESIS_SHARE
from robid.robot.spring_laws import BristleTable, GearEffects

_REACH = 2  # of the highest excited line: further up the robot hardly follows


@dataclass(frozen=True)
class Swinging:
    """A cubic spring in one configuration, swinging about its rest under an excitation."""

    rest: float  # Deflection at rest [rad]
    cubic: float  # Cubic coefficient [N m/rad^3]
    amplitude: ComplexArray  # (n_freq, n_block) Deflection at the excited lines, DFT sums over samples [rad]
    lines: IntArray  # (n_freq,) The excited lines
    compliance: ComplexArray  # (n_line,) Deflection by a torque pair on the spring at lines 0, 1, 2, ... [rad/(N m)].


def swing_shape(spring: Swinging, weight: FloatArray) -> float:
    """Finds `Rest.shape` of a spring, a mean over the lines with weights (n_freq,).

    At one line, the nonlinear torque of the swing regressed on the swing, over what a normal one gives. The torque at
    lines that are not excited moves the spring there too, by its compliance, and that motion mixes back into the
    excited lines: about a bent rest it lowers the slope by some `(3 k3 d0)^2 v` times the compliance.
    """
    # The cube of a signal reaches thrice its highest line: with as many samples nothing is folded back.
    count = scipy.fft.next_fast_len(6 * int(spring.lines.max()) + 1, real=True)
    spectrum = np.zeros((count // 2 + 1, spring.amplitude.shape[1]), complex)
    spectrum[spring.lines] = spring.amplitude
    signal = scipy.fft.irfft(spectrum, count, axis=0) * count
    # At the excited lines the swing is the measured one. At all others the spring moves under its own nonlinear torque,
    # which mixes back.
    free = np.zeros(len(spectrum), complex)
    free[: spring.compliance.size] = spring.compliance
    free[spring.lines] = free[0] = 0.0
    torque = scipy.fft.rfft(_bent(spring, signal), axis=0)
    moved = signal - spring.cubic * scipy.fft.irfft(free[:, None] * torque, count, axis=0)
    mixed = scipy.fft.rfft(_bent(spring, moved), axis=0)[spring.lines] / count
    known = spring.amplitude
    # At each line the torque's part that is linear in the swing, over what a normal swing gives: 3 k3 times its mean
    # square.
    slope = np.real(mixed * known.conj()).sum(axis=-1) / (np.abs(known) ** 2).sum(axis=-1)
    return float((weight * slope).sum() / weight.sum() / (3 * (signal**2).mean()))


def _bent(spring: Swinging, swing: FloatArray) -> FloatArray:
    """Torque over the cubic coefficient, but for the part that is linear in the swing."""
    return np.asarray(swing * swing * (3 * spring.rest + swing))


def spring_compliance(
    matrices: tuple[FloatArray, FloatArray, FloatArray], springs: IntArray, omega: FloatArray
) -> ComplexArray:
    """Deflection (n_line, n_spring) that a torque pair on a spring makes there [rad/(N m)].

    Args:
        matrices: Mass, damping and stiffness (n, n) of one configuration.
        springs (n_spring,): Coordinates of the springs.
        omega (n_line,): Angular frequencies [rad/s].
    """
    mass, damping, stiffness = matrices
    found = np.zeros((omega.size, springs.size), complex)
    line = omega[1:, None, None]
    right = np.broadcast_to(np.eye(len(mass))[:, springs], (omega.size - 1, len(mass), springs.size))
    solved = np.linalg.solve(stiffness - line**2 * mass + 1j * line * damping, right)
    found[1:] = solved[:, springs, np.arange(springs.size)]
    return found


def line_frequencies(frequency_hz: FloatArray, lines: IntArray) -> FloatArray:
    """Angular frequencies (n_line,) of all lines up to where a spring's own torque is followed [rad/s]."""
    step = frequency_hz[-1] / lines[-1]
    return np.asarray(2 * np.pi * step * np.arange(_REACH * int(lines.max()) + 1))


_SLIPS = np.geomspace(0.03, 30, 13)  # over the swing
_PER_CYCLE, _LEAST_SAMPLES = 10, 512  # samples of a cycle of the highest line, and at all
_MOST_BLOCKS = 8
_ROUNDS = 8
_LEAST_GAIN, _LEAST_CORNER = 1e-3, 1e-6
_FAR = 30.0  # deviations: nothing is left of a normal variable's tail


def gear_effects(
    estimated: Sequence[Nuisance],
    frf: Frf,
    stiffness: FloatArray,
    deflection: FloatArray,
    power: FloatArray,
    moved: ComplexArray | None,
    gears: IntArray,
) -> GearEffects | None:
    """Returns what estimated nuisances of gears do; None where none is estimated.

    Args:
        estimated: The nuisances that a fit estimates.
        frf: The response.
        stiffness (n_spring,): Stiffness of the springs.
        deflection (n_conf, n_spring): Their deflections at rest.
        power (n_conf, n_spring): Mean squares of their swing.
        moved (n_conf, n_freq, n_gear, n_block): Swing of the transmissions at the excited lines, DFT means over
            samples; None where nothing tells.
        gears (n_gear,): Indices of the transmissions.

    Raises:
        DataError: If a hysteresis is estimated and nothing tells how far the gears swing.
    """
    rows = list(enumerate(nuisance.effect for nuisance in estimated))
    damped = [(row, each.spring) for row, each in rows if isinstance(each, LoadDamping)]
    slips = [(row, each) for row, each in rows if isinstance(each, SlipTorque)]
    slipping = [(row, each.spring) for row, each in slips]
    if not damped and not slipping:
        return None
    bristles = tuple(_tabulated(each, frf, stiffness, moved, gears.tolist()) for _, each in slips)
    names = (tuple(estimated[row].name for row, _ in each) for each in (damped, slipping))
    of_dampers, of_bristles = (np.array(each, int).reshape(-1, 2) for each in (damped, slipping))
    return GearEffects(mean_size(deflection, power), of_dampers, of_bristles, bristles, *names)


def _tabulated(
    slip: SlipTorque, frf: Frf, stiffness: FloatArray, moved: ComplexArray | None, gears: Sequence[int]
) -> BristleTable:
    own, omega = HYSTERESIS_SHARE * float(stiffness[slip.spring]), 2 * np.pi * frf.frequency_hz
    table = bristle_table(own, _known(moved)[:, :, gears.index(slip.spring)], frf.lines, omega)
    return replace(table, known=slip.known)


def swings_known(frf: Frf) -> bool:
    """Whether a response tells how far the gears swing: its torques are known, and all motors are among its outputs."""
    return frf.input_amplitude is not None and all(name in frf.output_names for name in frf.input_names)


def _known(moved: ComplexArray | None) -> ComplexArray:
    if moved is None:
        message = "D132 hysteresis depends on how far the gears swing, and the response lacks its torques or its motors"
        remedy = (
            "estimate the response from its records, all motors among its outputs, or leave hysteresis out of `free`"
        )
        raise DataError(message, where="fit", remedy=remedy)
    return moved


def bristle_table(stiffness: float, moved: ComplexArray, lines: IntArray, omega: FloatArray) -> BristleTable:
    """Tabulates what bristles do to a gear that swings as it was measured.

    Bristles obey `dz/dt = dx/dt - |dx/dt| z / h`: from sample to sample of the swing they approach the deflection at
    which they slip as an exponential of the way. What follows the swing at each excited line is the linear part of
    that; a spring in series with a damper is fitted to it.

    Args:
        stiffness: Stiffness of the bristles [N m/rad, or N/m].
        moved (n_conf, n_freq, n_block): Swing at the excited lines, DFT means over samples [rad, or m].
        lines (n_freq,): The excited lines.
        omega (n_freq,): Their angular frequencies [rad/s].

    Source:
        Dahl (1968); Sanathanan and Koerner (1963) for the fit.
    """
    known = np.isfinite(moved).all(axis=(0, 1))
    swing = np.moveaxis(moved[..., known][..., :_MOST_BLOCKS], -1, 1)
    # A common divisor of all lines only repeats the period.
    lines = lines // np.gcd.reduce(lines)
    size = np.sqrt((2 * np.abs(swing) ** 2).sum(axis=-1).mean())
    count = scipy.fft.next_fast_len(max(_PER_CYCLE * int(lines.max()), _LEAST_SAMPLES), real=True)
    spectrum = np.zeros((*swing.shape[:2], count // 2 + 1), complex)
    spectrum[..., lines] = swing
    deflection = scipy.fft.irfft(spectrum, count) * count
    slip = size * _SLIPS
    followed = scipy.fft.rfft(_bristles(deflection, slip))[..., lines] / count
    total = (np.abs(swing) ** 2).sum(axis=1)
    # The best linear approximation over blocks: cross spectrum over power.
    share = (followed * swing.conj()).sum(axis=2) / total
    gain, corner = _series(share, total, omega)
    return BristleTable(stiffness, np.log(slip), np.log(gain), np.log(corner), float(size))


def _bristles(deflection: FloatArray, slip: FloatArray) -> FloatArray:
    """Deflections (n_slip, n_conf, n_block, n_sample) of bristles beside periodic ones (n_conf, n_block, n_sample)."""
    # Along a way of one direction, dz/dt = dx/dt - |dx/dt| z / h is solved exactly: z approaches the slip h, or -h, by
    # exp(-way / h).
    way = np.diff(deflection, append=deflection[..., :1])
    turns, fades = np.sign(way), np.exp(-np.abs(way) / slip[:, None, None, None])
    found = np.zeros_like(fades)
    # The first period is for the beginning to be forgotten, which those that stick never do.
    state = np.clip(deflection[..., 0], *(side * slip[:, None, None] for side in (-1, 1)))
    for sample in (*range(way.shape[-1]), *range(way.shape[-1])):
        found[..., sample] = state
        end = turns[..., sample] * slip[:, None, None]
        state = end + (state - end) * fades[..., sample]
    return found


def _series(share: ComplexArray, weight: FloatArray, omega: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Gain and corner (n_slip, n_conf) of `g jw / (jw + w_h)` nearest to shares (n_slip, n_conf, n_freq)."""
    # Times its denominator, s = g jw / (jw + w_h) is linear in g and w_h. Rows over the last denominator undo the
    # weight that this gives to high lines; a few rounds settle it.
    corner = np.full(share.shape[:2], omega.mean())
    gain = np.ones_like(corner)
    rate = np.broadcast_to(1j * omega, share.shape)
    for _ in range(_ROUNDS):
        root = np.sqrt(weight) / np.abs(rate + corner[..., None])
        matrix = np.stack([rate, -share], axis=-1) * root[..., None]
        target = share * rate * root
        normal = np.real(np.einsum("scfi,scfj->scij", matrix.conj(), matrix))
        right = np.real(np.einsum("scfi,scf->sci", matrix.conj(), target))
        gain, corner = np.moveaxis(np.linalg.solve(normal, right[..., None])[..., 0], -1, 0)
        gain, corner = np.clip(gain, _LEAST_GAIN, 1.0), np.maximum(corner, _LEAST_CORNER * omega[0])
    return gain, corner


def mean_size(mean: FloatArray, variance: FloatArray) -> FloatArray:
    """Mean size of normal variables of some mean and variance."""
    # E|x| = s sqrt(2 / pi) exp(-m^2 / (2 s^2)) + m erf(m / (s sqrt(2))); far from zero only the mean is left.
    deviation = np.sqrt(np.maximum(variance, np.finfo(float).tiny))
    ratio = np.abs(mean) / deviation
    swing = np.sqrt(2 / np.pi) * np.exp(-0.5 * np.minimum(ratio, _FAR) ** 2)
    return np.asarray(deviation * (swing + ratio * erf(ratio / np.sqrt(2))))
