"""How nuisance parameters act on a response: a fitted robot that can be changed, and columns beside a fit's own.

`column` has a function for each effect: the derivative of the log response by its amount.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, singledispatch

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.errors import DataError
from robid.models.elastic.fit.nuisance.effects import (
    MICRO,
    Compliance,
    Drift,
    Effect,
    Hysteresis,
    LateDrive,
    LoadStiffness,
    MotorFriction,
    Nuisance,
    OneSided,
    RigidError,
    RobotMove,
    TorqueScale,
    ValueOff,
)
from robid.models.elastic.fit.nuisance.moves import PERCENT, stiffened
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import Problem
from robid.models.elastic.fit.rest_model import (
    NO_LOAD_RAD,
    TURN_10_HZ,
    bent_ways,
    campaign_course,
    friction_of_one,
    rest_model,
    spring_load,
)
from robid.robot.derivatives import jacobian, shifts_between
from robid.robot.description import Robot, Spring
from robid.robot.linearize import LinearModel, Shifts
from robid.robot.parameters import NUISANCE_KIND
from robid.robot.response import ElasticParameters, Response, response, with_values

_MEAN_SIZE = np.sqrt(2 / np.pi)  # of a normal variable, over its deviation
_STEP, _RIGID = 1e-3, 1e11  # percent of a gear's compliance; times its stiffness


@dataclass(frozen=True)
class Scene:
    """A problem at some values of its parameters, with the robot behind it."""

    problem: Problem  # The problem
    internal: FloatArray  # (n_param,) Internal parameters
    robot: Robot  # The robot file's robot
    options: ElasticOptions  # Options of the fit

    @cached_property
    def values(self) -> ElasticParameters:
        """Values of all parameters."""
        return self.problem.parameters.parameters(self.internal)

    @cached_property
    def stated(self) -> ElasticParameters:
        """Values as the robot file has them: what no fit estimates is off by shares of these."""
        robot = self.robot
        return replace(
            self.problem.parameters.nominal,
            stiffness=np.array([spring.stiffness for spring in robot.springs]),
            damping=np.array([spring.damping for spring in robot.springs]),
            motor_inertia=robot.motor_inertia_kgm2,
        )

    @cached_property
    def response(self) -> Response:
        """The model's response."""
        return self._response(self.problem.model, self.values)

    @cached_property
    def at_rest(self) -> ComplexArray:
        """Response (n_conf, n_freq, n_out, n_in) of the robot itself, at rest with these values."""
        return self.sampled(self.robot)

    @cached_property
    def gear_slopes(self) -> ComplexArray:
        """Derivatives (n_conf, n_freq, n_out, n_in, n_spring) of the log response by the springs' relative slopes.

        The slope alone changes, not where the spring rests: what moves it is added to the motion, not to the load.
        """
        # Without cubic coefficients, moves of the rest and what was added, the derivative is that by the slope alone,
        # whose relative size the factor undoes.
        linear = replace(self.values, cubic=np.zeros_like(self.values.cubic))
        stiffness = self.response.springs.stiffness
        still = replace(self.response.model, rest=replace(self.response.model.rest, moves=None), added=None)
        found = jacobian(still, linear, replace(self.response, model=still), ("stiffness",))
        slopes = found / still.rest.factor[:, None, None, None] * stiffness[:, None, None, None]
        return np.asarray(slopes / self.response.sampled[..., None])

    @cached_property
    def _slopes(self) -> dict[str, ComplexArray]:
        return {}

    def slopes(self, kind: str) -> ComplexArray:
        """Derivatives (n_conf, n_freq, n_out, n_in, n_element) of the log response by a kind's elements."""
        if kind not in self._slopes:
            found = jacobian(self.problem.model, self.values, self.response, (kind,))
            self._slopes[kind] = np.asarray(found / self.response.sampled[..., None])
        return self._slopes[kind]

    @cached_property
    def swing(self) -> FloatArray:
        """Mean square deflections (n_conf, n_freq, n_spring) at each line; zero where the torques are not known."""
        frf, values = self.problem.frf, self.values
        if frf.input_amplitude is None or any(name not in frf.output_names for name in frf.input_names):
            return np.zeros((*frf.response.shape[:2], len(self.robot.springs)))
        power = np.nan_to_num(spring_load(self.robot, frf, values).power)
        square = (2 * np.pi * frf.frequency_hz[:, None]) ** 2
        return np.asarray(power / (values.stiffness**2 + square * values.damping**2))

    def sampled(self, robot: Robot) -> ComplexArray:
        """Response (n_conf, n_freq, n_out, n_in) of another robot of the same springs, with the fitted values."""
        return self._response(*self.rested(robot, self.values)).sampled

    def extended(self, spring: Spring) -> ComplexArray:
        """Response (n_conf, n_freq, n_out, n_in) of the robot with one spring more."""
        robot = replace(self.robot, springs=(*self.robot.springs, spring))
        return self._response(*self.rested(robot, extended_values(self.values, [spring]))).sampled

    def rested(self, robot: Robot, values: ElasticParameters) -> tuple[LinearModel, ElasticParameters]:
        """Another robot where gravity lets it rest, so that no derivative of its matrices by the rest is needed."""
        frf, free = self.problem.frf, tuple(kind for kind in self.options.kinds if kind != "location")
        options = replace(self.options, statics="updates", free=free)
        model = with_estimated_links(rest_model(robot, frf, options, float(values.delay[0]), values), self.problem)
        inertia = values.link_inertia + model.axial - self.problem.model.axial
        added = self.problem.model.added
        if added is not None:
            further = len(robot.springs) - added.shape[-1]
            added = np.pad(added, ((0, 0), (0, 0), (0, further)))
        model = replace(model, added=added, clinging=self.problem.model.clinging)
        return model, with_values(values, "link_inertia", inertia)

    def settled(self) -> Scene:
        """The same where gravity lets the robot rest with these values."""
        return replace(self, problem=replace(self.problem, model=self.rested(self.robot, self.values)[0]))

    def along(self, shifts: Shifts) -> ComplexArray:
        """Derivatives (n_conf, n_freq, n_out, n_in, n_shift) of the log response along shifts of the matrices."""
        model = replace(self.response.model, shifts=shifts, effects=None)
        values = replace(self.values, doubt=shifts.amounts)
        moved = jacobian(model, values, replace(self.response, model=model), (NUISANCE_KIND,))
        return np.asarray(moved / self.response.sampled[..., None])

    def _response(self, model: LinearModel, values: ElasticParameters) -> Response:
        return response(model, values, self.problem.frf.frequency_hz, self.problem.frf.hold_period_s)


def extended_values(values: ElasticParameters, springs: Sequence[Spring]) -> ElasticParameters:
    """Returns values of parameters with those of further springs."""
    own = {"stiffness": "stiffness", "damping": "damping", "cubic": "cubic", "location": "point_m"}
    more = {kind: [getattr(spring, name) for spring in springs] for kind, name in own.items()}
    return replace(values, **{kind: np.append(getattr(values, kind), each) for kind, each in more.items()})


def with_estimated_links(model: LinearModel, problem: Problem) -> LinearModel:
    """Returns the model of a robot that is off, links' own inertias that the fit estimates as the robot file has them.

    What is off of these is estimated, and is no nuisance besides.
    """
    masks = dict(zip(problem.parameters.kinds, problem.parameters.masks, strict=True))
    estimated = masks.get("link_inertia", np.zeros(model.axial.size, bool))
    return replace(model, axial=np.where(estimated, problem.model.axial, model.axial))


def moves_matrices_alone(problem: Problem, internal: FloatArray) -> bool:
    """Whether a robot that is off has other matrices and nothing else: no stiffness that grows with its load."""
    return problem.model.shifts is None and not problem.parameters.parameters(internal).cubic.any()


@singledispatch
def column(effect: Effect, scene: Scene) -> ComplexArray:  # noqa: ARG001
    """Derivative (n_conf, n_freq, n_out, n_in) of the model's log response by an effect's amount.

    Args:
        effect: The effect; of one that acts only where a fit frees it, nothing.
        scene: Where to differentiate.
    """
    return np.zeros(scene.problem.frf.response.shape, complex)


@column.register
def _(effect: RobotMove, scene: Scene) -> ComplexArray:
    # A central difference of log G, the robot at rest anew on each side.
    ahead, behind = (scene.sampled(effect.moved(scene.robot, step)) for step in (effect.step, -effect.step))
    return np.asarray(np.log(ahead / behind) / (2 * effect.step))


@column.register
def _(effect: TorqueScale, scene: Scene) -> ComplexArray:
    found = np.zeros(scene.problem.frf.response.shape, complex)
    found[..., effect.joint] = effect.slope
    return np.asarray(found - column(effect.heavier, scene)) if effect.shared else found


@column.register
def _(effect: LateDrive, scene: Scene) -> ComplexArray:
    frf = scene.problem.frf
    found = np.zeros(frf.response.shape, complex)
    # Later by t: the response is turned by exp(-j w t), a column by its torque, a row by its output.
    turned = -2j * np.pi * frf.frequency_hz[:, None] * effect.amount_s
    name = frf.input_names[effect.joint]
    if effect.of == "torque":
        found[..., effect.joint] = turned
    elif name in frf.output_names:
        found[..., frf.output_names.index(name), :] = turned
    return found


@column.register
def _(effect: ValueOff, scene: Scene) -> ComplexArray:
    return np.asarray(scene.slopes(effect.kind)[..., effect.element] * value_of_one(effect, scene.stated))


def value_of_one(effect: ValueOff, values: ElasticParameters) -> float:
    """By how much an amount of one takes a parameter off, in its own unit."""
    if effect.kind == "delay":
        return MICRO
    if effect.kind in ("viscous", "arm_viscous"):
        inertia = values.motor_inertia if effect.kind == "viscous" else values.link_inertia
        return friction_of_one(float(inertia[effect.element]))
    return float(getattr(values, effect.kind)[effect.element]) / PERCENT


@column.register
def _(effect: Drift, scene: Scene) -> ComplexArray:
    own = friction_of_one(float(scene.robot.joints[effect.joint].motor.inertia_kgm2))
    share = own * campaign_course(len(scene.problem.frf.configurations))
    return np.asarray(share[:, None, None, None] * scene.slopes("viscous")[..., effect.joint])


@column.register
def _(effect: MotorFriction, scene: Scene) -> ComplexArray:
    frf, whole, hold = scene.problem.frf, scene.response.sampled, scene.response.hold
    name = frf.input_names[effect.joint]
    if name not in frf.output_names:
        return np.zeros_like(whole)  # nothing shows its angle
    row = frf.output_names.index(name)
    square = (2 * np.pi * frf.frequency_hz) ** 2
    # Its torque -c x is F = c / w^2 times the acceleration: fed back, G becomes (1 - G F)^-1 G, nearly G + G F G.
    moved = whole[..., :, effect.joint, None] * whole[..., row, None, :] / whole
    # The motor feels its friction at once, a torque only after hold and delay.
    return np.asarray(clinging_stiffness(effect, scene) * moved / (square * hold)[:, None, None])


def clinging_stiffness(effect: MotorFriction, scene: Scene) -> complex:
    """Torque per angle that an amount of one is [N m/rad]."""
    return effect.phase * float(scene.values.motor_inertia[effect.joint]) * TURN_10_HZ**2 / PERCENT


@column.register
def _(effect: Hysteresis | LoadStiffness | OneSided, scene: Scene) -> ComplexArray:
    return np.asarray(gear_share(effect, scene)[:, :, None, None] * scene.gear_slopes[..., effect.spring])


@singledispatch
def gear_share(effect: Effect, scene: Scene) -> ComplexArray:  # noqa: ARG001
    """What an amount of one adds to a gear's stiffness (n_conf, n_freq or 1), over it."""
    message = f"{type(effect).__name__} is beside no gear"
    raise TypeError(message)


@gear_share.register
def _(effect: Hysteresis, scene: Scene) -> ComplexArray:
    omega = 2 * np.pi * scene.problem.frf.frequency_hz
    return 2 / PERCENT * bristle_share(omega, scene.swing[:, :, effect.spring], effect.slip)


@gear_share.register
def _(effect: LoadStiffness, scene: Scene) -> ComplexArray:
    load = np.abs(scene.problem.model.rest.deflection[:, effect.spring])
    spread = load - load.mean()
    most = np.abs(spread).max()
    share = spread / most if most > NO_LOAD_RAD else np.zeros_like(spread)
    return np.asarray(share[:, None] / PERCENT, complex)


@gear_share.register
def _(effect: OneSided, scene: Scene) -> ComplexArray:
    return np.asarray(bent_ways(scene.problem.model, effect.spring)[:, None] / PERCENT, complex)


def bristle_share(omega: FloatArray, swing: FloatArray, relative_slip: float) -> ComplexArray:
    """What bristles add to a spring, over their stiffness times their mean gain, as `Hysteresis` says.

    Args:
        omega (n_freq,): Angular frequencies [rad/s].
        swing (n_conf, n_freq): Mean square deflection at each line; where all are zero, motion is taken to be alike.
        relative_slip: Deflection at which they slip over the root mean square one.

    Returns:
        Shares (n_conf, n_freq).
    """
    if not swing.any():
        return np.broadcast_to(1j * omega / (1j * omega + np.exp(np.log(omega).mean()) / relative_slip), swing.shape)
    slip = relative_slip * np.sqrt(swing.sum(axis=1).mean())
    power = omega**2 * swing
    speed = np.sqrt(power.sum(axis=1, keepdims=True))
    # Linearised about a normal motion, the mean of |dx/dt| z / h is sqrt(2/pi) v z / h: the corner of a low pass.
    corner = _MEAN_SIZE * speed / slip
    pulled = (power * corner / (omega**2 + corner**2)).sum(axis=1, keepdims=True)
    gain = 1 / (1 + _MEAN_SIZE * pulled / (np.maximum(speed, np.finfo(float).tiny) * slip))
    return np.asarray(gain / gain.mean() * 1j * omega / (1j * omega + corner))


@column.register
def _(effect: Compliance, scene: Scene) -> ComplexArray:
    names = [spring.name for spring in scene.robot.springs]
    if effect.spring.name in names:
        index = names.index(effect.spring.name)
        amount = PERCENT * effect.spring.stiffness / scene.values.stiffness[index]
        softer = scene.slopes("stiffness")[..., index] * scene.values.stiffness[index]
        # By the logarithm of its compliance, minus that by that of its stiffness; its damper is in proportion.
        softer = softer + scene.slopes("damping")[..., index] * scene.values.damping[index]
        return np.asarray(-softer / amount)
    factors = _RIGID, PERCENT / _STEP, 0.5 * PERCENT / _STEP
    rigid, stiff, soft = (scene.extended(stiffened(effect.spring, factor)) for factor in factors)
    # One-sided differences, extrapolated: there is no negative compliance.
    return np.asarray((2 * np.log(stiff / rigid) - 0.5 * np.log(soft / rigid)) / _STEP)


@column.register
def _(effect: RigidError, scene: Scene) -> ComplexArray:
    return np.asarray(np.log(scene.sampled(effect.off.robot) / scene.at_rest) / effect.off.deviations)


def nuisance_columns(
    problem: Problem,
    internal: FloatArray,
    robot: Robot,
    options: ElasticOptions,
    nuisances: Sequence[Nuisance],
    *,
    amounts: FloatArray | None = None,
    all_rest: bool = True,
    shifts: Shifts | None = None,
) -> ComplexArray:
    """Derivatives of the residual by the amounts of nuisance parameters, as `Problem.linear`'s by its own.

    Args:
        problem: The problem.
        internal (n_param,): Where to evaluate.
        robot: The robot that they were listed for.
        options: Options of the fit.
        nuisances: The nuisance parameters.
        amounts (n_nuisance,): By how much this robot is off already; nothing when not given.
        all_rest: Whether robots that are a little off must rest; otherwise nothing is said of what they do not rest by.
        shifts: How the matrices of the robot, which is at rest, move with those that are moves of it; found here
            when not given, together with how loaded springs stiffen.

    Returns:
        Negative derivatives (n_conf, n_freq, n_out, n_in, n_nuisance), to be put beside those by the parameters.

    Raises:
        DataError: If a robot must rest and does not.
    """
    if not nuisances:
        return np.empty((*problem.frf.response.shape, 0), complex)
    scene, kind = Scene(problem, internal, robot, options), problem.residual_kind
    columns = _log_slopes(scene, nuisances, all_rest=all_rest, shifts=shifts)
    # What is exactly zero has no relative change.
    columns[scene.response.sampled == 0] = 0.0
    if amounts is not None and shifts is None:
        columns /= _more_of_it(nuisances, amounts)
    return kind.part(columns * kind.per_relative(scene.response.sampled)[..., None])


def _log_slopes(scene: Scene, nuisances: Sequence[Nuisance], *, all_rest: bool, shifts: Shifts | None) -> ComplexArray:
    """Derivatives (n_conf, n_freq, n_out, n_in, n_nuisance) of the log response by the amounts."""
    columns = np.empty((*scene.problem.frf.response.shape, len(nuisances)), complex)
    # Moves of the robot change its matrices alone where no stiffness grows with the load: then one analytic derivative
    # along the matrices' differences serves all of them, in place of two responses for each.
    known = shifts is not None or moves_matrices_alone(scene.problem, scene.internal)
    together = np.array([known and isinstance(each.effect, RobotMove) for each in nuisances])
    with np.errstate(divide="ignore", invalid="ignore"):
        for index in np.flatnonzero(~together).tolist():
            columns[..., index] = _column(nuisances[index].effect, scene, must_rest=all_rest)
        if together.any():
            rested = scene.settled() if shifts is None else scene
            columns[..., together] = rested.along(shifts or find_shifts(rested, nuisances, must_rest=all_rest))
    return columns


def _more_of_it(nuisances: Sequence[Nuisance], amounts: FloatArray) -> FloatArray:
    """How much more a per cent of a body (n_nuisance,) is that is off, than of the one that the file states."""
    shares = np.array([isinstance(each.effect, RobotMove) and each.unit == "%" for each in nuisances])
    return np.where(shares, 1 + amounts / PERCENT, 1.0)


def find_shifts(scene: Scene, nuisances: Sequence[Nuisance], *, must_rest: bool = True) -> Shifts:
    """Finds how the matrices of a robot move with those nuisance parameters that are moves of it.

    Args:
        scene: The robot.
        nuisances: The nuisance parameters, others among them.
        must_rest: Whether robots near it must rest; otherwise nothing moves with those by which they do not.

    Raises:
        DataError: If a robot near it must rest and does not.
    """
    effects = [each.effect for each in nuisances if isinstance(each.effect, RobotMove)]
    pairs = [_sides(scene, effect, must_rest=must_rest) for effect in effects]
    width = 2 * np.array([effect.step for effect in effects])
    nothing = np.zeros((len(pairs), len(scene.robot.joints)))
    return shifts_between(pairs, width, nothing[:, 0], nothing)


def _sides(scene: Scene, effect: RobotMove, *, must_rest: bool) -> tuple[LinearModel, LinearModel]:
    """The robot with a little less and a little more of it; as it is where one of them does not rest."""
    try:
        behind, ahead = (
            scene.rested(effect.moved(scene.robot, step), scene.values)[0] for step in (-effect.step, effect.step)
        )
    except DataError:
        if must_rest:
            raise
        return scene.problem.model, scene.problem.model
    return behind, ahead


def _column(effect: Effect, scene: Scene, *, must_rest: bool) -> ComplexArray:
    try:
        return column(effect, scene)
    except DataError:
        if must_rest:
            raise
        return np.zeros(scene.problem.frf.response.shape, complex)
