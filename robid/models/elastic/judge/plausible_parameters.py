"""Fitted parameters that no robot can have, and what a fit estimated of what a robot carries."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from robid.arrays import FloatArray, IntArray
from robid.models.elastic.fit.nuisance.effects import moved_robot, torque_slopes
from robid.models.elastic.fit.nuisance.listing import estimable_nuisances
from robid.results.estimate import Estimate
from robid.results.finding import Finding
from robid.results.plausible.evidence import Carrier, Fitted
from robid.robot.description import Robot
from robid.robot.inertia import combine
from robid.robot.parameters import NUISANCE_KIND

_FEW_SAMPLES = 3.0
_OF_DIFFERENCE, _NEAR_IT = -0.5, 0.15  # samples: a difference of positions is half a sample late
_TIMING_SAMPLES = 0.1
_HALF_TURN = 0.5
_MODEL_ERROR = 0.02
"""Share of a motor's torque for its inertia that an equivalent viscous term may take without meaning friction."""

_SURPRISING = 3.0  # standard deviations of what was known beforehand
_KNOWN_TENSOR = 1.5
_LEAST_SIZE_M = 0.3


@dataclass(frozen=True)
class _Found:
    """One estimate with its interval and the robot file's value."""

    estimate: float
    lower: float
    upper: float
    stated: float

    @property
    def decades(self) -> float:
        """How many factors of ten it lies away from the robot file's value."""
        return float(np.abs(np.log10(max(self.estimate, 1e-300) / self.stated))) if self.stated > 0 else 0.0

    @property
    def times(self) -> str:
        """The estimate over the robot file's value, in words."""
        return f"{self.estimate / self.stated:.3g} times the robot file's value"


def parameter_findings(
    robot: Robot,
    estimate: Estimate,
    band_hz: tuple[float, float],
    sampling_period_s: float,
    prior_decades: float = 1.0,
    *,
    differenced: bool = False,
) -> tuple[Finding, ...]:
    """Returns fitted parameters that cannot be, strongest first.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        estimate: What the fit found.
        band_hz: Lowest and highest frequency of the fit [Hz].
        sampling_period_s: Sampling period of the campaign [s].
        prior_decades: How far the fit was told to look for springs and inertias.
        differenced: Whether speeds among the outputs are said to be differences of positions.
    """
    found, (lowest, highest) = _by_name(estimate), band_hz
    findings = [
        *_friction(robot, found, 2 * np.pi * lowest),
        *_surprises(estimate),
        *_delay(found, sampling_period_s, highest, differenced=differenced),
        *_rotors(robot, found, prior_decades),
        *_links(robot, found, prior_decades),
        *_springs(robot, found, prior_decades),
    ]
    return tuple(sorted(findings, key=lambda finding: (not finding.decisive, -finding.strength)))


def _by_name(estimate: Estimate) -> dict[str, _Found]:
    tied = estimate.tied
    groups = (
        (estimate.names, estimate.value, estimate.lower, estimate.upper, estimate.nominal),
        (tied.names, tied.value, tied.lower, tied.upper, tied.nominal),
    )
    return {
        name: _Found(*values)
        for names, *columns in groups
        for name, *values in zip(names, *(column.tolist() for column in columns), strict=True)
    }


def _friction(robot: Robot, found: dict[str, _Found], omega: float) -> Iterator[Finding]:
    """Negative levels, shapes and dampings; the relative error of a coefficient is what a fit finds."""
    words = {"level": "Coulomb friction", "shape": "friction's speeds and deflections", "torque_scale": "torque"}
    for joint, rigid in zip(robot.joints, robot.rigid.tolist(), strict=True):
        for kind, word in words.items():
            one = found.get(f"{joint.name}.{kind}")
            if one is not None and one.upper < -1:
                told = (
                    f"{joint.name}: its {word} comes out negative ({1 + one.estimate:.2g} times what was compensated)"
                )
                cause = "torque_sign" if kind == "torque_scale" else "friction"
                yield Finding(cause, told, decisive=kind != "shape", strength=-one.upper)
        one = found.get(f"{joint.name}.viscous")
        usual = max(_MODEL_ERROR * joint.motor.inertia_kgm2 * omega, 1e-12)
        if one is not None and one.upper < -usual:
            told = f"{joint.name}: its viscous friction comes out negative ({one.estimate:.2g} N m s/rad)"
            if not rigid and f"{joint.name}.arm_viscous" not in found:
                told += ", as it does where its arm rubs too: try `arm_viscous` in `free`"
            yield Finding("friction", told, decisive=False, strength=-one.upper / usual)
    for spring in robot.springs:
        one = found.get(f"{spring.name}.damping")
        if one is not None and one.upper < 0:
            told = f"{spring.name}: its damping comes out negative ({one.estimate:.2g} N m s/rad)"
            yield Finding("model", told, decisive=True, strength=2.0)


def _surprises(estimate: Estimate) -> Iterator[Finding]:
    """Compensated torques that came out far from what was known of them: the law is of another kind or size."""
    known = estimate.prior_relative_std
    for index, (name, kind) in enumerate(zip(estimate.names, estimate.kinds, strict=True)):
        if kind != "friction" or not 0 < known[index] < np.inf:
            continue
        times = abs(float(estimate.value[index] - estimate.nominal[index])) / float(known[index])
        if times > _SURPRISING:
            cause = "torque_constant" if name.endswith(".torque_scale") else "friction"
            told = f"{name} comes out {times:.2g} standard deviations from what was known of it"
            yield Finding(cause, told, decisive=False, strength=times / _SURPRISING)


def _delay(
    found: dict[str, _Found], sampling_period_s: float, highest_hz: float, *, differenced: bool
) -> Iterator[Finding]:
    """A delay that was not declared, or that lets a motor move before its torque.

    Beyond half a turn of phase at the highest line, measured and modelled phases are compared modulo a whole turn.
    """
    one = found.get("delay")
    if one is None:
        return
    samples = one.estimate / sampling_period_s
    late = (one.lower - max(one.stated, 0.0)) / sampling_period_s
    early = -one.upper / sampling_period_s
    if late > _FEW_SAMPLES:
        told = f"the delay comes out at {samples:.3g} samples where {one.stated / sampling_period_s:.3g} are declared"
        decisive = one.lower * highest_hz > _HALF_TURN
        yield Finding("delay", told, decisive=decisive, strength=late / _FEW_SAMPLES)
    elif early > _TIMING_SAMPLES:
        told = f"the delay comes out negative ({samples:.2g} samples)"
        if differenced and abs(samples - _OF_DIFFERENCE) < _NEAR_IT:
            told += ", as where speeds that are said to be differences are not: try `sampled: instants` for them"
            yield Finding("samples", told, decisive=False, strength=early / _TIMING_SAMPLES)
            return
        yield Finding("delay", told, decisive=early > 1, strength=early / _TIMING_SAMPLES)


def _rotors(robot: Robot, found: dict[str, _Found], prior_decades: float) -> Iterator[Finding]:
    """Rotor inertias whose whole interval contradicts what the robot file knows of them."""
    for joint in robot.joints:
        one = found.get(f"{joint.name}.motor_inertia")
        if one is None or one.stated <= 0:
            continue
        outside = max(one.lower / one.stated, one.stated / max(one.upper, 1e-300), 1.0)
        off = float(np.log(outside)) / (_SURPRISING * joint.motor.inertia_relative_std)
        gone = one.decades / prior_decades
        if off > 1 or gone > 1:
            told = f"{joint.name}: its rotor inertia comes out at {one.times}"
            yield Finding("rotor_inertia", told, decisive=gone > 1, strength=max(off, gone))


def _links(robot: Robot, found: dict[str, _Found], prior_decades: float) -> Iterator[Finding]:
    """Inertias about the joint axis that no body of the link's mass, size and other inertias has."""
    hangs = any(spring.place == "payload" for spring in robot.springs)
    for index, joint in enumerate(robot.joints):
        one = found.get(f"{joint.name}.link_inertia")
        if one is None or one.stated <= 0:
            continue
        is_last = index == len(robot.joints) - 1
        body = combine(joint.link, robot.payload) if is_last and not hangs and robot.payload.mass_kg > 0 else joint.link
        first, second, own = np.diag(body.inertia_kgm2).tolist()
        reach = 0.0 if is_last else float(np.linalg.norm(robot.joints[index + 1].position_m))
        size = max(reach, 2 * float(np.linalg.norm(body.com_m)), _LEAST_SIZE_M)
        # Split links count their inner part alone, so the difference is put on the whole.
        lower, upper = own + one.lower - one.stated, own + one.upper - one.stated
        most = max(min(_KNOWN_TENSOR * (first + second), body.mass_kg * size**2), own)
        least = min(abs(first - second) / _KNOWN_TENSOR, own) / 2
        off = lower / most if most > 0 else 0.0
        gone = one.decades / prior_decades
        if off > 1 or upper < least or gone > 1:
            told = f"{joint.name}: its link's inertia comes out at {one.times}"
            if off > 1 or upper < least:
                told += f", which no body of {body.mass_kg:.3g} kg and its other inertias has"
            strength = max(off, gone, least / max(upper, least / 1e3) if least > 0 else 0.0)
            yield Finding("masses", told, decisive=gone > 1, strength=strength)


def _springs(robot: Robot, found: dict[str, _Found], prior_decades: float) -> Iterator[Finding]:
    for spring in robot.springs:
        one = found.get(f"{spring.name}.stiffness")
        if one is None or one.decades <= prior_decades:
            continue
        told = f"{spring.name}: its stiffness comes out at {one.times}"
        yield Finding("model", told, decisive=one.decades > 2 * prior_decades, strength=one.decades / prior_decades)


_SHARE = 0.01


def fitted_carrier(robot: Robot, estimate: Estimate) -> Fitted | None:
    """Returns a robot with the masses, torque constants and counterbalances that a fit estimated.

    Args:
        robot: The robot file that the fit started from, with its campaign's payload.
        estimate: What the fit found.

    Returns:
        The robot, and how far it may be off: as far as the intervals reach, correlated as the estimates are; None
        where the fit estimated nothing of the kind.
    """
    nuisances = [nuisance for nuisance in estimable_nuisances(robot) if nuisance.name in estimate.names] * (
        NUISANCE_KIND in estimate.kinds
    )
    if not nuisances:
        return None
    rows = np.array([estimate.names.index(nuisance.name) for nuisance in nuisances])
    amounts = estimate.value[rows] - np.array([estimate.stated[nuisance.name] for nuisance in nuisances])
    slopes = torque_slopes(nuisances, len(robot.joints))

    def carrier(off: FloatArray) -> Carrier:
        return Carrier(moved_robot(robot, nuisances, off), np.exp(-off @ slopes))

    directions = _deviations(estimate, rows).T
    return Fitted(carrier(amounts), tuple(carrier(amounts + _SHARE * each) for each in directions), _SHARE)


def _deviations(estimate: Estimate, rows: IntArray) -> FloatArray:
    """Independent directions (n, n_direction) of one standard deviation each in which estimates may be off."""
    value = estimate.value[rows]
    ends = np.maximum(np.abs(estimate.lower[rows] - value), np.abs(estimate.upper[rows] - value))
    covariance = estimate.covariance[np.ix_(rows, rows)]
    own = np.sqrt(covariance.diagonal())
    related = np.eye(len(rows)) if (own <= 0).any() else covariance / np.outer(own, own)
    size, turned = np.linalg.eigh(related)
    spread = turned * np.sqrt(np.maximum(size, 0.0))
    return np.asarray(ends[:, None] / norm.ppf(0.5 + 0.5 * estimate.confidence) * spread)
