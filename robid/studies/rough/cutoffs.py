"""What the automatic cut-off loses against the best constant one, on real recordings and on arms with noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robid.arrays import FloatArray
from robid.artifacts.artifact import Dataset
from robid.artifacts.kinds import RECORD, record_from_artifact
from robid.artifacts.store import read_artifact, read_header
from robid.design.excitation.options import TrajectoryOptions
from robid.errors import DataError
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import RigidFitOptions
from robid.models.rigid.fit.shots import Shot, shots_of
from robid.models.rigid.fit.solution import RigidSolution
from robid.models.rigid.fitting import true_base_values
from robid.models.rigid.settings import loaded_campaign, model_settings, rigid_fit
from robid.pipeline.graph import Run
from robid.robot.description import Robot
from robid.settings.robot_parts import plain_settings
from robid.studies.experiments import Further, missing_log, run_of
from robid.studies.rough.fits import OPTIONS, motor_errors
from robid.studies.rough.individuals import Kind, kinds, rig_of
from robid.studies.rough.motions import log, random_motions, shortened
from robid.studies.rough.robots import drawn_robot, rated_torque_nm, rough_file
from robid.studies.settings.parts import RecordedCase
from robid.studies.settings.rough import CutOffNoise, RoughStudy
from robid.studies.study import Content, Earlier, Task, study_of

_MOTIONS = 4  # of a simulated arm: half of them are fitted, half are held out, both ways


@dataclass(frozen=True)
class Simulated:
    """An arm that is simulated with a level of noise."""

    kind: Kind
    noise: CutOffNoise
    seed: int
    study: RoughStudy


@dataclass(frozen=True)
class Recorded:
    """A real recording."""

    robot: Robot
    shots: tuple[Shot, ...]
    options: RigidFitOptions
    study: RoughStudy


@dataclass(frozen=True)
class Halves:
    """Data in two halves, of which one is fitted while the other is held out."""

    robot: Robot
    options: RigidFitOptions
    shots: tuple[Sequence[Shot], Sequence[Shot]]
    rated_nm: FloatArray  # (n_joint,) rated torques, 0 where none is known [N m]
    truth: Mapping[str, float]  # true base parameters by name; none of a real robot


def recordings(run: Run) -> tuple[dict[str, Run], tuple[str, ...]]:
    """Returns the runs of the real recordings by name, and why others are left out."""
    found, lacking = {}, []
    for name, case in _cases(run).items():
        own = run_of(run, case.experiment, name)
        if missing := missing_log(own):
            lacking.append(f"The cut-off of `{name}` is left out: there is no {missing}; set ROBID_DATA.")
        else:
            found[name] = own
    return found, tuple(lacking)


def _cases(run: Run) -> Mapping[str, RecordedCase]:
    cutoffs = study_of(run.loaded, RoughStudy).cutoffs
    return {} if cutoffs is None else cutoffs.logs


def further(run: Run) -> Further:
    """Returns the experiments of the real recordings, with their records."""
    cases = _cases(run)
    return tuple((own, (_record(own, cases[name].fit),)) for name, own in recordings(run)[0].items())


def _record(own: Run, fit: str) -> str:
    return f"{own.loaded.experiment.fits[fit].campaign}/record.h5"


def cut_off_tasks(run: Run, _earlier: Earlier) -> list[Task]:
    """Returns one task for each arm with each level of noise, and one for each real recording."""
    study = study_of(run.loaded, RoughStudy)
    if study.cutoffs is None:
        return []
    shared = {name: plain_settings(getattr(study, name)) for name in ("drawn", "file", "logs", "period_s", "harmonics")}
    grid = {"cut_hz": list(study.cutoffs.cut_hz), "band_hz": study.band_hz}
    tasks = []
    for kind, decides in zip(*kinds(run), strict=True):
        for name, noise in study.cutoffs.noises.items():
            decided = {**shared, **grid, **decides, "noise": plain_settings(noise), "rated": study.rated_share}
            one = Simulated(kind, noise, study.chosen.first, study)
            tasks.append(Task(f"{kind.name}_{name}", {**decided, "seed": one.seed}, (one,)))
    for name, own in recordings(run)[0].items():
        recorded, decided = _recorded(own, _cases(run)[name], study)
        tasks.append(Task(name, {**grid, **decided}, (recorded,)))
    return tasks


def _recorded(own: Run, case: RecordedCase, study: RoughStudy) -> tuple[Recorded, dict[str, Any]]:
    path, campaign = own.path(_record(own, case.fit)), own.loaded.experiment.fits[case.fit].campaign
    options = rigid_fit(own.loaded.experiment, case.fit).options()
    robot = own.loaded.robot.to_robot(loaded_campaign(own.loaded, case.fit).payload_kg)
    shots = shots_of(record_from_artifact(read_artifact(path, RECORD)), robot)
    decided = {"record": read_header(path).content_sha256, "options": plain_settings(options)}
    return Recorded(robot, shots, options, study), {**decided, **model_settings(own.loaded, campaign)}


def compare(one: Simulated | Recorded) -> Content:
    """Fits each half of some data with the automatic cut-off and with constant ones, and measures the other half."""
    halves = _simulated(one) if isinstance(one, Simulated) else _halved(one)
    study = one.study
    cuts = () if study.cutoffs is None else study.cutoffs.cut_hz
    rows = [_held_out(halves, cut, study.band_hz) for cut in (None, *cuts)]
    chosen, error, parameters = (np.array([row[index] for row in rows]) for index in range(3))
    axes = ("trial", "fold")
    return Content(
        {
            "cut": Dataset(chosen, "Hz", axes, "Cut-offs, the automatic one first"),
            "error": Dataset(error, "1", axes, "Held-out error of all motors; infinite where there is no fit"),
            "parameters": Dataset(parameters, "1", axes, "Median relative error of base parameters, where known"),
        }
    )


def _simulated(one: Simulated) -> Halves:
    """An arm that moves richly, every second motion in the other half."""
    kind, study = one.kind, one.study
    true = drawn_robot(kind.robot, kind.arm, study.drawn, one.seed, balanced=False)
    file, rated = rough_file(true, study.file, one.seed), rated_torque_nm(true, study.rated_share)
    noise = one.noise.torque_noise * rated
    rig = rig_of(kind, true, one.noise.encoder_counts, noise, study.logs.resolver_error_rad)
    options = TrajectoryOptions(period_s=study.period_s, harmonics=study.harmonics)
    sizes = np.ones((_MOTIONS, len(true.joints)))
    # The same motions at every level of noise.
    speed = random_motions(rig, options, sizes, np.random.default_rng([one.seed, _MOTIONS]))
    shots, _ = log(rig, speed, one.seed, study.harmonics)
    truth = true_base_values(file, true, OPTIONS)
    return Halves(file, OPTIONS, (shots[::2], shots[1::2]), rated, truth)


def _halved(one: Recorded) -> Halves:
    """A recording, each shot cut in its middle."""
    lasts = [0.5 * len(shot.position) * shot.sampling_period_s for shot in one.shots]
    halves = [
        [shortened(shot, half, first * half) for shot, half in zip(one.shots, lasts, strict=True)] for first in (0, 1)
    ]
    nothing = np.zeros(len(one.robot.joints))
    options = replace(one.options, instruments="none", physical=False, sweep=())
    return Halves(one.robot, options, (halves[0], halves[1]), nothing, {})


def _held_out(halves: Halves, cut_hz: float | None, band_hz: float) -> tuple[list[float], list[float], list[float]]:
    """Cut-off, held-out error and error of the parameters with each half fitted; the automatic cut-off when None."""
    filters = replace(halves.options.filters, position_cut_hz=cut_hz, decimation=0)
    options, rows = replace(halves.options, filters=filters), []
    for fitted, held in (halves.shots, halves.shots[::-1]):
        try:
            solution = fit_rigid(halves.robot, fitted, options)
        except DataError:
            rows.append((np.nan if cut_hz is None else cut_hz, np.inf, np.nan))
            continue
        errors = motor_errors(halves.robot, solution, held, halves.rated_nm, band_hz, options.model)
        rms = float(np.sqrt(np.mean(errors**2)))
        rows.append((solution.filtered.cut_hz, rms, parameter_error(solution, halves.truth)))
    chosen, error, parameters = zip(*rows, strict=True)
    return list(chosen), list(error), list(parameters)


def parameter_error(solution: RigidSolution, truth: Mapping[str, float]) -> float:
    """Returns the median error of base parameters over their true values, NaN where none is known."""
    known = [name for name in solution.estimate.names if truth.get(name)]
    found = solution.estimate.found
    return float(np.median([abs(found[name] / truth[name] - 1) for name in known])) if known else np.nan
