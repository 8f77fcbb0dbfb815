"""How a linearised robot moves with its parameters: matrices by differences, the response by analytic columns."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray, IntArray
from robid.robot.description import Robot
from robid.robot.linearize import Equilibrium, LinearModel, Shifts, gravity_torque, linearize
from robid.robot.model import ElasticModel, build_model
from robid.robot.parameters import NUISANCE_KIND
from robid.robot.response import ElasticParameters, Response, fast_limit, gain_slopes, mass_matrix
from robid.robot.rest import MatrixSlopes, Moves, Springs, SpringSlopes, settle_springs, spring_slopes

_STEP_RAD = 1e-3
_STEP_M = 1e-3


def expand(
    model: ElasticModel,
    equilibrium: Equilibrium,
    linear: LinearModel,
    output_names: tuple[str, ...],
    located: IntArray | None = None,
) -> LinearModel:
    """Adds `rest.moves`, how the matrices move to first order, by central differences in MuJoCo.

    Args:
        model: The elastic model.
        equilibrium: Where it was linearised.
        linear: The result.
        output_names: Its outputs.
        located (n_location,): Elements of the flattened locations that may move; none by default.
    """
    chosen = np.zeros(0, int) if located is None else located
    to_rest = model.to_spring[:, len(model.motor) :]
    # Columns of to_rest move one deflection each, with all motors held.
    pairs, torques = [], []
    for moved in to_rest.T:
        sides = [replace(equilibrium, position=equilibrium.position + step * moved) for step in (-_STEP_RAD, _STEP_RAD)]
        pairs.append([linearize(model, side, output_names) for side in sides])
    for element in chosen.tolist():
        models = [build_model(_moved_spring(model.robot, element, step)) for step in (-_STEP_M, _STEP_M)]
        pairs.append([linearize(each, equilibrium, output_names) for each in models])
        # Where a spring sits changes what gravity does to the deflections, at the same configuration.
        behind, ahead = (gravity_torque(each, equilibrium.position) @ to_rest for each in models)
        torques.append((ahead - behind) / (2 * _STEP_M))
    width = np.array([_STEP_RAD] * to_rest.shape[1] + [_STEP_M] * chosen.size) * 2
    moves = Moves(
        **_slopes(pairs, width),
        torque=np.reshape(np.array(torques), (chosen.size, *equilibrium.deflection.shape)).swapaxes(0, 1),
        located=chosen,
    )
    return replace(linear, rest=replace(linear.rest, moves=moves))


def shifts_between(
    pairs: Sequence[tuple[LinearModel, LinearModel]],
    width: FloatArray,
    amounts: FloatArray,
    torque: FloatArray,
    late: tuple[FloatArray, FloatArray] | None = None,
    friction: tuple[FloatArray | None, ComplexArray | None] = (None, None),
) -> Shifts:
    """Returns how a linearised robot moves with nuisance parameters, by central differences.

    Args:
        pairs: The robot with less and with more of each.
        width (n_nuisance,): By how much each pair differs.
        amounts (n_nuisance,): Amounts in the middle.
        torque (n_nuisance, n_joint): As in `Shifts`.
        late: Its `late_torque` and `late_output`; nothing is late when not given.
        friction: Its `drift` and `clinging`, each (n_conf, n_nuisance, n_joint).
    """
    torques, outputs = (None, None) if late is None else late
    moved = _slopes(pairs, width)
    return Shifts(
        **moved,
        amounts=amounts,
        torque=torque,
        late_torque=torques,
        late_output=outputs,
        drift=friction[0],
        clinging=friction[1],
    )


def slopes_between(pairs: Sequence[tuple[LinearModel, LinearModel]], width: FloatArray) -> MatrixSlopes:
    """Returns central differences between robots with less and with more of each move, that differ by a width."""
    return MatrixSlopes(**_slopes(pairs, width))


def _moved_spring(robot: Robot, element: int, by_m: float) -> Robot:
    """The robot with one element of its springs' flattened locations moved."""
    spring = robot.springs[element // 3]
    point = spring.point_m + by_m * np.eye(3)[element % 3]
    return with_springs_at(robot, {spring.name: point})


def with_springs_at(robot: Robot, points: dict[str, FloatArray]) -> Robot:
    """Returns the robot with some springs elsewhere, by their names."""
    springs = tuple(replace(spring, point_m=points.get(spring.name, spring.point_m)) for spring in robot.springs)
    return replace(robot, springs=springs)


def _slopes(pairs: Sequence[Sequence[LinearModel]], width: FloatArray) -> dict[str, FloatArray]:
    """Central differences of everything that `MatrixSlopes` has."""
    found = {"mass": _differences([[_whole_mass(side) for side in pair] for pair in pairs], width)}
    for name in ("gravity_stiffness", "output", "tilt"):
        found[name] = _differences([[getattr(side, name) for side in pair] for pair in pairs], width)
    return found


def _whole_mass(linear: LinearModel) -> FloatArray:
    return np.asarray(linear.mass + np.einsum("l,clij->cij", linear.axial, linear.link_inertia))


def _differences(pairs: list[list[FloatArray]], width: FloatArray) -> FloatArray:
    """Central differences (n_conf, n_move, ...)."""
    # Central differences: their error falls with the square of the step.
    slopes = [(ahead - behind) / wide for (behind, ahead), wide in zip(pairs, width.tolist(), strict=True)]
    return np.stack(slopes, axis=1)


def jacobian(
    model: LinearModel, parameters: ElasticParameters, result: Response, kinds: tuple[str, ...]
) -> ComplexArray:
    """Derivatives (n_conf, n_freq, n_out, n_in, n_param) of the sampled response by plain, not logarithmic, values.

    Args:
        model: Linearised robot.
        parameters: Where `result` was computed.
        result: The response.
        kinds: Field names of `ElasticParameters`, in the order wanted.

    Source:
        docs/methods, sec. 1: `dG = w^2 X_o' (dZ) X_i`.
    """
    model = result.model
    slopes = loaded_slopes(model, parameters, result.springs, kinds)
    slopes = {kind: each for kind, each in slopes.items() if kind in kinds}
    columns = _all_columns(parameters, result, kinds, slopes)
    if result.images is not None and result.folding is not None:
        plain = replace(model, effects=None, added=None)
        # Images: the same columns at the folding's own frequencies, folded down by the same linear map.
        above = _all_columns(parameters, replace(result.images, model=plain), kinds, slopes)
        folded = (
            None if kind == "delay" else result.folding.images(each) for kind, each in zip(kinds, above, strict=True)
        )
        columns = [own if more is None else own + more for own, more in zip(columns, folded, strict=True)]
    if model.shifts is not None and NUISANCE_KIND in kinds:
        # Gains are exp(sum a t) of the motors' torques: the derivative of a logarithm is relative.
        relative = gain_slopes(model.shifts, np.real(result.omega))
        columns[kinds.index(NUISANCE_KIND)] += (result.sampled / result.gain)[..., None] * relative
    found = np.concatenate(columns, axis=-1)
    found *= result.gain[..., None]
    return found


def _all_columns(
    parameters: ElasticParameters, result: Response, kinds: tuple[str, ...], slopes: Mapping[str, SpringSlopes]
) -> list[ComplexArray]:
    """Derivatives of each kind, without those of the motors' gains and what images of the response fold down."""
    through_rest = _rest_columns(parameters, result, slopes)
    return [_columns(result.model, parameters, result, kind, through_rest.get(kind)) for kind in kinds]


def _columns(
    model: LinearModel, parameters: ElasticParameters, result: Response, kind: str, through_rest: ComplexArray | None
) -> ComplexArray:
    if kind == NUISANCE_KIND and model.shifts is not None:
        moved = _with_friction(_move_columns(parameters, result, model.shifts), result, model.shifts)
        return moved if model.effects is None else moved + _effect_columns(parameters, result)
    n_motor = model.n_motor
    scale = (result.hold * result.omega**2)[:, None, None, None]
    rate = 1j * result.omega[:, None, None, None]
    if kind == "damping":
        # dZ of a damper is j w at its place.
        own = scale * rate * _outer(result, slice(n_motor, None))
        if model.effects is not None:
            own = own * model.effects.growth(parameters.doubt)[:, None, None, None]
        return own if through_rest is None else own + through_rest
    if through_rest is not None:
        return through_rest
    if kind == "stiffness":
        # dZ of a spring is 1 at its place, times the law's factor at this configuration.
        return scale * _spring_outer(result) * model.rest.factor[:, None, None, None]
    if kind == "viscous":
        return scale * rate * _outer(result, slice(0, n_motor))
    if kind == "arm_viscous":
        return scale * rate * _products(model.arm @ result.outputs, model.arm @ result.inputs)
    if kind == "motor_inertia":
        matrices = np.eye(n_motor, model.mass.shape[-1])
        directions = np.einsum("li,lj->lij", matrices, matrices)
        return _inertia_columns(model, parameters, result, directions[None])
    if kind == "link_inertia":
        return _inertia_columns(model, parameters, result, model.link_inertia)
    return _delay_column(model, parameters, result)


def loaded_slopes(
    model: LinearModel, parameters: ElasticParameters, springs: Springs, kinds: tuple[str, ...]
) -> dict[str, SpringSlopes]:
    """How springs move with each kind of parameter; none where they are linear and rest where they are."""
    # Linear springs at fixed rest: nothing passes through the rest.
    constant = not parameters.cubic.any() and model.rest.moves is None
    if constant and {"cubic", "location"}.isdisjoint(kinds):
        return {}
    if constant:
        springs = settle_springs(model.rest, parameters.springs)
    return spring_slopes(model.rest, parameters.springs, springs)


def _rest_columns(
    parameters: ElasticParameters, result: Response, slopes: Mapping[str, SpringSlopes]
) -> dict[str, ComplexArray]:
    """Derivatives that pass through expected slopes and rest positions, by kind."""
    if not slopes:
        return {}
    model = result.model
    scale = (result.hold * result.omega**2)[:, None, None, None]
    stiffness = scale * _spring_outer(result)
    columns: dict[str, ComplexArray] = {
        kind: stiffness @ each.stiffness[:, None, None] for kind, each in slopes.items()
    }
    if model.rest.moves is not None:
        # Second path: parameters move the rest, and the rest moves matrices.
        moved = _move_columns(parameters, result, model.rest.moves)
        for kind, each in slopes.items():
            columns[kind] += moved @ each.displacement[:, None, None]
    return columns


def _move_columns(parameters: ElasticParameters, result: Response, moves: MatrixSlopes) -> ComplexArray:
    """Derivatives (n_conf, n_freq, n_out, n_in, n_move) along displacements of the rest, or nuisance parameters.

    dG = -w^2 ((dC) Z^-1 B - C Z^-1 (dZ) Z^-1 B), dZ by inertia and by the gradient of gravity. Most moves have few of
    these: delays and friction have none.
    """
    model, square = result.model, result.omega**2
    columns = np.zeros((*result.sampled.shape, moves.mass.shape[1]), complex)
    some = _acting(moves.mass)
    columns[..., some] = _inertia_columns(model, parameters, result, moves.mass[:, some])
    some = _acting(moves.gravity_stiffness)
    by_gravity = _quadratics(result, moves.gravity_stiffness[:, some])
    columns[..., some] += (result.hold * square)[:, None, None, None] * by_gravity
    for index in np.flatnonzero(_acting(moves.output) | _acting(moves.tilt)):
        seen = square[:, None, None] * moves.output[:, index, None] + moves.tilt[:, index, None]
        columns[..., index] -= result.hold[:, None, None] * (seen @ result.inputs)
    if result.folding is not None:
        # The fast limit C M^-1 B moves with the outputs; its motion with M is in the inertia columns.
        inverse = np.linalg.inv(mass_matrix(model, parameters))[..., : model.n_motor]
        fast = np.einsum("cmoa,cai->coim", moves.output, inverse)
        columns += result.folding.fast[..., None, None] * fast[:, None]
    return columns


def _acting(moves: FloatArray) -> BoolArray:
    """Which slopes (n_conf, n_move, ...) are not all zero."""
    return np.asarray(moves.any(axis=(0, *range(2, moves.ndim))))


def _effect_columns(parameters: ElasticParameters, result: Response) -> ComplexArray:
    """Derivatives (n_conf, n_freq, n_out, n_in, n_nuisance) through what gears do beside springs and dampers."""
    model, omega = result.model, result.omega
    if model.effects is None:
        return np.zeros((*result.sampled.shape, parameters.doubt.size), complex)
    slopes = model.effects.slopes(parameters.doubt, parameters.damping, np.real(omega))
    outer = _outer(result, slice(model.n_motor, None))
    moved = np.einsum("cfois,cfsd->cfoid", outer, slopes, optimize=True)
    return np.asarray((result.hold * omega**2)[:, None, None, None] * moved)


def _with_friction(moved: ComplexArray, result: Response, shifts: Shifts) -> ComplexArray:
    """Derivatives (n_conf, n_freq, n_out, n_in, n_nuisance), those through motors' friction added."""
    square = result.hold * result.omega**2
    # dG = w^2 x_o (dZ) x_i, dZ as of viscous friction and of springs, with what each configuration has of it.
    for own, scale in ((shifts.drift, 1j * result.omega * square), (shifts.clinging, square)):
        if own is not None:
            outer = _outer(result, slice(0, result.model.n_motor))
            moved = moved + scale[:, None, None, None] * np.einsum("cfoij,cmj->cfoim", outer, own, optimize=True)
    return np.asarray(moved)


def _spring_outer(result: Response) -> ComplexArray:
    """Outer products of the springs, over what their stiffness alone is of all that they have."""
    found, added = _outer(result, slice(result.model.n_motor, None)), result.model.added
    return found if added is None else np.asarray(found * (1 + added)[:, :, None, None])


def _outer(result: Response, rows: slice) -> ComplexArray:
    return _products(result.outputs[..., rows, :], result.inputs[..., rows, :])


def _products(outputs: ComplexArray, inputs: ComplexArray) -> ComplexArray:
    """Outer products (n_conf, n_freq, n_out, n_in, n_row) of the motions of some rows."""
    left, right = np.swapaxes(outputs, -1, -2), np.swapaxes(inputs, -1, -2)
    return np.asarray(left[..., :, None, :] * right[..., None, :, :])


def _inertia_columns(
    model: LinearModel, parameters: ElasticParameters, result: Response, directions: FloatArray
) -> ComplexArray:
    spread = np.broadcast_to(directions, (model.mass.shape[0], *directions.shape[1:]))
    change = _quadratics(result, spread)
    # dG = w^2 x_o (-w^2 dM) x_i.
    columns = -(result.hold * result.omega**4)[:, None, None, None] * change
    if result.folding is None:
        return np.asarray(columns)
    inverse = np.linalg.inv(mass_matrix(model, parameters))
    left, right = model.output @ inverse, inverse[..., : model.n_motor]
    # d(C M^-1 B) = -C M^-1 (dM) M^-1 B.
    fast = -np.einsum("coa,clab,cbi->coil", left, spread, right, optimize=True)
    return np.asarray(columns + result.folding.fast[..., None, None] * fast[:, None])


def _quadratics(result: Response, directions: FloatArray) -> ComplexArray:
    """Forms (n_conf, n_freq, n_out, n_in, n_direction) of each configuration's own (n_conf, n_direction, ...)."""
    places = zip(result.outputs, directions, result.inputs, strict=True)
    return np.stack([_quadratic(outputs, own, inputs) for outputs, own, inputs in places])


def _quadratic(outputs: ComplexArray, directions: FloatArray, inputs: ComplexArray) -> ComplexArray:
    """Forms `outputs' D inputs` (n_freq, n_out, n_in, n_direction) of real matrices (n_direction, n_row, n_row)."""
    n_freq, n_row, n_in = inputs.shape
    # One real matrix product over real and imaginary parts side by side, for all lines at once.
    flat = np.ascontiguousarray(inputs.swapaxes(0, 1)).reshape(n_row, -1).view(float)
    moved = (directions.reshape(-1, n_row) @ flat).view(complex).reshape(-1, n_row, n_freq, n_in)
    right = np.ascontiguousarray(moved.transpose(2, 1, 3, 0)).reshape(n_freq, n_row, -1)
    return np.asarray((outputs.swapaxes(1, 2) @ right).reshape(n_freq, outputs.shape[2], n_in, -1))


def _delay_column(model: LinearModel, parameters: ElasticParameters, result: Response) -> ComplexArray:
    rate = -1j * result.omega[:, None, None]
    if result.folding is None or result.by_delay is None:
        return np.asarray(rate * result.sampled / result.gain)[..., None]
    fast = fast_limit(model, parameters)[:, None]
    # A delay turns the line by -j w, but each image by its own frequency: these are taken apart.
    own = result.sampled / result.gain - result.folding.fast[..., None] * fast
    column = rate * own + result.by_delay.fast[..., None] * fast
    if result.images is not None:
        above = result.images.sampled
        column = column + result.by_delay.images(above) - rate * result.folding.images(above)
    return np.asarray(column)[..., None]
