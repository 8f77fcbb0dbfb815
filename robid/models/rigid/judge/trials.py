"""Likely causes of a bad rigid fit, tried: each is fitted again with what would mend it, on pieces left out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.models.rigid.fit.cut_off import choose_cut_off
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.shots import Shot
from robid.models.rigid.fit.solution import RigidSolution
from robid.results.finding import two_digits
from robid.robot.description import HarmonicBalance, Robot
from robid.robot.regressor.base import find_base_parameters
from robid.robot.regressor.drives import FrictionForm
from robid.robot.regressor.model import RigidModel, build_rigid_model

_GAIN = 0.8  # of the error before, that a cause leaves at most to be named
_SLOW = (0.02, 0.05)  # of the largest speed
_RICHER: tuple[FrictionForm, ...] = ("asymmetric", "quadratic", "load")
_LATE_S = (-0.02, -0.01, -0.005, -0.002, 0.002, 0.005, 0.01, 0.02)
_MOST = 3


@dataclass(frozen=True)
class Trial:
    """What one change of the fit gains."""

    cause: str  # of `robid.results.finding.CAUSES`
    change: str  # the change, as the user would state it
    before: float  # error on pieces left out over the torques, all motors alike, of the fit as it is
    after: float  # the same with the change

    @property
    def sentence(self) -> str:
        """What it gains."""
        return f"with {self.change} {two_digits(100 * self.after)} % instead of {two_digits(100 * self.before)} %"


def try_causes(
    robot: Robot, shots: Sequence[Shot], solution: RigidSolution, options: RigidFitOptions
) -> tuple[Trial, ...]:
    """Tries what may have spoiled a fit; returns what gains a fifth of its error, the most telling first.

    Tried are the cut-off, slow rows, friction richer by one term, a counterbalance of each joint that states none, and
    a delay of each motor. Errors are those on pieces of the log left out, in one band for all.
    """
    filters = replace(options.filters, position_cut_hz=solution.filtered.cut_hz)
    scene = _Scene(robot, shots, options, filters)
    found = [trial for trial in _all(scene) if trial.after < _GAIN * trial.before]
    found.sort(key=lambda trial: trial.after / trial.before)
    best: dict[str, Trial] = {}
    for trial in found:
        best.setdefault(trial.cause, trial)
    return tuple(best.values())[:_MOST]


@dataclass(frozen=True)
class _Scene:
    """A fit as it is, and what is asked of it."""

    robot: Robot
    shots: Sequence[Shot]
    options: RigidFitOptions
    filters: PreprocessingOptions

    def error(
        self,
        robot: Robot | None = None,
        friction: FrictionForm | None = None,
        filters: PreprocessingOptions | None = None,
        shots: Sequence[Shot] | None = None,
    ) -> FloatArray:
        """Mean squares (n_joint,) of errors on pieces left out with some change; infinite where it cannot be fitted."""
        model = self.model(robot or self.robot, friction or self.options.model.friction)
        chosen = filters or self.filters
        try:
            choice = choose_cut_off(shots or self.shots, model, chosen, (chosen.cut_hz,))
        except ValueError:
            return np.full(len(self.robot.joints), np.inf)
        return np.asarray(choice.left_out**2)

    def model(self, robot: Robot, friction: FrictionForm) -> RigidModel:
        """The model of a robot with a form of friction."""
        whole = build_rigid_model(robot, replace(self.options.model, friction=friction))
        return whole.only(find_base_parameters(whole, self.options.base).columns.tolist())

    @property
    def size(self) -> FloatArray:
        """Mean squares (n_joint,) of the torques."""
        return np.asarray(np.mean([(shot.torque**2).mean(axis=0) for shot in self.shots], axis=0))

    def whole(self, squares: FloatArray) -> float:
        """Error of all motors alike."""
        return float(np.sqrt((squares / self.size).mean()))


def _all(scene: _Scene) -> Iterator[Trial]:
    own = scene.error()
    before = scene.whole(own)
    yield from _cut_off(scene, before)
    yield from _slow_rows(scene)
    for form in _RICHER if scene.options.model.friction in ("viscous", "coulomb") else ():
        yield Trial("friction", f"`model: {{friction: {form}}}`", before, scene.whole(scene.error(friction=form)))
    for index, joint in enumerate(scene.robot.joints):
        if joint.counterbalance is None and joint.type == "revolute":
            after = scene.whole(scene.error(robot=_balanced(scene.robot, index)))
            yield Trial("counterbalance", f"a `counterbalance` of {joint.name} in the robot file", before, after)
    yield from _delays(scene, own)


def _cut_off(scene: _Scene, before: float) -> Iterator[Trial]:
    if scene.options.filters.position_cut_hz is None:
        return  # it was chosen by this already
    choice = choose_cut_off(
        scene.shots,
        scene.model(scene.robot, scene.options.model.friction),
        replace(scene.filters, position_cut_hz=None),
    )
    after = scene.whole(choice.left_out**2)
    yield Trial("filters", f"`filters: {{position_cut_hz: {two_digits(choice.cut_hz)}}}`", before, after)


def _slow_rows(scene: _Scene) -> Iterator[Trial]:
    """Rows near standstill, where friction is not Coulomb's, left out: the error is of those that remain."""
    fastest = max(float(np.abs(np.diff(shot.position, axis=0)).max()) / shot.sampling_period_s for shot in scene.shots)
    for share in _SLOW:
        dropping = replace(scene.filters, drop_below_rad_s=float(two_digits(share * fastest)))
        after = scene.whole(scene.error(filters=dropping))
        told = f"`filters: {{drop_below_rad_s: {dropping.drop_below_rad_s:g}}}`, of the rows that remain"
        yield Trial("friction", told, scene.whole(scene.error()), after)


def _balanced(robot: Robot, index: int) -> Robot:
    """The robot with a counterbalance of two harmonics at a joint, whatever it carries."""
    joints = list(robot.joints)
    joints[index] = replace(joints[index], counterbalance=HarmonicBalance(np.zeros(2), np.zeros(2)))
    return replace(robot, joints=tuple(joints))


def _delays(scene: _Scene, own: FloatArray) -> Iterator[Trial]:
    """Torques of all motors moved in time; of each the error on its own rows counts."""
    found, shortest = {}, min(len(shot.position) for shot in scene.shots)
    for late_s in _LATE_S:
        step = round(late_s / scene.shots[0].sampling_period_s)
        if step and abs(step) <= shortest // 2:
            found[late_s] = scene.error(shots=[_moved(shot, step) for shot in scene.shots])
    if not found:
        return
    squares = np.array(list(found.values()))
    best = np.argmin(squares, axis=0)
    for index, joint in enumerate(scene.robot.joints):
        late_s, size = list(found)[best[index]], scene.size[index]
        after, before = (float(np.sqrt(each / size)) for each in (squares[best[index], index], own[index]))
        what = "later" if late_s > 0 else "earlier"
        yield Trial(
            "delay", f"the torque of {joint.name} {abs(1e3 * late_s):g} ms {what}, of its torque", before, after
        )


def _moved(shot: Shot, step: int) -> Shot:
    """A shot whose torques act so many samples later; earlier where negative."""
    ahead, behind = max(0, -step), max(0, step)
    n_sample = len(shot.position)
    return replace(
        shot,
        position=shot.position[behind : n_sample - ahead],
        torque=shot.torque[ahead : n_sample - behind],
    )
