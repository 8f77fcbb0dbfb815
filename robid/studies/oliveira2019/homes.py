"""The decoupling map of the arm in several homes, beside its linearised loop."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np

from robid.arrays import ComplexArray, FloatArray, Quantity
from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import RECORD, from_datasets, record_from_artifact, to_datasets
from robid.artifacts.store import read_artifact, read_header
from robid.models.external.fit.checks import blocks_of
from robid.models.external.fit.coupling import CouplingMap, Pairs, map_coupling
from robid.models.external.fit.data import commands_of, shots_of
from robid.models.external.fit.etfe import Etfe, estimate_etfe
from robid.models.external.fit.fitting import own_pairs, ports_of
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.solution import Ports
from robid.models.external.settings import external_fit
from robid.pipeline.graph import Run
from robid.robot.description import Robot
from robid.robot.kinematics import ToolArm
from robid.settings.robot_parts import (
    plain_settings,
    require_controller,
    require_pose_interface,
    robot_settings,
    tool_arm,
)
from robid.signals.record import Record
from robid.simulate.options import Controller, PoseInterface
from robid.simulate.pose_response import pose_response
from robid.simulate.truth import true_robot
from robid.studies.settings.parts import CartesianCase
from robid.studies.simulated import simulate_options
from robid.studies.tasks import Content, Results, Task


@dataclass(frozen=True)
class Home:
    """One home of the arm."""

    record: Path
    index: int
    robot: Robot
    arm: ToolArm
    controller: Controller
    interface: PoseInterface
    measured: str
    options: ExternalOptions


_RESPONSE = "frequency output command"


@dataclass(frozen=True)
class Mapped:
    """What was found in one home.

    Attributes:
        map: The decoupling map.
    """

    inputs: Annotated[tuple[str, ...], Quantity("1", "command", "Names of the commands")]
    outputs: Annotated[tuple[str, ...], Quantity("1", "output", "Names of the outputs")]
    map: CouplingMap
    response: Annotated[
        ComplexArray, Quantity("as the channels", _RESPONSE, "The empirical response, from samples to samples")
    ]
    linear: Annotated[ComplexArray, Quantity("as the channels", _RESPONSE, "That of the linearised loop")]
    linear_gain: Annotated[FloatArray, Quantity("1", _RESPONSE, "In resolutions")]


def homes_tasks(run: Run, case: CartesianCase, _earlier: Mapping[str, Results]) -> list[Task]:
    """Returns the tasks: one home each."""
    loaded, path = run.loaded, run.path(f"{case.homes}/record.h5")
    campaign = loaded.experiment.campaigns[case.homes]
    simulated, options = simulate_options(campaign), external_fit(loaded.experiment, case.fit).options()
    nominal = loaded.robot.to_robot(campaign.payload_kg)
    decides = {
        **robot_settings(loaded, "mechanics", "friction", "controller"),
        "record": read_header(path).content_sha256,
        "simulated": plain_settings(simulated),
        "options": plain_settings(options),
    }
    count = record_from_artifact(read_artifact(path, RECORD)).inputs.shape[0]
    return [
        Task(
            f"home_{index + 1}",
            {**decides, "home": index},
            Home(
                record=path,
                index=index,
                robot=true_robot(nominal, simulated.truth),
                arm=tool_arm(loaded.robot, nominal),
                controller=require_controller(loaded),
                interface=require_pose_interface(loaded.robot),
                measured=simulated.measured_pose,
                options=options,
            ),
        )
        for index in range(count)
    ]


def map_home(home: Home) -> Content:
    """Maps one home, and holds the map beside the linearised loop."""
    record = record_from_artifact(read_artifact(home.record, RECORD))
    etfe, pairs, found = map_record(record, home.index, home.options)
    if record.configurations is None:
        message = "a simulated record names its configurations"
        raise RuntimeError(message)
    linear = pose_response(
        home.robot,
        home.arm,
        home.controller,
        home.interface,
        record.configurations[home.index],
        etfe.frequency_hz,
        pairs.inputs,
        home.measured,
    )
    mapped = Mapped(
        inputs=pairs.inputs,
        outputs=pairs.outputs,
        map=found,
        response=etfe.response,
        linear=linear,
        linear_gain=np.abs(linear) * pairs.per_resolution,
    )
    return Content(*to_datasets(mapped))


def map_record(record: Record, index: int, options: ExternalOptions) -> tuple[Etfe, Pairs, CouplingMap]:
    """Maps one configuration of a record of pose commands."""
    told, places = commands_of(record, options), shots_of(record, options, "homes")
    names = list(dict.fromkeys(shot.place for shot in places))
    shots = [shot for shot in places if shot.place == names[index]]
    ports: Ports = ports_of(shots, told.channels, record.output_channels, told.hold, options.coupling)
    own = own_pairs(blocks_of(told.channels, record.output_channels, options), ports)
    etfe = estimate_etfe(shots, ports.floor, options.confidence)
    pairs = Pairs(ports.inputs, ports.outputs, ports.input_resolution, ports.output_resolution, own)
    return etfe, pairs, map_coupling(shots, ports.floor, etfe, pairs, options.coupling)


def homes_from(results: Iterable[Artifact]) -> list[Mapped]:
    """Returns what the tasks kept."""
    return [from_datasets(Mapped, one) for one in results]
