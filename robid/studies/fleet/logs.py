"""The robots of the fleet, what is wrong with some of them, and their logs as a controller would write them."""

from __future__ import annotations

import csv
import hashlib
import io
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from robid.arrays import FloatArray
from robid.artifacts.artifact import Artifact, Dataset
from robid.artifacts.atomic import replacing
from robid.artifacts.kinds import EXCITATION
from robid.artifacts.store import read_header
from robid.errors import SettingsError, require_module
from robid.fleet.table import require_table
from robid.pipeline.graph import Run
from robid.pipeline.simulate_or_acquire import simulated_experiment
from robid.robot.description import Robot
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.sources import true_robot_of
from robid.signals.record import Record
from robid.simulate.experiment import SimulatedExperiment, simulate, with_settled_steps
from robid.simulate.options import SimulateOptions
from robid.studies.experiments import changed_simulation
from robid.studies.page import PartFound
from robid.studies.settings.study import KINDS, FleetStudy
from robid.studies.simulated import played, simulate_options, simulation_settings, threads_of
from robid.studies.study import TASKS, Content, Part, Results, Task, study_of

_WHERE = (0.1, 0.6)
"""Shares of the log between which faults lie: in its periods that are used, not in those that follow them."""

_VARIANTS = {"sign": ("torque", "angle"), "dead": ("constant", "noise"), "file": ("truncated", "overwritten")}


@dataclass(frozen=True)
class Fault:
    """What is wrong with a robot or its log."""

    kind: str
    variant: str  # Which of its forms, of the kinds that have several
    joint: int  # Index of the joint
    channel: str  # `torque` or `angle` of that joint
    at: float  # Where in its file or its samples, as a share
    samples: int  # How many are lost
    seed: int  # Seed of noise


@dataclass(frozen=True)
class FleetRobot:
    """A robot of the fleet."""

    name: str  # Its row in the manifest
    seed: int  # Seed of its springs, its friction and its noise
    fault: Fault | None  # What is wrong; None of a sound one

    @property
    def log(self) -> str:
        """Its log, from the run folder on."""
        return f"logs/{self.name}.mat"

    @property
    def kind(self) -> str:
        """Kind of its fault; empty of a sound one."""
        return "" if self.fault is None else self.fault.kind


def fleet_robots(run: Run) -> tuple[FleetRobot, ...]:
    """Returns the robots, in the order of the manifest."""
    return plan_robots(study_of(run.loaded, FleetStudy), len(run.loaded.robot.joints))


def plan_robots(study: FleetStudy, n_joint: int) -> tuple[FleetRobot, ...]:
    """Draws which robots have a fault, and what."""
    generator, width = np.random.default_rng(study.faults.seed), max(len(str(study.robots)), 4)
    chosen = generator.permutation(study.robots)[: len(KINDS) * study.faults.each]
    faults = {int(index): _fault(study, n_joint, number, generator) for number, index in enumerate(chosen)}
    named = ((f"r{index + 1:0{width}d}", study.first_seed + index, index) for index in range(study.robots))
    return tuple(FleetRobot(name, seed, faults.get(index)) for name, seed, index in named)


def _fault(study: FleetStudy, n_joint: int, number: int, generator: np.random.Generator) -> Fault:
    """One of each kind after the other; the forms of a kind take turns."""
    kind, turn = KINDS[number % len(KINDS)], number // len(KINDS)
    variants = _VARIANTS.get(kind, ("",))
    variant = variants[turn % len(variants)]
    joint, fewest_most = int(generator.integers(n_joint)), study.faults.lost_samples
    channel = variant if kind == "sign" else str(generator.choice(["torque", "angle"]))
    at, samples = float(generator.uniform(*_WHERE)), int(generator.integers(*fewest_most, endpoint=True))
    return Fault(kind, variant, joint, channel, at, samples, int(generator.integers(2**31)))


def template_path(run: Run) -> Path:
    """Returns the experiment file that reads the logs."""
    return run.loaded.path.parent / study_of(run.loaded, FleetStudy).experiment


Log: TypeAlias = dict[str, dict[str, NDArray[np.int32]]]
"""Samples (n_sample,) of each channel, as `torque_<joint>`, of each experiment of a log."""

_NOISE = 2.0
_OVERWRITTEN = 512


def faulty_log(log: Log, fault: Fault, joints: Sequence[str]) -> Log:
    """Returns a log as a fault in its signals leaves it."""
    channel = f"{fault.channel}_{joints[fault.joint]}"
    if fault.kind == "sign":
        return {name: {**one, channel: -one[channel]} for name, one in log.items()}
    if fault.kind == "dead":
        # The channel stays at its first number, or shows a few counts of noise around it.
        generator, spread = np.random.default_rng(fault.seed), _NOISE if fault.variant == "noise" else 0.0
        first, dead = next(iter(log.values()))[channel][0], dict[str, NDArray[np.int32]]()
        for name, one in log.items():
            noise = spread * generator.normal(size=one[channel].shape)
            dead[name] = np.asarray(first + np.rint(noise), dtype=np.int32)
        return {name: {**one, channel: dead[name]} for name, one in log.items()}
    if fault.kind == "gap":
        # All channels of one experiment lack the same samples.
        name = list(log)[fault.seed % len(log)]
        at = int(fault.at * (len(next(iter(log[name].values()))) - fault.samples))
        lost = slice(at, at + fault.samples)
        return {**log, name: {each: np.delete(values, lost) for each, values in log[name].items()}}
    return log


def faulty_bytes(content: bytes, fault: Fault) -> bytes:
    """Returns a file as a fault leaves it: cut off, or a part of it overwritten; other kinds leave it as it is."""
    at = int(fault.at * len(content))
    if fault.kind != "file":
        return content
    if fault.variant == "truncated":
        return content[:at]
    part = content[at : at + _OVERWRITTEN]
    return content[:at] + bytes(255 - byte for byte in part) + content[at + len(part) :]


def require_packages(loaded: LoadedExperiment) -> None:
    """Refuses to start without the packages that tables and Dask need."""
    require_table()
    study = study_of(loaded, FleetStudy)
    if study.speed is not None or study.scheduled:
        require_module("distributed", "dask", "What the study measures of Dask")


NAME = "logs"
COUNTS_PER_TURN = 65536
_VERSION = 1
_HEADER = b"MATLAB 5.0 MAT-file, logged by a simulated controller".ljust(116)


@dataclass(frozen=True)
class Logged:
    """A robot to be logged."""

    of: FleetRobot
    robot: Robot
    options: SimulateOptions
    path: Path


def manifest_path(run: Run) -> Path:
    """Returns where the manifest of all robots lies."""
    return run.path("manifest.csv")


def _excitation(run: Run) -> str:
    return f"{study_of(run.loaded, FleetStudy).campaign}/excitation.h5"


def log_tasks(run: Run, study: FleetStudy, _earlier: Mapping[str, Results]) -> list[Task]:
    """Returns the tasks: some robots each; one whose logs are not all there is to be done again.

    Raises:
        SettingsError: If the study is to run on Dask, whose workers may not start the processes that it watches.
    """
    if run.backend == "dask":
        remedy = "use --backend processes; the study starts Dask itself where it times it"
        raise SettingsError("S342 the study of fleets measures this machine, and runs on no cluster", remedy=remedy)
    path = run.path(_excitation(run))
    campaign = run.loaded.experiment.campaigns[study.campaign]
    content = played(run, study.campaign)
    whole = simulated_experiment(run.loaded, campaign, simulate_options(campaign), content)
    experiment, _ = with_settled_steps(whole, content.configurations)
    decides = {
        "version": _VERSION,
        "excitation": read_header(path, EXCITATION).content_sha256,
        **simulation_settings(run.loaded, campaign),
        "stiffness_factor": study.faults.stiffness_factor,
        "payload_kg_more": study.faults.payload_kg,
    }
    robots, threads = fleet_robots(run), threads_of(run)
    tasks = []
    for first in range(0, len(robots), study.robots_per_task):
        some = robots[first : first + study.robots_per_task]
        logged = tuple(_logged(run, campaign, experiment, robot) for robot in some)
        arguments = experiment, content.configurations, logged, threads
        task = Task(some[0].name, {**decides, "robots": [asdict(robot) for robot in some]}, arguments)
        if not all(one.path.exists() for one in logged):
            task.path(run.path(f"{TASKS}/{NAME}")).unlink(missing_ok=True)
        tasks.append(task)
    return tasks


def _logged(run: Run, campaign: Campaign, experiment: SimulatedExperiment, of: FleetRobot) -> Logged:
    """A robot as it truly is: a softened spring and another payload are true, what is wrong in a log is not."""
    faults, file = study_of(run.loaded, FleetStudy).faults, run.loaded.robot
    settings = changed_simulation(campaign, {}, of.seed, of.seed)
    mounted = stated_payload(run) + faults.payload_kg if of.kind == "payload" else campaign.payload_kg
    robot = true_robot_of(file, mounted, settings.truth)
    if of.fault is not None and of.kind == "spring":
        robot = softened(robot, of.fault.joint, faults.stiffness_factor)
    options = replace(settings, steps_per_sample=experiment.options.steps_per_sample)
    return Logged(of, robot, options, run.path(of.log))


def softened(robot: Robot, joint: int, factor: float) -> Robot:
    """Returns a robot whose transmission of a joint is softer by a factor."""
    springs = list(robot.springs)
    for at, spring in enumerate(springs):
        if spring.joint == joint and spring.place == "transmission":
            springs[at] = replace(spring, stiffness=factor * spring.stiffness)
    return replace(robot, springs=tuple(springs))


def stated_payload(run: Run) -> float:
    """Returns the payload that the manifest states of all robots [kg]."""
    campaign = run.loaded.experiment.campaigns[study_of(run.loaded, FleetStudy).campaign]
    return run.loaded.robot.to_robot(campaign.payload_kg).payload.mass_kg


def write_logs(
    shared: SimulatedExperiment, configurations: FloatArray, robots: tuple[Logged, ...], threads: int
) -> Content:
    """Simulates robots in configurations (n_conf, n_joint) and writes their logs."""
    hashes = []
    for one in robots:
        experiment = replace(shared, robot=one.robot, options=one.options)
        log: Log = {}
        for index, configuration in enumerate(configurations):
            log |= log_of(simulate(experiment, configuration, index, threads), index)
        joints = [joint.name for joint in one.robot.joints]
        content = log_bytes(log if one.of.fault is None else faulty_log(log, one.of.fault, joints))
        content = content if one.of.fault is None else faulty_bytes(content, one.of.fault)
        with replacing(one.path, alone=False) as partial:
            partial.write_bytes(content)
        hashes.append(hashlib.sha256(content).hexdigest())
    return Content({"sha256": Dataset(np.array(hashes), "1", ("robot",), "Hash of each log")})


def log_of(record: Record, configuration: int) -> Log:
    """Returns what a controller logs of one configuration: torques in mN m, motor angles in counts."""
    counts = COUNTS_PER_TURN / (2 * np.pi)
    inputs, outputs = 1000 * record.inputs[0], counts * (record.outputs[0] + record.output_offset[0])
    found: Log = {}
    for real, exp in np.ndindex(inputs.shape[:2]):
        each = (one[real, exp].reshape(-1, one.shape[-1]) for one in (inputs, outputs))
        torque, angle = (np.rint(values).astype(np.int32) for values in each)
        columns = {f"torque_{name}": torque[:, at] for at, name in enumerate(record.input_names)}
        columns |= {f"angle_{name}": angle[:, at] for at, name in enumerate(record.output_names)}
        found[f"c{configuration + 1}_r{real + 1}_e{exp + 1}"] = columns
    return found


def log_bytes(log: Log) -> bytes:
    """Returns the MAT file of a log, a structure for each experiment; without the time that it was written at."""
    stream, structures = io.BytesIO(), dict[str, Any]()
    for name, one in log.items():
        structures[name] = {channel: values[:, None] for channel, values in one.items()}
    savemat(stream, structures, do_compression=True)
    return _HEADER + stream.getvalue()[len(_HEADER) :]


def write_manifest(path: Path, robots: Sequence[FleetRobot], payload_kg: float) -> None:
    """Writes the manifest of some robots, whose logs lie below its folder."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("id", "log", "payload_kg"))
    writer.writerows((robot.name, robot.log, f"{payload_kg:g}") for robot in robots)
    with replacing(path) as partial:
        partial.write_text(text.getvalue(), encoding="utf-8")


def hashes_of(results: Iterable[Artifact]) -> list[str]:
    """Returns the hash of each robot's log."""
    return [name for one in results for name in one.datasets["sha256"].values.tolist()]


def _conclude(run: Run, _study: FleetStudy, _results: Results) -> PartFound:
    robots = fleet_robots(run)
    size = sum(run.path(robot.log).stat().st_size for robot in robots if run.path(robot.log).exists())
    return PartFound({"fleet.robots": float(len(robots)), "fleet.log_mb": size / 1e6})


LOGS = Part(NAME, _conclude, log_tasks, write_logs, lambda run, _study: ((run, (_excitation(run),)),), field="")
