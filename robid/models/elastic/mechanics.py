"""What an export holds (tables of parameters, arrays, state spaces, MJCF), and how it is written in each format."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from robid.arrays import FloatArray
from robid.errors import DataError, SettingsError
from robid.frf.frf import Frf
from robid.models.elastic.files import solution_from_artifact
from robid.models.elastic.fit.gears_alone import WITH_CHAIN
from robid.models.elastic.fit.nuisance.kinds import HYSTERESIS, LOAD_DAMPING
from robid.models.elastic.fit.solution import ElasticSolution, fitted_delay_s, fitted_robot
from robid.models.elastic.fitting import nominal_robot
from robid.models.elastic.judge.fitted import fitted_model
from robid.models.elastic.judge.middles import middle_rows
from robid.models.elastic.settings import elastic_fit
from robid.models.encode import PARAMETER_COLUMNS, Content, encode_csv, encode_json, encode_mat, encode_npz
from robid.models.family import ExportTask
from robid.models.parameters import with_torque_unit
from robid.results.estimate import Estimate
from robid.robot.description import Robot
from robid.robot.export import to_mjcf
from robid.robot.friction import LUGRE
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import ElasticModel, build_model
from robid.robot.parameters import NUISANCE_KIND
from robid.robot.response import nominal_parameters
from robid.robot.statespace import discretise, state_space
from robid.settings.load import LoadedExperiment
from robid.settings.robot_parts import delay_s, require_controller
from robid.signals.quantities import readable, readable_units
from robid.simulate.options import Imperfections, SimulateOptions
from robid.simulate.steps import choose_steps
from robid.versions import __version__

_OF_GEARS = ("gear_alone_value", "gear_alone_lower", "gear_alone_upper")
_COLUMNS = (*PARAMETER_COLUMNS, "meaning", "middle_moved_by", *_OF_GEARS)
"""Columns of elastic fits: what a stiffness is of where that is not its name alone, what moves the middle of its
interval away from the estimate, and what the gear alone may be."""
_OF_PHYSICAL = {"physical_lower": "lower", "physical_upper": "upper", "physical_relative_std": "relative_std"}
_VALUES = {name: {"estimate": "value", **_OF_PHYSICAL}.get(name, name) for name in PARAMETER_COLUMNS[3:]}
"""Fields of an estimate by column: its interval is that of the parameter itself."""


@dataclass(frozen=True)
class FittedExport:
    """A fit, its data, and what they stand for."""

    loaded: LoadedExperiment  # The experiment
    name: str  # Name of the fit
    nominal: Robot  # The robot that it started from
    date: str  # When it was made
    solution: ElasticSolution  # What it found
    frf: Frf  # The response that it was fitted to, in its configurations
    chosen: tuple[int, ...]  # Index of each of them in the campaign

    @cached_property
    def robot(self) -> Robot:
        """Returns the robot with the estimates in place, dampers that grow with the load as they are on average."""
        robot, grown = fitted_robot(self.nominal, self.solution.estimate), self.grown
        springs = tuple(
            replace(spring, damping=spring.damping * grown.get(spring.name, 1.0)) for spring in robot.springs
        )
        return replace(robot, springs=springs) if grown else robot

    @property
    def bristles(self) -> dict[str, float]:
        """Returns the torques at which bristles beside transmissions slip, by spring; those above zero."""
        found = self._nuisances(HYSTERESIS)
        return {spring: torque for spring, torque in found.items() if torque > 0}

    @cached_property
    def grown(self) -> dict[str, float]:
        """Dampers of loaded gears over those without load, by spring: mean over the fit's configurations."""
        gears = self._nuisances(LOAD_DAMPING)
        if not gears:
            return {}
        fit = elastic_fit(self.loaded.experiment, self.name)
        fitted = fitted_model(self.nominal, self.solution, self.frf, fit.options(), self.stated_delay_s)
        effects = fitted.problem.model.effects
        if effects is None:
            return {}
        mean = effects.growth(fitted.parameters.doubt).mean(axis=0)
        names = [spring.name for spring in self.nominal.springs]
        return {name: float(mean[names.index(name)]) for name in gears}

    def _nuisances(self, kind: str) -> dict[str, float]:
        """Estimates of a kind of gears that the fit estimated, by spring."""
        found = self.solution.estimate
        rows = zip(found.names, found.kinds, found.value.tolist(), strict=True)
        return {
            n.removesuffix(f".{kind}"): value for n, k, value in rows if k == NUISANCE_KIND and n.endswith(f".{kind}")
        }

    @property
    def stated_delay_s(self) -> float:
        """Returns the delay that the fit started from [s]."""
        fit = self.loaded.experiment.fits[self.name]
        return delay_s(self.loaded, self.loaded.experiment.campaigns[fit.campaign])

    @property
    def delay_s(self) -> float:
        """Returns the delay from commanded to applied torque [s]."""
        return fitted_delay_s(self.solution.estimate, self.stated_delay_s)

    @property
    def units(self) -> list[str]:
        """Returns the unit of each parameter."""
        return [with_torque_unit(unit, self.frf.input_unit) for unit in self.solution.estimate.units]

    @property
    def origin(self) -> dict[str, str]:
        """Returns where the numbers come from."""
        return {
            "robot": self.loaded.robot.name,
            "experiment": self.loaded.experiment.name,
            "fit": self.name,
            "fitted_utc": self.date,
            "status": self.solution.estimate.status,
            "torque_unit": self.frf.input_unit,
            "robid_version": __version__,
        }


def parameter_records(found: FittedExport) -> list[dict[str, object]]:
    """Returns one mapping of the columns for each parameter, those that follow another one last."""
    estimate, tied = found.solution.estimate, found.solution.estimate.tied
    every = (*_columns(estimate).values(), *_gears(found.solution).values())
    columns = estimate.names, estimate.kinds, found.units, *(np.asarray(each).tolist() for each in every)
    own = {str(row[0]): dict(zip(_COLUMNS, row, strict=True)) for row in zip(*columns, strict=True)}
    told = ("nominal", "estimate", "physical_lower", "physical_upper")
    values = (each.tolist() for each in (tied.nominal, tied.value, tied.lower, tied.upper))
    followers = zip(tied.names, tied.to, *values, strict=True)
    unknown = dict.fromkeys((*_VALUES, *_OF_GEARS), math.nan)
    more = [
        own[leader]
        | unknown
        | dict(zip(told, row, strict=True))
        | {"name": name, "identifiable": own[leader]["identifiable"]}
        for name, leader, *row in followers
    ]
    return [*own.values(), *more]


def _columns(estimate: Estimate) -> dict[str, FloatArray]:
    """Values of the parameters by column, beside names, kinds and units; NaN what an older model does not tell."""
    unknown = np.full(len(estimate.names), np.nan)
    found = {name: getattr(estimate, field) for name, field in _VALUES.items()}
    return {name: unknown if values is None else values for name, values in found.items()}


def _gears(solution: ElasticSolution) -> dict[str, FloatArray | tuple[str, ...]]:
    """The columns of middles and of gears alone; NaN of what is no gear, or not told by an older model."""
    names, gears = solution.estimate.names, solution.gears
    told = () if gears is None else gears.names
    rows = [names.index(name) for name in told]
    columns = np.full((3, len(names)), np.nan)
    if gears is not None:
        columns[:, rows] = gears.value, gears.lower, gears.upper
    meaning = tuple(WITH_CHAIN if name in told else "" for name in names)
    reasons = {row.name: row.reason for row in middle_rows(solution)}
    moved = tuple(reasons.get(name, "") for name in names)
    return {"meaning": meaning, "middle_moved_by": moved, **dict(zip(_OF_GEARS, columns, strict=True))}


def arrays(found: FittedExport, rows: list[int]) -> Content:
    """Returns parameters with their covariance, and measured and modelled responses."""
    estimate, responses = found.solution.estimate, found.solution.responses
    return {
        **found.origin,
        "names": estimate.names,
        "kinds": estimate.kinds,
        **_columns(estimate),
        **_gears(found.solution),
        "units": found.units,
        "covariance": estimate.covariance,
        "degrees_of_freedom": estimate.degrees_of_freedom,
        "interval_rule": estimate.interval_rule,
        "confidence": estimate.confidence,
        "configuration": np.array(found.chosen)[rows] + 1,  # its number, from 1
        "configurations_rad": responses.configurations[rows],
        "frequency_hz": responses.frequency_hz,
        "measured": responses.measured[rows],
        "modelled": responses.modelled[rows],
        "input_names": found.frf.input_names,
        "output_names": found.frf.output_names,
        "sampling_period_s": found.frf.sampling_period_s,
        "torque_hold": found.frf.input_hold,
        "response_axes": "configuration, frequency, output, input",
    }


def state_spaces(found: FittedExport, rows: list[int]) -> Content:
    """Returns the continuous and the sampled state space of each configuration, stacked along the first axis."""
    robot, period = found.robot, found.frf.sampling_period_s
    model = _build(found, friction=False)
    rest = solve_statics(model, found.frf.configurations[rows])
    linear = linearize(model, rest, found.frf.output_names)
    delay = max(0.0, found.delay_s)
    parameters = nominal_parameters(robot, linear, delay)
    names = found.frf.input_names, tuple(spring.name for spring in robot.springs), found.frf.output_names
    continuous = [state_space(linear, parameters, index, *names) for index in range(len(rows))]
    sampled = [discretise(system, period, delay) for system in continuous]
    stacks: Content = {}
    for systems, suffix in ((continuous, ""), (sampled, "_sampled")):
        stacks |= {f"{key}{suffix}": np.array([getattr(system, key) for system in systems]) for key in "ABCD"}
        stacks |= {f"{key}{suffix}": getattr(systems[0], key) for key in ("states", "outputs")}
    return {
        **found.origin,
        **_left_out(found),
        **stacks,
        "inputs": continuous[0].inputs,
        "sampling_period_s": period,
        "delay_s": delay,
        "configuration": np.array(found.chosen)[rows] + 1,  # its number, from 1
        "configurations_rad": found.frf.configurations[rows],
        "rest_torque": rest.motor_torque,
        "rest_deflection_rad": rest.deflection,
    }


def _left_out(found: FittedExport) -> dict[str, str]:
    """What a linear system of constant matrices does not hold of the gears, if anything."""
    told = ["hysteresis of " + ", ".join(found.bristles)] if found.bristles else []
    told += ["growth of dampers with the load: they are as on average"] if found.grown else []
    return {"left_out": "; ".join(told)} if told else {}


def mjcf(found: FittedExport, rows: list[int], *, friction: bool) -> str:
    """Returns the MJCF of the fitted robot, one keyframe for each configuration."""
    model = _build(found, friction=friction)
    angles = found.frf.configurations[rows]
    names = [f"configuration_{found.chosen[row] + 1}" for row in rows]
    return to_mjcf(model, solve_statics(model, angles), tuple(names), _header(found, names, angles, friction=friction))


def _build(found: FittedExport, *, friction: bool) -> ElasticModel:
    fit = found.loaded.experiment.fits[found.name]
    source = found.loaded.experiment.campaigns[fit.campaign].source
    simulated = None if source is None else source.simulate
    try:
        steps = 1 if simulated is None else _steps(found, simulated, friction=friction)
        step_s = found.frf.sampling_period_s / steps
        return build_model(
            found.robot,
            friction=LUGRE if friction else None,
            ripple=friction,
            bristles=found.bristles,
            timestep_s=step_s,
            balanced=True,
        )
    except ValueError as error:
        raise DataError(
            f"D138 the fitted values make no mechanical model ({error})",
            where=f"fits.{found.name}",
            remedy="fix the link inertias in the fit, or export parameters only (json, csv, mat)",
        ) from error


def _steps(found: FittedExport, simulate: SimulateOptions, *, friction: bool) -> int:
    """Steps per sample of the simulated campaign, or what the fitted robot itself needs."""
    options = replace(simulate, imperfections=Imperfections(friction="lugre" if friction else "none"))
    robot, still = found.robot, np.zeros(len(found.robot.joints))
    controller = require_controller(found.loaded)
    return choose_steps(robot, controller, options, found.frf.configurations, found.frf.frequency_hz, still).count


def _header(found: FittedExport, names: list[str], angles: FloatArray, *, friction: bool) -> str:
    estimate, unit = found.solution.estimate, found.frf.input_unit
    relied = estimate.identified | estimate.known_beforehand
    weak = [name for name, known in zip(estimate.names, relied.tolist(), strict=True) if not known]
    units = found.frf.joint_units
    shown = [np.array2string(row, precision=3, max_line_width=1000) for row in readable(angles, units)]
    sides = "deg" if units is None else f"{', '.join(readable_units(units, len(units)))}"
    return "\n".join(
        [
            f"{found.loaded.robot.name}: elastic model identified by robid {__version__}",
            f"experiment {found.loaded.experiment.name}, fit {found.name} of {found.date}, {estimate.status}",
            "",
            f"Units: m, kg, s, rad; torque in {unit}. Controls are motor torques, motor side.",
            *([] if unit == "N m" else [f"{unit} stands for N m: inertias, springs and dampers are ratios to K_t."]),
            "q_m_<joint> motor angle (motor side), q_a_<joint> arm position, q_e_<spring> elastic angle (arm side);",
            "tendons are transmissions: arm motion of the motors less q_a.",
            "A rigid joint has no q_m: its motor drives q_a.",
            "Friction and ripple, where there are any: passive actuators friction_<joint>."
            if friction
            else "Friction and ripple are left out; viscous friction is damping of q_m and q_a.",
            *_frozen(found.robot, names[0]),
            *_of_gears(found),
            f"Not in here: the delay of {1e3 * found.delay_s:.4g} ms from commanded to applied torque.",
            f"Not identified, do not rely on: {', '.join(weak)}"
            if weak
            else "All parameters are identified or known beforehand.",
            f"Keyframes, at rest under gravity with the holding torques; arm-side positions in {sides}:",
            *(f"  {name}: {row}" for name, row in zip(names, shown, strict=True)),
        ]
    )


def _of_gears(found: FittedExport) -> list[str]:
    """What to know of load-dependent damping and hysteresis."""
    told = []
    if found.grown:
        gears = ", ".join(found.grown)
        told.append(
            f"Dampers of {gears} grow with the load; here they are as on average over the fit's configurations."
        )
    if found.bristles:
        told.append("Hysteresis: passive actuators hysteresis_<joint>, as found at the swing of the fit's campaign.")
    return told


def _frozen(robot: Robot, keyframe: str) -> list[str]:
    """What to know of stiffness that depends on a joint's position."""
    varying = [spring.name for spring in robot.springs if spring.stiffness_over is not None]
    if not varying:
        return []
    told = f"Stiffness of {', '.join(varying)} depends on a joint's position; here it is that of {keyframe} everywhere,"
    return [told, "so that other keyframes are not quite at rest under load."]


_ENCODERS: Mapping[str, Callable[[Content], bytes]] = {".mat": encode_mat, ".json": encode_json, ".npz": encode_npz}


def _found(task: ExportTask) -> FittedExport:
    date, solution = task.model.provenance.finished_utc, solution_from_artifact(task.model)
    data = task.data
    return FittedExport(data.loaded, data.name, nominal_robot(data), date, solution, data.response, data.configurations)


def _rows(task: ExportTask) -> list[int]:
    chosen = task.data.configurations
    if task.configuration is None:
        return list(range(len(chosen)))
    if task.configuration not in chosen:
        listed = ", ".join(str(one + 1) for one in chosen)
        message = f"S060 fit `{task.data.name}` has no configuration {task.configuration + 1} (it has {listed})"
        raise SettingsError(message, where="--configuration", remedy="name one of them, or none for all")
    return [chosen.index(task.configuration)]


def write_mjcf(task: ExportTask) -> bytes:
    """Writes the elastic robot as MJCF."""
    return mjcf(_found(task), _rows(task), friction=task.friction is not False).encode()


def write_json(task: ExportTask) -> bytes:
    """Writes the parameters as JSON."""
    found = _found(task)
    content = {**found.origin, "confidence": found.solution.estimate.confidence, "parameters": parameter_records(found)}
    return encode_json(content)


def write_csv(task: ExportTask) -> bytes:
    """Writes the parameters as a table."""
    return encode_csv(_COLUMNS, [list(record.values()) for record in parameter_records(_found(task))])


def write_mat(task: ExportTask) -> bytes:
    """Writes parameters and responses for MATLAB."""
    return encode_mat(arrays(_found(task), _rows(task)))


def write_state_space(task: ExportTask) -> bytes:
    """Writes the linearised models."""
    return _ENCODERS[task.suffix](state_spaces(_found(task), _rows(task)))
