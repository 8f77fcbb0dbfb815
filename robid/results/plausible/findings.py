"""Plausibility: what of data cannot be, each with its likely cause, signs at low lines among it."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import BoolArray, FloatArray, IntArray
from robid.frf.frf import Frf
from robid.frf.quality import FEW_SAMPLES, DrivingPoints, is_conjugate, undeclared_delay
from robid.results.finding import CAUSES, Finding, saturation_findings, two_digits
from robid.results.plausible.angles import judge_angles
from robid.results.plausible.evidence import CLEAR, Evidence, Fitted, gather_evidence
from robid.results.plausible.gravity import gravity_signs, judge_gravity, judge_places, weigh
from robid.results.plausible.scales import judge_scales
from robid.robot.description import Robot
from robid.robot.linearize import LinearModel, linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response

_SOFTER = 1.6
"""Lines count as low up to this share below where the nominal arm stops to be rigid: springs may be softer."""

_RIGID = 0.5
_REVERSED = 0.3
_SHARE = 0.75
_LEAST_LINES = 2
_LEAST_COUPLING = 0.1
_MOVES = 1.0
_ABOVE = 2.0
_MOST_CONFIGURATIONS = 30
_OTHER_WEIGHT = 3.0
_COUPLING_WEIGHT = 0.5
_TORQUE_COST = 0.2
_ANGLE_COST = 0.25
_MARGIN = 0.5
_MANY_MOTORS = 10


@dataclass(frozen=True)
class Signs:
    """Which torques and angles count the wrong way."""

    findings: tuple[Finding, ...]  # Strongest first
    torque: FloatArray  # (n_motor,) 1, or -1 where a torque is reversed
    angle: FloatArray  # (n_motor,) The same of the angles


def judge_signs(robot: Robot, evidence: Evidence, angle_sign: FloatArray, torque_sign: FloatArray) -> Signs:
    """Finds reversed torques and angles.

    Below its first antiresonance a motor moves as a part of a rigid arm: each element of the response is that of the
    inverse inertia matrix, friction aside. A reversed torque turns a column of it around, a reversed angle a row.
    What explains the signs of all elements with the fewest changes is taken; mean angles and gravity are heard.

    Args:
        robot: The robot file's.
        evidence: What the campaign shows.
        angle_sign (n_motor,): Signs that the mean angles show, 0 where they show none.
        torque_sign (n_motor,): Signs that the mean torques show, 0 where they show none.
    """
    seen = _agreement(robot, evidence)
    weight = np.full(seen.shape, _COUPLING_WEIGHT)
    np.fill_diagonal(weight, 1.0)
    angle, torque = _signs(weight * seen, _OTHER_WEIGHT * angle_sign, _OTHER_WEIGHT * torque_sign)
    # A torque and an angle differ in the couplings to other motors, and in what their means say.
    others = np.abs(seen) * ~np.eye(len(seen), dtype=bool)
    distinguished = (others.sum(axis=0) + others.sum(axis=1) > 0) | (angle_sign != 0) | (torque_sign != 0)
    findings = [
        _finding("torque_sign", evidence, index, seen, torque_sign, alone=not distinguished[index])
        for index in np.flatnonzero(torque < 0).tolist()
    ]
    findings += [
        _finding("angle_sign", evidence, index, seen, angle_sign) for index in np.flatnonzero(angle < 0).tolist()
    ]
    return Signs(tuple(sorted(findings, key=lambda finding: -finding.strength)), torque, angle)


def _agreement(robot: Robot, evidence: Evidence) -> FloatArray:
    """How each element (n_motor, n_motor) points compared to a rigid arm's, from -1 to 1; 0 where it is not clear."""
    n_conf = len(evidence.configurations)
    chosen = np.unique(np.linspace(0, n_conf - 1, min(n_conf, _MOST_CONFIGURATIONS)).round().astype(int))
    model = build_model(robot, balanced=True)
    linear = linearize(model, solve_statics(model, evidence.configurations[chosen]))
    inverse = np.linalg.inv(_rigid_inertia(linear))
    joints = evidence.joints(robot)
    pick = np.ix_(np.arange(len(chosen)), joints, joints)
    rigid, strong = inverse[pick], _strong(inverse)[pick]
    parameters = nominal_parameters(robot, linear, 0.0)
    softer = response(linear, parameters, _SOFTER * evidence.frequency_hz, None).sampled
    nominal = softer[:, :, joints][..., joints]
    # Axes at right angles that slide do not move each other at all; infinity is no low line and tells no sign.
    rigid = np.where(rigid == 0, np.inf, rigid)
    is_low = np.abs(nominal / rigid[:, None] - 1) < _RIGID
    own = np.diagonal(is_low, axis1=-2, axis2=-1)
    is_low &= own[..., :, None] & own[..., None, :]
    usable = np.logical_and.accumulate(is_low, axis=1) & evidence.clear[chosen] & strong[:, None]
    usable &= _free(robot, evidence, np.diagonal(rigid, axis1=-2, axis2=-1), chosen)[..., None]
    ratio = evidence.response[chosen] / rigid[:, None]
    seen = np.zeros(rigid.shape[1:])
    for row, column in itertools.product(range(len(seen)), repeat=2):
        values = ratio[:, :, row, column][usable[:, :, row, column]]
        if values.size >= _LEAST_LINES:
            seen[row, column] = _direction(values.real, values.imag)
    return seen


def _direction(real: FloatArray, imaginary: FloatArray) -> float:
    """Median direction, 0 where the lines do not agree on it.

    Friction delays, which turns a sound response towards a positive imaginary part and a reversed one towards a
    negative one; a motor that sticks, as on a spring, has a negative real part with a positive imaginary one.
    """
    middle = float(np.median(real))
    agree = float((np.sign(real) == np.sign(middle)).mean())
    sticks = middle < 0 and float(np.median(imaginary)) > -0.2 * middle
    if abs(middle) < _REVERSED or agree < _SHARE or sticks:
        return 0.0
    return float(np.clip(middle, -1, 1))


def _rigid_inertia(linear: LinearModel) -> FloatArray:
    """Inertia matrix (n_conf, n_joint, n_joint) that the motors feel with all springs locked [kg m^2]."""
    motors = slice(0, linear.n_motor)
    own = np.einsum("l,clij->cij", linear.axial, linear.link_inertia[:, :, motors, motors])
    return np.asarray(linear.mass[:, motors, motors] + own + np.diag(linear.rotor))


def _strong(inverse: FloatArray) -> BoolArray:
    """Elements (n_conf, n, n) that are no small differences of large terms."""
    own = np.sqrt(np.diagonal(inverse, axis1=-2, axis2=-1))
    return np.asarray(np.abs(inverse) > _LEAST_COUPLING * own[:, :, None] * own[:, None, :])


def _free(robot: Robot, evidence: Evidence, mobility: FloatArray, chosen: IntArray) -> BoolArray:
    """Where motors (n_conf, n_low, n_motor) do not sit on the spring of friction's presliding.

    They swing beyond it, or faster than they would on that spring: above its resonance the sign is that of an inertia.
    """
    laws = [robot.joints[index].motor.friction for index in evidence.joints(robot)]
    level = np.array([max(law.coulomb_nm, law.static_nm) for law in laws])
    width = np.array([law.presliding_rad for law in laws])
    fast = 2 * np.pi * evidence.frequency_hz[:, None] > _ABOVE * np.sqrt(level / width * mobility)[:, None]
    if evidence.motion_rms is None:
        return np.asarray(fast)
    return np.asarray(fast | (evidence.motion_rms[chosen] > _MOVES * width)[:, None] | (level == 0))


def _signs(seen: FloatArray, angle: FloatArray, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Signs of angles and torques that agree best, at a cost for each change; all 1 where little would be gained."""
    n_motor = len(seen)
    most = n_motor if n_motor <= _MANY_MOTORS else 2
    best, signs = -np.inf, (np.ones(n_motor), np.ones(n_motor))
    for count in range(most + 1):
        for turned in itertools.combinations(range(n_motor), count):
            rows = np.ones(n_motor)
            rows[list(turned)] = -1.0
            columns = rows @ seen + torque
            columns_sign = np.where(columns < -_TORQUE_COST / 2, -1.0, 1.0)
            cost = _ANGLE_COST * count + _TORQUE_COST * float((columns_sign < 0).sum())
            value = float(columns @ columns_sign + angle @ rows) - cost
            if value > best + 1e-9:
                best, signs = value, (rows, columns_sign)
    return signs if best > float(seen.sum() + torque.sum() + angle.sum()) + _MARGIN else (np.ones(n_motor),) * 2


def _finding(
    cause: str, evidence: Evidence, index: int, seen: FloatArray, other: FloatArray, *, alone: bool = False
) -> Finding:
    """Says what shows a wrong sign; `alone` where neither couplings nor means distinguish torque and angle."""
    name, own = evidence.names[index], seen[index, index]
    if own < 0:
        told = f"{name}: at low lines its angle turns against its torque ({own:.2g} of a rigid arm's response)"
        told += f", and nothing in these data distinguishes that from {CAUSES['angle_sign']}" if alone else ""
    elif other[index] < 0 and cause == "torque_sign":
        told = f"{name}: its mean torque pulls against gravity's load in the wrong direction"
    elif other[index] < 0:
        told = f"{name}: its mean angles go against the configurations"
    else:
        told = f"{name}: at low lines its couplings to other motors point the wrong way"
    return Finding(cause, told, decisive=True, strength=max(abs(own) / _REVERSED, 1.0))


_LOST = 2.0
_MADE_ENERGY = 5.0  # How far beyond what is normal a conjugate is
_HALF_TURN = 0.5


def data_findings(robot: Robot, frf: Frf, delay_s: float = 0.0, fitted: Fitted | None = None) -> tuple[Finding, ...]:
    """Returns what of a campaign's data contradicts the robot file, before any fit: a wrong scale, then the strongest.

    Args:
        robot: The robot file's, with the campaign's payload.
        frf: The campaign's response.
        delay_s: Nominal delay from recorded to applied torque, hold excluded [s].
        fitted: What a fit found of it that mean torques are held against instead.
    """
    return evidence_findings(robot, gather_evidence(frf), delay_s, fitted)[0]


def evidence_findings(
    robot: Robot, evidence: Evidence, delay_s: float = 0.0, fitted: Fitted | None = None
) -> tuple[tuple[Finding, ...], tuple[str, ...]]:
    """Returns findings about a campaign's data and notes on what its data cannot tell.

    A wrong scale spoils all the rest: it comes first, and the rest is judged as if it were right.
    """
    if not evidence.belongs_to(robot):
        return (), ()
    scales = judge_scales(robot, evidence, delay_s)
    evidence, turned_phase = _with_phase_turned(scales.evidence, delay_s)
    evidence, late = _without_delay(evidence, delay_s)
    angles = judge_angles(robot, evidence)
    weights = weigh(robot, evidence, angles.ratio_fits, fitted) if angles.placed else None
    none: FloatArray = np.zeros(len(evidence.names))
    signs = judge_signs(robot, evidence, angles.sign, none)
    loads: tuple[Finding, ...] = ()
    carrying = robot if fitted is None else fitted.found.robot
    if weights is not None:
        # Swapped files can turn gravity around, so they are looked for before gravity may speak of signs.
        swapped = None if signs.findings or angles.sign.any() else judge_places(weights)
        if swapped is None:
            signs = judge_signs(robot, evidence, angles.sign, gravity_signs(weights))
        loads = judge_gravity(carrying, evidence, weights, signs.torque) if swapped is None else (swapped,)
    findings = (
        *turned_phase,
        *late,
        *angles.findings,
        *_not_said(signs.findings, angles.findings),
        *loads,
        *_noise_findings(evidence),
        *saturation_findings(evidence.saturated),
    )
    rest = sorted(findings, key=lambda finding: (not finding.decisive, -finding.strength))
    return (*scales.findings, *rest), angles.notes


def _not_said(findings: Sequence[Finding], before: Sequence[Finding]) -> list[Finding]:
    """Findings but those of a joint's angle sign that others have said already."""
    said = {one.message.partition(":")[0] for one in before if one.cause == "angle_sign"}
    return [one for one in findings if one.cause != "angle_sign" or one.message.partition(":")[0] not in said]


def _driving_points(evidence: Evidence) -> DrivingPoints:
    return DrivingPoints(
        evidence.lines_hz,
        evidence.driving,
        evidence.signal_to_noise,
        evidence.sampling_period_s,
        evidence.hold_period_s,
    )


def _with_phase_turned(evidence: Evidence, declared_s: float) -> tuple[Evidence, list[Finding]]:
    """Turns the phase around of a response that was measured elsewhere and is its own conjugate, and findings it."""
    if evidence.has_record or not is_conjugate(_driving_points(evidence), declared_s):
        return evidence, []
    told = (
        "the motors' own responses make energy at any delay, and none where the phase's sign is turned around: the file"
        " has the conjugate of the response, so negate its phase, or its imaginary part"
    )
    sound = replace(evidence, response=evidence.response.conj(), driving=evidence.driving.conj())
    return sound, [Finding("units", told, decisive=True, strength=_MADE_ENERGY)]


def _without_delay(evidence: Evidence, declared_s: float) -> tuple[Evidence, list[Finding]]:
    """Takes a delay that is not declared out of the responses, whose signs it would turn, and findings it."""
    found = undeclared_delay(_driving_points(evidence), declared_s)
    if found is None:
        return evidence, []
    samples, declared = found / evidence.sampling_period_s, declared_s / evidence.sampling_period_s
    told = (
        f"the phases of the motors' own responses leave no room for a delay below {two_digits(samples)} samples, "
        f"where {two_digits(declared)} are declared"
    )
    decisive = found * float(evidence.lines_hz.max()) > _HALF_TURN
    ahead = np.exp(2j * np.pi * evidence.frequency_hz * (found - declared_s))[:, None, None]
    return (
        replace(evidence, response=evidence.response * ahead),
        [Finding("delay", told, decisive=decisive, strength=(samples - declared) / FEW_SAMPLES)],
    )


def _noise_findings(evidence: Evidence) -> list[Finding]:
    """Motors most of whose lines lie below 10 dB; decisive where they are hardly more than noise."""
    if evidence.signal_to_noise is None:
        return []
    findings = []
    middle = np.median(evidence.signal_to_noise, axis=(0, 1))
    for name, ratio in zip(evidence.names, middle.tolist(), strict=True):
        if ratio < CLEAR:
            level = 10 * np.log10(max(ratio, 1e-3))
            told = f"{name}: half of its lines have a signal-to-noise ratio below {level:.2g} dB"
            findings.append(Finding("excitation", told, decisive=ratio < _LOST, strength=CLEAR / max(ratio, 1e-3)))
    return findings
