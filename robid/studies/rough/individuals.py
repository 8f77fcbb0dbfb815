"""The robots of the study: each is drawn and logged once, fitted twice, and held against new motions."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact, Dataset
from robid.design.excitation.options import TrajectoryOptions
from robid.errors import SettingsError
from robid.models.rigid.fit.shots import Shot
from robid.pipeline.graph import Run
from robid.robot.description import Robot
from robid.settings.load import LoadedExperiment, load_robot
from robid.settings.robot_parts import plain_settings, require_controller
from robid.simulate.options import Controller, Imperfections
from robid.studies.experiments import unknown
from robid.studies.rough.fits import Judge, Said, judged
from robid.studies.rough.motions import Rig, log, random_motions, shortened
from robid.studies.rough.robots import between, drawn_robot, rated_torque_nm, rough_file, with_rated
from robid.studies.settings.rough import MotionSpread, RoughArm, RoughStudy
from robid.studies.study import Content, Earlier, Task, study_of

FITS = ("validated", "one_motion")
"""The two fits of each robot: to several motions and validated on another, and to one that nothing validates."""

GOOD, BAD = 0.1, 0.3
"""Errors up to which all motors of a good fit are, and beyond which one of a bad fit is."""


@dataclass(frozen=True)
class Kind:
    """A kind of arm."""

    name: str
    arm: RoughArm
    robot: Robot  # as its file describes it
    controller: Controller


@dataclass(frozen=True)
class Individual:
    """One robot of a kind."""

    kind: Kind
    seed: int
    balanced: bool  # whether it has a counterbalance
    study: RoughStudy


def kinds(run: Run) -> tuple[list[Kind], list[dict[str, Any]]]:
    """Returns the kinds of arms, and what decides each, as values that JSON knows."""
    found, decides = [], []
    for name, arm in study_of(run.loaded, RoughStudy).arms.items():
        stated = load_robot(run.loaded.path.parent / arm.robot)
        found.append(_kind(name, arm, replace(run.loaded, robot=stated)))
        decides.append({"arm": plain_settings(arm), "robot": plain_settings(stated)})
    return found, decides


def _kind(name: str, arm: RoughArm, loaded: LoadedExperiment) -> Kind:
    """A kind by its robot file, which is read in the place of the study's own.

    Raises:
        SettingsError: If the file does not have what the arm names.
    """
    controller, robot = require_controller(loaded), loaded.robot.to_robot()
    names = [joint.name for joint in robot.joints]
    problem = unknown("joint", arm.balanced, names)
    if len(arm.home_deg) != len(names):
        problem = f"`home_deg` has {len(arm.home_deg)} angles for {len(names)} joints"
    if problem:
        message = f"S434 study.arms.{name}: {problem}"
        raise SettingsError(message, where=arm.robot, remedy="correct the study, or name another robot file")
    return Kind(name, arm, robot, controller)


def individual_tasks(run: Run, earlier: Earlier) -> list[Task]:
    """Returns one task for each robot of a round; none of a later one where enough fits are good, and enough bad."""
    study, (known, decides) = study_of(run.loaded, RoughStudy), kinds(run)
    made = sum(map(len, earlier))
    if made and enough(study, populations(one for results in earlier for one in results)):
        return []
    parts = ("drawn", "file", "logs", "validated", "one_motion", "new_motions", "period_s", "harmonics", "rated_share")
    shared = {name: plain_settings(getattr(study, name)) for name in (*parts, "band_hz")}
    tasks = []
    for number in range(made, made + (study.further if earlier else study.count)):
        turn, seed = number % len(known), study.chosen.first + number
        balanced = number // len(known) % study.drawn.balanced_each == 0
        one = Individual(known[turn], seed, balanced, study)
        decided = {**shared, **decides[turn], "seed": seed, "balanced": balanced}
        tasks.append(Task(f"{one.kind.name}_{seed}", decided, (one,)))
    return tasks


def populations(results: Iterable[Artifact]) -> dict[str, float]:
    """Returns how many fits of each kind are good, and how many are bad, as `<kind>.good` and `<kind>.bad`."""
    errors = np.array([worst_errors(held.datasets["error"].values) for held in results])
    counts = {}
    for column, name in enumerate(FITS):
        counts[f"{name}.good"] = float(np.sum(errors[:, column] <= GOOD))
        counts[f"{name}.bad"] = float(np.sum(errors[:, column] > BAD))
    return counts


def worst_errors(error: FloatArray) -> FloatArray:
    """Returns the largest error (n_fit,) of the motors (n_fit, n_joint); NaN where there is no fit."""
    return np.asarray(error.max(axis=1))


def enough(study: RoughStudy, counts: Mapping[str, float]) -> bool:
    """Whether there are as many good and bad fits of each kind as are wanted."""
    wanted = {"good": study.good, "bad": study.bad}
    return all(counts[f"{name}.{which}"] >= least for name in FITS for which, least in wanted.items())


_MOTIONS, _LOG = 11, 12  # keep these draws apart from those of the robot


def identify(one: Individual) -> Content:
    """Draws a robot, logs its motions, fits them by its rough file, and measures the fits on new motions."""
    study, kind = one.study, one.kind
    true = drawn_robot(kind.robot, kind.arm, study.drawn, one.seed, balanced=one.balanced)
    rated = rated_torque_nm(true, study.rated_share)
    file = with_rated(rough_file(true, study.file, one.seed), rated)
    generator = np.random.default_rng([one.seed, _MOTIONS])
    several, single = (drawn_sizes(own, len(true.joints), generator) for own in (study.validated, study.one_motion))
    # To fit, to validate on, the one alone, then the new ones: all motions are simulated at once.
    rich = np.ones((1 + study.new_motions, len(true.joints)))
    sizes = np.concatenate([several, rich[:1], single, rich[1:]])
    options = TrajectoryOptions(period_s=study.period_s, harmonics=study.harmonics)
    rig = _rig(one, true, rated)
    shots, channels = log(rig, random_motions(rig, options, sizes, generator), one.seed, study.harmonics)
    count = len(several)
    fitted = [_part(shot, study.validated, generator) for shot in shots[:count]]
    alone = [_part(shot, study.one_motion, generator) for shot in shots[count + 1 : count + 1 + len(single)]]
    judge = Judge(file, rated, channels, shots[count + 1 + len(single) :], study.band_hz)
    said = (judged(judge, fitted, shots[count : count + 1]), judged(judge, alone))
    return _content(one, said, (several, single))


def drawn_sizes(motions: MotionSpread, n_joint: int, generator: np.random.Generator) -> FloatArray:
    """Draws how many motions there are, and how large each joint's are (n_motion, n_joint), 1 where they are rich."""
    count = int(generator.integers(motions.count[0], motions.count[1], endpoint=True))
    poor = np.array([between(motions.poor_size, generator) for _ in range(n_joint)])
    return np.tile(poor if generator.uniform() < motions.poor_share else np.ones(n_joint), (count, 1))


def _part(shot: Shot, motions: MotionSpread, generator: np.random.Generator) -> Shot:
    return shortened(shot, float(generator.uniform(*motions.duration_s)))


def _rig(one: Individual, true: Robot, rated: FloatArray) -> Rig:
    logs, generator = one.study.logs, np.random.default_rng([one.seed, _LOG])
    counts = between(logs.encoder_counts, generator)
    noise = rated * [between(logs.torque_noise, generator) for _ in rated]
    return rig_of(one.kind, true, counts, noise, logs.resolver_error_rad)


def rig_of(kind: Kind, true: Robot, counts: float, torque_noise_nm: FloatArray, resolver_error_rad: float) -> Rig:
    """Returns a robot with its controller and the noise of its log.

    Args:
        kind: What it is.
        true: The robot that moves.
        counts: Counts of a turn of a motor's encoder.
        torque_noise_nm (n_joint,): Deviation of the recorded torques' noise [N m].
        resolver_error_rad: Amplitude of the resolvers' error [rad].
    """
    step = 2 * np.pi / counts
    flaws = Imperfections(
        encoder_resolution_rad=step, resolver_error_rad=resolver_error_rad, ripple=True, friction="lugre"
    )
    return Rig(true, kind.controller, np.radians(kind.arm.home_deg), flaws, torque_noise_nm)


def _content(one: Individual, said: tuple[Said, ...], sizes: tuple[FloatArray, ...]) -> Content:
    motor, fit = partial(Dataset, units="1", axes=("fit", "joint")), partial(Dataset, axes=("fit",))
    datasets = {
        "error": motor(np.array([each.error for each in said]), description="True error on new motions"),
        "bound": motor(np.array([each.bound for each in said]), description="Its 95 % bound as stated"),
        "size": motor(np.array([each[0] for each in sizes]), description="Size of the joints' motions"),
        "grade": fit(np.array([each.grade for each in said]), "1", description="Grade"),
        "cut": fit(np.array([each.cut_hz for each in said]), "Hz", description="Cut-off of the positions"),
        "condition": fit(np.array([each.condition for each in said]), "1", description="Condition number"),
        "sentence": fit(np.array([each.sentence for each in said]), "1", description="The grade in words"),
    }
    return Content(datasets, {"arm": one.kind.name, "seed": one.seed, "balanced": one.balanced})
