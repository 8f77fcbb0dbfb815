"""The files of a robot of which there is a rigid model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from robid.errors import DataError, SettingsError
from robid.later import later
from robid.scaffold.experiment_text import experiment_text
from robid.scaffold.folders import write_folder
from robid.scaffold.log_text import Variant, variants
from robid.scaffold.model_file import self_contained
from robid.scaffold.robot_text import robot_text

if TYPE_CHECKING:
    from robid.logs.inspection.findings import Findings
    from robid.robot.foreign import ForeignModel
    from robid.scaffold.chains import CarriedJoint, Chain
    from robid.scaffold.sizes import Drive

with later(__name__):
    from robid.robot.foreign import read_model
    from robid.scaffold.chains import chain_of, robot_joints
    from robid.scaffold.sizes import drives

_GRAVITY = (9.7, 9.9)


@dataclass(frozen=True)
class Begun:
    """The files of an experiment, and what is to be done with them, in order."""

    files: dict[str, str | bytes]
    steps: list[str]


@dataclass(frozen=True)
class Log:
    """A log, what is in it, and how the experiment file shall name it."""

    file: Path
    found: Findings
    path: Callable[[Path], str]


def begin(name: str, model: Path, load: Callable[[Path], object], log: Log | None = None) -> Begun:
    """Returns the files of an experiment on a robot, simulated where there is no log, by their names.

    Args:
        name: Name of the experiment.
        model: A URDF or MJCF.
        load: Loads an experiment file, and refuses what is wrong with it or its robot.
        log: A log of the robot.

    Raises:
        DataError: If the model cannot be read, or nothing in it moves.
        SettingsError: If it lacks what a robot file cannot add.
    """
    content, read = self_contained(model), read_model(model)
    if not robot_joints(read):
        what = "D283 has no joint that a motor could drive: no hinge and no slide"
        raise DataError(what, where=str(model), remedy="name the robot's own model")
    chain = chain_of(read)
    typical = drives(chain.joints)
    weightless = not _GRAVITY[0] <= sum(value**2 for value in read.gravity) ** 0.5 <= _GRAVITY[1]
    files: dict[str, str | bytes] = {
        f"{name}.yaml": experiment_text(name, typical),
        f"{name}_robot.yaml": robot_text(name, model.name, chain, typical, weightless=weightless),
        model.name: content,
    }
    _check(files, name, load, model)
    steps = _steps(name, read, chain, typical, weightless=weightless)
    if log is None:
        return Begun(files, steps)
    variant = _on_log(files, name, chain, load, log)
    return Begun(files | {f"{name}.yaml": variant.text}, [*variant.steps, *steps])


def _on_log(
    files: dict[str, str | bytes], name: str, chain: Chain, load: Callable[[Path], object], log: Log
) -> Variant:
    """Returns the experiment on a log that says most of those that load."""
    for variant in variants(log.found, name, chain.joints, log.path):
        try:
            _check(files | {f"{name}.yaml": variant.text}, name, load, log.file)
        except SettingsError:
            continue
        return variant
    what = "S558 what drives the robot, what moves, or its times were not found: a person has to complete the mapping"
    remedy = f"`robid inspect {log.file} --propose FILE.yaml` says what was found; leave `--log` out for the robot file"
    raise SettingsError(what, where=str(log.file), remedy=remedy)


def _check(files: dict[str, str | bytes], name: str, load: Callable[[Path], object], where: Path) -> None:
    """Loads the files as a user would, before any of them is written where they belong."""
    with TemporaryDirectory() as made:
        folder = Path(made) / name
        write_folder(folder, files)
        try:
            load(folder / f"{name}.yaml")
        except SettingsError as error:
            told = f"{error}".replace(f"{folder}/", "").partition("\n  remedy:")[0]
            what = f"S556 no robot file can be written for it:\n{told}"
            raise SettingsError(what, where=str(where), remedy="correct the model as it says") from error


def _steps(name: str, model: ForeignModel, chain: Chain, typical: list[Drive], *, weightless: bool) -> list[str]:
    """Says what a user must do by hand, in order of what matters most."""
    robot, listed = f"{name}_robot.yaml", ", ".join
    unlimited = [one.name for one in chain.joints if one.range is None]
    both = zip(chain.joints, typical, strict=True)
    odd = [_limit(joint, drive) for joint, drive in both if drive.torque_left_out is not None]
    steps = [
        f"{robot}: put gear ratios, rotor inertias and the motors' limits of the data sheets into the table of joints:"
        " an error in them goes into springs and dampers",
        f"{robot}: state the payload, and for simulations the controller's sampling period and gains",
        f"{robot}: friction, stiffness and damping are starting values: put better ones where you have them",
    ]
    steps += [f"{robot}: check the limits of {listed(unlimited)}: {model.name} has none"] if unlimited else []
    if odd:
        why = f"the arm with its test load is of another size than the limits of {model.name}"
        steps.append(f"{robot}: check `max_torque_nm` of {listed(odd)}: {why}")
    steps += [f"{robot}: check that {listed(chain.held)} do not move: they are locked"] if chain.held else []
    steps += [f"{robot}: check `gravity_m_s2`: {model.name} has none that can be meant"] if weightless else []
    return [*steps, "take what you have replaced off the lists `assumed`"]


def _limit(joint: CarriedJoint, drive: Drive) -> str:
    """Says by how much a limit was raised or lowered, at the arm."""
    stated, force = drive.torque_left_out or 0.0, "N" if joint.slides else "N m"
    written = (drive.max_torque_nm or 0.0) * drive.ratio
    factors = (written / stated, stated / written) if stated and written else (0.0, 0.0)
    by = f"{max(factors):.2g} times, " if max(factors) else ""
    way = "raised" if written > stated else "lowered"
    return f"{joint.name} ({way} {by}from {stated:.4g} to {written:.4g} {force} at the arm)"
