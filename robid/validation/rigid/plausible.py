"""Rigid parameters that cannot be, and motions that tell too little, each with its likely cause."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robid.fit.estimate import Estimate
from robid.fit.rigid.solution import RigidSolution
from robid.validation.doubt import Doubt, two_digits

_FRICTION = ("viscous", "coulomb", "load_friction", "coupling_viscous", "coupling_coulomb")
_INERTIAL = ("inertia", "first_moment", "mass", "motor_inertia", "coupling_inertia")
_FAR = 5.0  # times the robot file's
_FEWEST = 3
_MOVED = 3.0  # deviations
_POOR_CONDITION = 200.0
_SIGNIFICANT = 3.0
_BIASED = 0.1


def parameter_doubts(solution: RigidSolution) -> tuple[Doubt, ...]:
    """Returns what of a rigid fit cannot be or is hardly known, decisive doubts first."""
    found = [
        *_estimators(solution),
        *_sizes(solution.estimate),
        *_negative(solution.estimate),
        *_excitation(solution),
        *_bodies(solution),
    ]
    return tuple(sorted(found, key=lambda doubt: (not doubt.decisive, -doubt.strength)))


def _estimators(solution: RigidSolution) -> Iterator[Doubt]:
    """What the verdict on least squares says of the result, which may be another estimator's."""
    checks, told = solution.checks, solution.checks.sentence.rstrip(".")
    told = told[0].lower() + told[1:]
    if checks.instruments_differ and solution.chosen != "instruments":
        yield Doubt("filters", told, decisive=True, strength=2.0)
    elif checks.huber_differs and checks.instrument_variation is None:
        yield Doubt("filters", told, decisive=_varies(solution), strength=2.0)
    elif checks.huber_differs and not checks.instruments_differ:
        # The instruments agree: what moves Huber's estimate is no noise of the positions.
        told = f"{solution.estimate.names[int(np.argmax(checks.huber_variation))]} depends on large residuals"
        yield Doubt("model", told, decisive=False, strength=1.5)
    if checks.coloured:
        worst = int(np.argmax(np.abs(checks.correlation).max(axis=1)))
        size = float(np.abs(checks.correlation[worst]).max())
        told = f"the residuals of motor {worst + 1} are correlated in time by {size:.2g} beyond their filter"
        yield Doubt("friction", told, decisive=False, strength=1 + size)
    if checks.odd and not checks.huber_differs:
        share = float(np.max(checks.outlier_share))
        told = f"the residuals are not Gaussian: up to {share:.2g} of a motor's lie beyond three deviations"
        yield Doubt("friction", told, decisive=False, strength=1.5)


def _varies(solution: RigidSolution) -> bool:
    """Whether Huber's estimate differs by much in what is identified; what is hardly told from zero decides nothing."""
    return bool((solution.checks.huber_variation[solution.estimate.identified] > _BIASED).any())


def _sizes(estimate: Estimate) -> Iterator[Doubt]:
    """Inertias that are all far from the robot file's, by about the same factor: units, or a gear ratio."""
    inertial = np.isin(np.array(estimate.kinds), _INERTIAL) & (estimate.nominal != 0)
    known = inertial & (np.abs(estimate.value) > _SIGNIFICANT * np.sqrt(np.diag(estimate.covariance)))
    if known.sum() < _FEWEST:
        return
    ratio = float(np.exp(np.median(np.log(np.abs(estimate.value[known] / estimate.nominal[known])))))
    if not 1 / _FAR < ratio < _FAR:
        told = f"inertias and first moments come out {two_digits(ratio)} times the robot file's in the median"
        yield Doubt("units", told, decisive=True, strength=abs(float(np.log(ratio))))


def _negative(estimate: Estimate) -> Iterator[Doubt]:
    """Friction and inertias that are negative beyond their interval."""
    columns = (each.tolist() for each in (estimate.nominal, estimate.upper, estimate.value))
    for name, kind, nominal, upper, value in zip(estimate.names, estimate.kinds, *columns, strict=True):
        own = name.endswith((".ZZ", ".XX", ".YY", ".M"))
        # A combination of the robot file's own bodies may be negative as well.
        if upper >= 0 or nominal < 0 or not (kind in _FRICTION or kind in ("motor_inertia", "coupling_inertia") or own):
            continue
        inertial = kind in _INERTIAL
        told = f"{name} comes out negative ({value:.3g})"
        # An inertia of its own may be negative as a combination; the first one about a motor's axis may not.
        decisive = kind in ("motor_inertia", "coulomb", "viscous")
        yield Doubt("torque_sign" if decisive else ("masses" if inertial else "friction"), told, decisive, 1.5)


def _excitation(solution: RigidSolution) -> Iterator[Doubt]:
    poor = [
        name
        for name, share in zip(solution.estimate.names, solution.estimate.relative_std.tolist(), strict=True)
        if share > solution.estimate.identifiable_relative_std
    ]
    if poor and solution.base.condition > _POOR_CONDITION:
        listed = ", ".join(poor[:5]) + (f" and {len(poor) - 5} more" if len(poor) > 5 else "")
        told = f"the motion has a condition number of {solution.base.condition:.3g}: {listed} suffer"
        yield Doubt("excitation", told, decisive=False, strength=solution.base.condition / _POOR_CONDITION)


def _bodies(solution: RigidSolution) -> Iterator[Doubt]:
    standard = solution.standard
    if standard is None or standard.status == "estimated" or not standard.moved.size:
        return
    worst = int(np.argmax(np.abs(standard.moved)))
    if abs(standard.moved[worst]) > _MOVED:
        told = (
            f"no real bodies have these base parameters: the nearest have {solution.estimate.names[worst]} off by "
            f"{two_digits(abs(float(standard.moved[worst])))} deviations"
        )
        yield Doubt("masses", told, decisive=False, strength=abs(float(standard.moved[worst])) / _MOVED)
