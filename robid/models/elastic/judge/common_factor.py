"""A factor that all fitted parameters share: torques or motions of a wrong scale, too small to stand out before a fit.

Responses are motion over torque: torques that are read too large by a factor raise all inertias, springs and dampers by
it, motions that are read too large lower them. A robot file is rough in each of its values; that all of them are off
by one factor of the known ones, and by little else, is not its doing.
"""

from __future__ import annotations

import numpy as np

from robid.arrays import FloatArray
from robid.frf.frf import Frf
from robid.results.doubt import Doubt
from robid.results.estimate import Estimate
from robid.results.plausible.evidence import Evidence, gather_evidence
from robid.results.plausible.hypotheses import Hypothesis, Named, hypotheses_of
from robid.results.plausible.scales import named_doubt
from robid.robot.description import Robot

_KINDS = ("motor_inertia", "link_inertia", "stiffness", "damping")
_LEAST = 4
_KNOWN = 0.2
_FLOOR, _SCATTER = 0.05, 0.25
_LEAST_GAIN = 6.0
_ALIKE = 2.0


def common_factor_doubts(robot: Robot, frf: Frf, estimate: Estimate) -> tuple[Doubt, ...]:
    """Returns the wrong scale by which all estimates are off from the robot file, if there is one.

    With `x` the logarithms of estimates over the file's values, their scatter about the factor's is held against that
    about zero: a ratio of likelihoods of normal variates of unknown variance, `n log(s_0/s_F)`.

    Args:
        robot: The robot file that the fit started from.
        frf: The response that it was fitted to.
        estimate: What the fit found.
    """
    ratios, evidence = _log_ratios(estimate), gather_evidence(frf)
    if ratios is None or not evidence.belongs_to(robot) or evidence.torque_unit != "N m":
        return ()
    n_motor = len(evidence.names)
    none, found = float(np.sqrt(np.mean(ratios**2))), []
    for each in _hypotheses(robot, evidence):
        scatter = float(np.sqrt(np.mean((ratios - _effect(each, n_motor)) ** 2)))
        gain = len(ratios) * float(np.log(none / max(scatter, _FLOOR))) - 0.5 * each.penalty
        if scatter < _SCATTER and gain > _LEAST_GAIN:
            found.append((gain, each))
    if not found:
        return ()
    found.sort(key=lambda one: -one[0])
    best, first = found[0]
    alike = {each.scales: each for gain, each in reversed(found) if best - gain < _ALIKE}
    # The first one's factor as the parameters show it.
    sign = float(np.sign(_effect(first, n_motor) * first.log[np.argmax(np.abs(first.log))]))
    middle, std = sign * float(ratios.mean()), float(ratios.std(ddof=1)) / np.sqrt(len(ratios))
    low, size, high = (float(np.exp(middle + side * 1.96 * std)) for side in (-1, 0, 1))
    named = Named(tuple(reversed(alike.values())), (size, low, high), best / _LEAST_GAIN)
    return (named_doubt(named, "the robot file's inertias, springs and dampers say, all by one factor"),)


def _log_ratios(estimate: Estimate) -> FloatArray | None:
    """Logarithms of what is known well over the robot file's; None where too little is, or no rotor among it."""
    kinds, value, nominal = np.array(estimate.kinds), estimate.value, estimate.nominal
    usable = np.isin(kinds, _KINDS) & (nominal > 0) & (value > 0) & (estimate.relative_half_width < _KNOWN)
    rotors = kinds[usable] == "motor_inertia"
    if usable.sum() < _LEAST or not rotors.any() or rotors.all():
        return None
    return np.asarray(np.log(value[usable] / nominal[usable]))


def _hypotheses(robot: Robot, evidence: Evidence) -> list[Hypothesis]:
    """Mistakes of all torques alike, or of all motions, which parameters show by one factor."""
    joints = evidence.joints(robot)
    constants = [robot.joints[index].motor.torque_constant_nm_a for index in joints]
    stated = np.array([np.nan if one is None else one for one in constants])
    listed = hypotheses_of(evidence.names, evidence.moved, robot.gear_ratio[joints], stated)
    return [each for each in listed if _is_common(each, len(joints))]


def _is_common(hypothesis: Hypothesis, n_motor: int) -> bool:
    torque, motion = hypothesis.log[:n_motor], hypothesis.log[n_motor:-1]
    is_one = np.ptp(torque) < _FLOOR and np.ptp(motion) < _FLOOR
    return bool(is_one and hypothesis.log[-1] == 0 and abs(_effect(hypothesis, n_motor)) > 0)


def _effect(hypothesis: Hypothesis, n_motor: int) -> float:
    """Logarithm of what parameters come out by: torques raise them, motions lower them."""
    return float(hypothesis.log[:n_motor].mean() - hypothesis.log[n_motor:-1].mean())
