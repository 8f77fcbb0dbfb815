"""How rigid models lie in their files, and what they are written as: parameters, and robots for other programs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.models.encode import (
    Content,
    Files,
    encode_csv,
    encode_json,
    encode_mat,
    origin_of,
    parameter_arrays,
    parameter_records,
)
from robid.models.family import ExportTask
from robid.models.handed_on import standard_from_artifact, standard_robot
from robid.models.rigid.fit.gains import describe_gains
from robid.models.rigid.fit.solution import Gains, RigidSolution
from robid.models.rigid.judge.validating import RigidValidation
from robid.robot.export import to_rigid_mjcf, to_urdf
from robid.robot.standard import StandardRobot
from robid.settings.robot_values import robot_text, with_values
from robid.versions import __version__

FILES = Files("rigid", RigidSolution, RigidValidation)
model_of, solution_from_artifact = FILES.model_of, FILES.solution_of
validation_of, validation_from_artifact = FILES.validation_of, FILES.validated_in

_FAR = 1.0  # deviations


def robot_file(task: ExportTask) -> bytes:
    """Writes the robot file with what the fit found in place of its values."""
    found = _found(task)
    # A robot file states Coulomb friction of motors alone.
    dry = (one.name for one in found.robot.joints if not one.has_motor and one.motor.friction.coulomb_nm > 0)
    found = replace(found, homeless=(*found.homeless, *(f"{name}.coulomb" for name in dry)))
    return robot_text(with_values(task.data.loaded.robot, found.robot), "\n".join(_header(task, found))).encode()


def urdf(task: ExportTask) -> bytes:
    """Writes frames, links and limits as URDF."""
    found = _found(task)
    gravity = np.array2string(found.robot.gravity_m_s2, separator=", ")
    own = [
        "Units: m, kg, s, rad, N m; joint positions, damping and friction are the arm's.",
        "The payload is in the last link. Not in here: rotor inertias, couplings of motors, counterbalances, offsets.",
        f"Gravity in the frame of the base link [m/s^2]: {gravity}",
    ]
    return to_urdf(found.robot, "\n".join([*_header(task, found), *own])).encode()


def mjcf(task: ExportTask) -> bytes:
    """Writes the rigid robot with its motors as MJCF."""
    found, friction = _found(task), task.friction is not False
    sensed = ", ".join(joint.name for joint in found.robot.joints if not joint.has_motor)
    own = [
        "Units: m, kg, s, rad, N m; joint positions are the arm's, controls are motor torques, motor side.",
        *([f"Controls of joints without a motor are torques or forces at the joint: {sensed}"] if sensed else []),
        "The payload is in the last link; rotor inertias and friction are the joints', of coupled motors tendons'.",
        "Coulomb friction is `frictionloss`." if friction else "Friction is left out.",
    ]
    return to_rigid_mjcf(found.robot, "\n".join([*_header(task, found), *own]), friction=friction).encode()


def _found(task: ExportTask) -> StandardRobot:
    standard = standard_from_artifact(task.model, task.data.name)
    return standard_robot(task.data.loaded, task.data.name, standard)


def _header(task: ExportTask, found: StandardRobot) -> list[str]:
    loaded, solution = task.data.loaded, solution_from_artifact(task.model)
    lines = [
        f"{loaded.robot.name}: rigid model identified by robid {__version__}",
        f"experiment {loaded.experiment.name}, fit {task.data.name} of {task.model.provenance.finished_utc},"
        f" {solution.estimate.status}",
        "Torques determine combinations of masses and inertias alone: these are the real bodies nearest to the robot"
        " file's that have them.",
    ]
    if solution.gains is not None:
        told = describe_gains(solution.gains, _joints(task), solution.estimate.confidence)
        lines.append(f"Recorded {told}.")
    moved = np.zeros(0) if solution.standard is None else np.abs(solution.standard.moved)
    if moved.max(initial=0.0) >= _FAR:
        name, far = solution.estimate.names[int(np.argmax(moved))], f"{moved.max():.2g} deviations"
        lines.append(f"No real bodies have the estimated ones exactly: {name} is off by {far}.")
    if found.payload_is_in_link:
        lines.append("The payload is in the last link: without it no real body would be left.")
    if found.averaged:
        lines.append(f"Friction is the mean of both directions: {', '.join(found.averaged)}")
    if found.homeless:
        lines.append(f"Estimated, but without a place here: {', '.join(found.homeless)}")
    return lines


def _joints(task: ExportTask) -> list[str]:
    return [joint.name for joint in task.data.loaded.robot.joints]


_COLUMNS = ("name", "kind", "unit", "nominal", "estimate", "lower", "upper", "relative_std", "identifiable")


def _records(solution: RigidSolution) -> list[dict[str, object]]:
    rows = zip(parameter_records(solution.estimate, _COLUMNS), solution.base.labels, strict=True)
    return [{**row, "combination": label} for row, label in rows]


def write_json(task: ExportTask) -> bytes:
    """Writes the parameters as JSON."""
    solution = solution_from_artifact(task.model)
    found, standard = solution.standard, {}
    if found is not None:
        rows = zip(found.names, found.nominal.tolist(), found.value.tolist(), strict=True)
        standard = {name: {"nominal": nominal, "value": value} for name, nominal, value in rows}
    content: Content = {**origin_of(task, solution.estimate.status), "confidence": solution.estimate.confidence}
    gains = {} if solution.gains is None else {"gains": _gain_records(solution.gains, task)}
    return encode_json({**content, "parameters": _records(solution), "standard": standard, **gains})


def _gain_records(gains: Gains, task: ExportTask) -> dict[str, dict[str, object]]:
    columns = zip(gains.gain.tolist(), gains.deviation.tolist(), gains.determined.tolist(), strict=True)
    rows = [{"gain": gain, "std": std, "determined": told} for gain, std, told in columns]
    return dict(zip(_joints(task), rows, strict=True))


def write_csv(task: ExportTask) -> bytes:
    """Writes the parameters as a table."""
    rows = _records(solution_from_artifact(task.model))
    return encode_csv((*_COLUMNS, "combination"), [list(row.values()) for row in rows])


def write_mat(task: ExportTask) -> bytes:
    """Writes parameters and covariance for MATLAB."""
    solution = solution_from_artifact(task.model)
    found, standard = solution.estimate, solution.standard
    content: Content = {
        **origin_of(task, solution.estimate.status),
        **parameter_arrays(found),
        "labels": solution.base.labels,
        "nominal": found.nominal,
        "standard_names": solution.base.standard,
        "combination": solution.base.combination,
    }
    if solution.gains is not None:
        content |= {"gain": solution.gains.gain, "gain_covariance": solution.gains.covariance}
    if standard is not None:
        content |= {"standard": standard.value, "standard_covariance": standard.covariance}
    return encode_mat(content)
