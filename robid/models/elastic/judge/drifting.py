"""Friction that drifts over a campaign, where the residual follows it far more than anything else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.clusters.evidence import group_clusters
from robid.models.elastic.fit.intervals import FEWEST_CLUSTERS
from robid.models.elastic.fit.nuisance.effects import Drift
from robid.models.elastic.fit.nuisance.kinds import DRIFT, LOAD_FRICTION
from robid.models.elastic.fit.nuisance.listing import estimable_nuisances
from robid.models.elastic.fit.nuisance.wording import free_with
from robid.models.elastic.fit.rest_model import friction_of_one
from robid.models.elastic.fit.solution import Detectable, ElasticSolution
from robid.models.elastic.judge.causes import of_nuisances
from robid.models.elastic.judge.fitted import FittedModel
from robid.models.elastic.judge.ratios import CHANCE, Explanation, score
from robid.results.finding import Finding, two_digits

_OUTSTANDING = 10.0
"""Times what the next defect explains: 25 to 205 of robots whose friction drifts, at most 4.2 of sound ones."""

_LEAST = 0.1  # of a motor's viscous friction, from which its growth is worth a word
_MOST = 3  # motors that are named


def drift_findings(fitted: FittedModel, solution: ElasticSolution, far: float) -> tuple[Finding, ...]:
    """A finding where the motors' friction drifts over the campaign, though hardly an element shows it.

    Friction that differs between configurations need not move any spring, nor keep a fit from being trusted. A response
    that is not quite the model's asks a little for every defect; of a drift it asks for nothing else as much.

    Args:
        fitted: The fitted model in the configurations of the fit's own response.
        solution: What the fit found, with what its residual asks for.
        far: Half widths from the middle of an interval beyond which a value is outside.
    """
    found = solution.detectable
    few = len(group_clusters(solution.responses.configurations)) < FEWEST_CLUSTERS
    if found is None or few or not _stands_out(found):
        return ()
    drifts = tuple(each for each in estimable_nuisances(fitted.robot) if isinstance(each.effect, Drift))
    all_of_them = list(range(len(drifts)))
    explained = of_nuisances(score(fitted, drifts), all_of_them, fitted, swings_known=False)
    growths = [] if explained is None else _growths(fitted, solution, explained)
    if explained is None or all(abs(each.share) < _LEAST for each in growths):
        return ()
    moved, name = _moved(solution, explained)
    more = f" and {len(growths) - _MOST} more" if len(growths) > _MOST else ""
    names = (explained.cause,) if len(growths) > _MOST else explained.free
    free = ", ".join(free_with(fitted.options.free, names))
    message = (
        f"viscous friction drifts over the campaign: {', '.join(map(str, growths[:_MOST]))}{more} from the first "
        "configuration to the last; that would explain more of the residual than anything else, and moves "
        f"{name} by {two_digits(moved)} half-widths of its interval (warm the robot up and measure in random order, or "
        f"try `free: [{free}]`)"
    )
    return (Finding(explained.cause, message, decisive=False, strength=moved / far),)


def _stands_out(found: Detectable) -> bool:
    """Whether the residual asks for the drifts of all motors together far more than for any other defect.

    By chance, loads of a few configurations come in much the same order: friction by load needs to explain only less.
    """
    drifts = np.array([name.endswith(f".{DRIFT}") for name in found.names])
    by_load = np.array([f".{LOAD_FRICTION}" in name for name in found.names])
    others = float(found.gain[~(drifts | by_load)].max(initial=0.0))
    rival = float(found.gain[by_load].sum())
    return bool(found.gain[drifts].sum() > max(_OUTSTANDING * others, rival, CHANCE))


@dataclass(frozen=True)
class _Growth:
    """How much the friction of a motor grows from the first configuration to the last."""

    joint: str
    viscous: float  # By how much [N m s/rad]
    mean: float  # What it has in the mean; 0 where that is not identified [N m s/rad]

    @property
    def share(self) -> float:
        return self.viscous / self.mean if self.mean > 0 else float(np.copysign(np.inf, self.viscous))

    def __str__(self) -> str:
        told = (
            f"{two_digits(100 * self.share, '+')} %" if self.mean > 0 else f"{two_digits(self.viscous, '+')} N m s/rad"
        )
        return f"{self.joint} {told}"


def _growths(fitted: FittedModel, solution: ElasticSolution, explained: Explanation) -> list[_Growth]:
    inertia = {joint.name: joint.motor.inertia_kgm2 for joint in fitted.robot.joints}
    estimate = solution.estimate
    known = dict(zip(estimate.names, np.where(estimate.identified, estimate.value, 0.0).tolist(), strict=True))
    joints = [free.rpartition(".")[0] for free in explained.free]
    # An amount is half the growth, in percent of what the rotor asks for at 10 Hz.
    return [
        _Growth(joint, 2 * amount * friction_of_one(inertia[joint]), known.get(f"{joint}.viscous", 0.0))
        for joint, amount in zip(joints, explained.amounts.tolist(), strict=True)
    ]


def _moved(solution: ElasticSolution, explained: Explanation) -> tuple[float, str]:
    """The spring or damper that it moves farthest, in half widths of its interval."""
    estimate = solution.estimate
    half = 0.5 * np.log(np.maximum(estimate.upper, 1e-300) / np.maximum(estimate.lower, 1e-300))
    counts = np.isin(estimate.kinds, ("stiffness", "damping")) & (half > 0)
    far = np.where(counts, np.abs(explained.moved) / np.where(counts, half, 1.0), 0.0)
    worst = int(np.argmax(far))
    return float(far[worst]), estimate.names[worst]
