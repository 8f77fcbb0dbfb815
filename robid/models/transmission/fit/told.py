"""What is said of a gear: its parameters in the terms of data sheets, with their intervals."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from robid.arrays import FloatArray
from robid.models.transmission.fit.estimating import GearEstimate
from robid.models.transmission.fit.gear import RISE, GearModel
from robid.models.transmission.fit.law import Loop, data_sheet_loop
from robid.robot.description import Robot
from robid.robot.parameters import PARAMETER_KINDS

_STEP = 1e-4  # deviations
_USUAL_LAG_S = 1e-3
_USUAL_SHARE = 0.1  # of the deflection at the rated torque: what is natural to what may be zero


@dataclass(frozen=True)
class Told:
    """One parameter of a gear as it is reported."""

    name: str
    kind: str
    unit: str
    nominal: float  # NaN where no robot file states it
    value: float
    usual: float  # What its deviation is related to
    moves: FloatArray  # (n_param,) Its slope by each of the gear's parameters
    logarithmic: bool = False  # Whether its interval is that of its logarithm, and so are its slopes


@dataclass(frozen=True)
class Sums:
    """What is determined of a gear where parts of it are known by what is stated beforehand alone."""

    lag_s: float  # Lag of the encoders with the viscous friction behind the gear over the stiffness
    lag_std_s: float
    damping_s: float  # Damping over stiffness with the lag of the torque
    damping_std_s: float
    loop: float  # Width of the loop at zero torque with the friction behind the gear [rad, or m]
    loop_std: float


def spring_name(robot: Robot, joint: int) -> str:
    """Name of a joint's transmission in the robot file; the joint's where it has none."""
    springs = (s.name for s in robot.springs if s.joint == joint and s.place == "transmission")
    return next(springs, robot.joints[joint].name)


def loop_of(model: GearModel, values: FloatArray) -> Loop:
    """The loop of torque over deflection that a gear maker measures of these parameters (n_param,)."""
    return data_sheet_loop(model.law(values), model.data.rated, model.band)


def told_of(robot: Robot, model: GearModel, found: GearEstimate) -> tuple[tuple[Told, ...], Sums]:
    """Returns the parameters of a gear as they are reported, and the sums that the motions determine."""
    joint, slides = model.data.joint, robot.joints[model.data.joint].type == "prismatic"
    names, value = robot.joints[joint].name, found.value
    spring = spring_name(robot, joint)
    file = next((s for s in robot.springs if s.name == spring), None)
    at_rated = model.data.rated / float(np.exp(value[model.place("stiffness")]))
    usual = _USUAL_SHARE * at_rated
    curves = _curves(model, found)

    def row(kind: str, name: str, place: tuple[float, FloatArray], size: float, nominal: float = np.nan) -> Told:
        about = PARAMETER_KINDS[kind]
        return Told(name, kind, about.linear_unit if slides else about.unit, nominal, place[0], size, place[1])

    k = float(np.exp(value[model.place("stiffness")]))
    rows = [
        replace(
            row(
                "stiffness",
                f"{spring}.stiffness",
                (k, _unit(model, "stiffness")),
                k,
                np.nan if file is None else file.stiffness,
            ),
            logarithmic=True,
        )
    ]
    gear = model.options.gear
    rows += _stepped(model, value, k, f"{names}.stiffness_", slides=slides)
    if gear.stiffening and not model.data.steps.size:
        size = abs(curves["cubic"][0]) + k / model.scale**2
        rows.append(row("cubic", f"{spring}.cubic", curves["cubic"], size, np.nan if file is None else file.cubic))
    rows.append(row("lost_motion", f"{names}.lost_motion", curves["lost_motion"], curves["lost_motion"][0]))
    if gear.hysteresis:
        width, slip = curves["width"], curves["slip"]
        rows.append(row("hysteresis", f"{names}.hysteresis", width, max(abs(width[0]), usual)))
        rows.append(row("slip", f"{names}.slip", slip, max(abs(slip[0]), usual * k)))
    if gear.backlash:
        own = _linear(model, value, "backlash", model.scale)
        rows.append(row("backlash", f"{names}.backlash", own, max(abs(own[0]), usual)))
    for name, place, size in (
        ("encoder_lag", "lag", _USUAL_LAG_S),
        ("damping_time", "torque_lag", _USUAL_LAG_S),
        ("encoder_scale", "scale", model.options.prior.scale),
        ("encoder_offset", "offset", usual),
    ):
        own = _linear(model, value, place, 1.0)
        rows.append(row(name, f"{names}.{name}", own, max(abs(own[0]), size)))
    rows += [
        row(*each, usual) if each[0] == "transmission_error" else row(*each, 2 * np.pi)
        for each in _waves(model, value, names)
    ]
    return tuple(rows), _sums(model, found, curves["width"])


def _stepped(model: GearModel, value: FloatArray, k: float, name: str, *, slides: bool) -> list[Told]:
    """Stiffness from each of the data sheet's torques on."""
    about, found = PARAMETER_KINDS["stepped_stiffness"], []
    unit, moves, total = about.linear_unit if slides else about.unit, np.zeros(len(value)), 1.0
    for step in range(len(model.data.steps)):
        place = model.place(f"{RISE}{step}")
        moves[place], total = 1.0, total + float(value[place])
        logarithm = _unit(model, "stiffness") + moves / total
        row = Told(f"{name}{step + 2}", "stepped_stiffness", unit, np.nan, k * total, k * total, logarithm)
        found.append(replace(row, logarithmic=True))
    return found


def _unit(model: GearModel, name: str) -> FloatArray:
    moves = np.zeros(len(model.names))
    moves[model.place(name)] = 1.0
    return moves


def _linear(model: GearModel, value: FloatArray, name: str, size: float) -> tuple[float, FloatArray]:
    return size * float(value[model.place(name)]), size * _unit(model, name)


def _curves(model: GearModel, found: GearEstimate) -> dict[str, tuple[float, FloatArray]]:
    """Figures of the gear's loop, each with its slopes by the parameters."""
    fields = ("stiffness", "stiffening", "slip", "reach", "backlash", "rises")
    own = [at for at, name in enumerate(model.names) if name in fields or name.startswith(RISE)]
    places = [place for place in own if model.std[place] > 0]
    std = np.sqrt(np.diag(found.covariance))
    variants = [found.value]
    for place in places:
        moved = found.value.copy()
        moved[place] += _STEP * std[place]
        variants.append(moved)
    laws = [model.law(each) for each in variants]
    # A share of hysteresis may build up over twice the deflection instead of half of it.
    base, shape = laws[0], model.place("shape")
    laws += [replace(base, reach=2 * base.reach), replace(base, reach=0.5 * base.reach)]
    joined = replace(base, **{name: np.concatenate([getattr(law, name) for law in laws]) for name in fields})
    loop = data_sheet_loop(joined, model.data.rated, model.band)
    every = {
        "cubic": joined.stiffness * joined.stiffening,
        "lost_motion": loop.lost_motion(model.data.rated),
        "width": loop.width(),
        "slip": joined.slip,
    }
    result: dict[str, tuple[float, FloatArray]] = {}
    for name, values in every.items():
        moves = np.zeros(len(model.names))
        moves[places] = (values[1 : 1 + len(places)] - values[0]) / (_STEP * std[places])
        moves[shape] = 0.5 * (values[-2] - values[-1])
        result[name] = (float(values[0]), moves)
    return result


def _waves(model: GearModel, value: FloatArray, joint: str) -> list[tuple[str, str, tuple[float, FloatArray]]]:
    """Amplitudes and phases of what repeats with the turns of motor and arm."""
    rows: list[tuple[str, str, tuple[float, FloatArray]]] = []
    gear = model.options.gear
    for kind, orders in (("motor", gear.motor_orders), ("arm", gear.arm_orders)):
        for index, order in enumerate(orders):
            places = [model.place(f"wave_{kind}_{index}_{wave}") for wave in ("sin", "cos")]
            sine, cosine = value[places].tolist()
            size = float(np.hypot(sine, cosine))
            along, across = np.zeros(len(value)), np.zeros(len(value))
            along[places] = np.array([sine, cosine]) / max(size, 1e-300)
            across[places] = np.array([-cosine, sine]) / max(size, 1e-300) ** 2
            name = f"{joint}.{kind}_turn_{order:g}"
            rows.append(("transmission_error", name, (size, along)))
            rows.append(("transmission_phase", f"{name}.phase", (float(np.arctan2(cosine, sine)), across)))
    return rows


def _sums(model: GearModel, found: GearEstimate, width: tuple[float, FloatArray]) -> Sums:
    """What the motions determine: to first order each sum is one column."""
    data, value = model.data, found.value
    k = float(np.exp(value[model.place("stiffness")]))
    share = model.place("share")
    lag, loop = _unit(model, "lag"), width[1].copy()
    # Friction of the motor that acts behind the gear is n^2 viscous q' + n coulomb sign(q') there.
    lag[share] = data.ratio**2 * data.viscous / k
    loop[share] += 2 * abs(data.ratio) * data.coulomb / k
    damping = _unit(model, "torque_lag")

    def std(moves: FloatArray) -> float:
        return float(np.sqrt(moves @ found.covariance @ moves))

    return Sums(
        lag_s=float(value[model.place("lag")] + lag[share] * value[share]),
        lag_std_s=std(lag),
        damping_s=float(value[model.place("torque_lag")]),
        damping_std_s=std(damping),
        loop=width[0] + 2 * abs(data.ratio) * data.coulomb / k * float(value[share]),
        loop_std=std(loop),
    )
