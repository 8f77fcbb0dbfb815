"""A simulated arm and a real axis seen from outside: channels, maps beside the linearised loop, and resonances."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from robid.arrays import ComplexArray, FloatArray, Quantity
from robid.artifacts.artifact import Artifact
from robid.artifacts.kinds import RECORD, from_datasets, record_from_artifact, to_datasets
from robid.artifacts.results import MODEL, VALIDATION
from robid.artifacts.store import read_artifact, read_header
from robid.models.external.files import solution_from_artifact, validation_from_artifact
from robid.models.external.fit.checks import blocks_of
from robid.models.external.fit.coupling import CouplingMap, Pairs, map_coupling
from robid.models.external.fit.data import commands_of, shots_of
from robid.models.external.fit.etfe import estimate_etfe
from robid.models.external.fit.fitting import own_pairs, ports_of
from robid.models.external.fit.options import ExternalOptions
from robid.models.external.fit.solution import ExternalSolution, Ports
from robid.models.external.judge.validating import ExternalValidation
from robid.models.external.page.data import coupling_section
from robid.models.external.settings import external_fit
from robid.pipeline.graph import Run
from robid.report.numbers import MISSING, significant
from robid.report.section import Beside, Figure, Section, Table
from robid.robot.description import Robot
from robid.robot.kinematics import ToolArm
from robid.settings.robot_parts import (
    plain_settings,
    require_controller,
    require_pose_interface,
    robot_settings,
    tool_arm,
)
from robid.settings.robot_sections import given
from robid.simulate.options import Controller, PoseInterface
from robid.simulate.pose_response import pose_response
from robid.simulate.truth import true_robot
from robid.studies.experiments import Further, fit_outputs, paper_figures
from robid.studies.oliveira2019.plants import thinned
from robid.studies.page import Asked, PartFound, table
from robid.studies.settings.parts import CartesianCase, LoopCase
from robid.studies.simulated import simulate_options
from robid.studies.study import Content, Part, Results, Task, recorded_part

_RESPONSE = "as the channels", "frequency output command"


@dataclass(frozen=True)
class Mapped:
    """What was found in one home."""

    inputs: Annotated[tuple[str, ...], Quantity("1", "command", "Names of the commands")]
    outputs: Annotated[tuple[str, ...], Quantity("1", "output", "Names of the outputs")]
    map: CouplingMap  # The decoupling map
    response: Annotated[ComplexArray, Quantity(*_RESPONSE, "The empirical response, from samples to samples")]
    linear: Annotated[ComplexArray, Quantity(*_RESPONSE, "That of the linearised loop")]
    linear_gain: Annotated[FloatArray, Quantity("1", _RESPONSE[1], "In resolutions")]


def _homes_tasks(run: Run, case: CartesianCase, _earlier: Mapping[str, Results]) -> list[Task]:
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
    robot, arm = true_robot(nominal, simulated.truth), tool_arm(loaded.robot, nominal)
    loop = require_controller(loaded), require_pose_interface(loaded.robot), simulated.measured_pose
    shared = robot, arm, *loop, options
    return [Task(f"home_{at + 1}", {**decides, "home": at}, (path, at, *shared)) for at in range(count)]


def map_home(
    path: Path,
    index: int,
    robot: Robot,
    arm: ToolArm,
    controller: Controller,
    interface: PoseInterface,
    measured: str,
    options: ExternalOptions,
) -> Content:
    """Maps one home of the record at `path`, and holds the map beside the linearised loop."""
    record = record_from_artifact(read_artifact(path, RECORD))
    told, places = commands_of(record, options), shots_of(record, options, "homes")
    names = list(dict.fromkeys(shot.place for shot in places))
    shots = [shot for shot in places if shot.place == names[index]]
    ports: Ports = ports_of(shots, told.channels, record.output_channels, told.hold, options.coupling)
    own = own_pairs(blocks_of(told.channels, record.output_channels, options), ports)
    etfe = estimate_etfe(shots, ports.floor, options.confidence)
    pairs = Pairs(ports.inputs, ports.outputs, ports.input_resolution, ports.output_resolution, own)
    found = map_coupling(shots, ports.floor, etfe, pairs, options.coupling)
    place, inputs = given(record.configurations)[index], pairs.inputs
    linear = pose_response(robot, arm, controller, interface, place, etfe.frequency_hz, inputs, measured)
    gain = np.abs(linear) * pairs.per_resolution
    return Content(*to_datasets(Mapped(inputs, pairs.outputs, found, etfe.response, linear, gain)))


_CLEAR = 1.5  # How far from the threshold the linearised loop leaves no doubt whether a pair is coupled
_ASKED = {
    "arm.coupling_agreement": Asked(lower=0.95),
    "arm.linear_error_percent": Asked(upper=5.0),
    "arm.resonance_shift_percent": Asked(lower=5.0),
}
_LEAST_NRMSE = 0.97


def _conclude_arm(run: Run, case: CartesianCase, results: Results) -> PartFound:
    paper = paper_figures(run.loaded)
    model, held = (run.path(output) for output in fit_outputs(case.fit))
    solution = solution_from_artifact(read_artifact(model, MODEL))
    validation = validation_from_artifact(read_artifact(held, VALIDATION))
    homes = [from_datasets(Mapped, one) for one in results]
    options = external_fit(run.loaded.experiment, case.fit).options().coupling
    own = {f"arm.{one.output}.nrmse": one.nrmse for one in validation.agreements}
    figures = own | {"arm.decoupled_hz": solution.coupling.overall_hz} | home_figures(homes, options.ratio)
    asked = {name: Asked(lower=_LEAST_NRMSE) for name in own} | _ASKED
    # The chirp that validates must lie inside the band where channels are apart.
    asked["arm.decoupled_hz"] = Asked(lower=paper["decoupled_hz"])
    ports = solution.ports
    maps = tuple(
        replace(section, title=f"Decoupling in home {index}: Fig. 9", anchor=f"decoupling-{index}")
        for index, home in enumerate(homes, start=1)
        for section in coupling_section(home.map, ports, options)
    )
    channel = resonant_channel(homes)
    name = homes[0].outputs[channel]
    lead = (
        f"Channel {name} resonates, at another frequency in each home; the paper's robot shows a notch around 6 Hz in"
        " its channel X that changes with the home position."
    )
    titles = (f"Home {index}: channel {name}" for index in range(1, len(homes) + 1))
    shown = (_against_linear(title, home, channel, channel) for title, home in zip(titles, homes, strict=True))
    moves = Section("A resonance that moves", lead, (Beside(tuple(shown), columns=2),))
    sections = (_channels(solution, validation, paper), _coupling(homes, figures, paper), moves, *maps)
    return PartFound(figures, asked, sections)


def home_figures(homes: Sequence[Mapped], threshold: float) -> dict[str, float]:
    """Returns what maps and linearised loop say of each home, and how far they agree."""
    figures: dict[str, float] = {}
    right, errors = [], []
    for index, home in enumerate(homes, start=1):
        apart = ~home.map.own
        known = np.isfinite(home.map.gain)
        largest = np.where(known, home.linear_gain, 0.0).max(axis=0)
        clear = apart & ((largest > _CLEAR * threshold) | (largest < threshold / _CLEAR))
        right.append((np.isfinite(home.map.crossing_hz) == (largest > threshold))[clear])
        matter = known & (home.linear_gain > threshold)
        errors.append(np.abs(home.map.gain[matter] / home.linear_gain[matter] - 1))
        found, linear = resonance(home, resonant_channel(homes))
        figures |= {
            f"arm.home_{index}.decoupled_hz": home.map.overall_hz,
            f"arm.home_{index}.coupled_pairs": float(np.isfinite(home.map.crossing_hz)[apart].sum()),
            f"arm.home_{index}.resonance_hz": found,
            f"arm.home_{index}.linear_resonance_hz": linear,
        }
    resonances = [figures[f"arm.home_{index}.resonance_hz"] for index in range(1, len(homes) + 1)]
    return figures | {
        "arm.coupling_agreement": float(np.concatenate(right).mean()),
        "arm.linear_error_percent": 100 * float(np.median(np.concatenate(errors))),
        "arm.resonance_shift_percent": 100 * (max(resonances) / min(resonances) - 1),
    }


def resonant_channel(homes: Sequence[Mapped]) -> int:
    """Returns the channel that answers its own command most somewhere."""
    own = [np.diagonal(home.map.gain, axis1=1, axis2=2) for home in homes]
    return int(np.argmax(np.max([np.where(np.isfinite(each), each, 0.0).max(axis=0) for each in own], axis=0)))


def resonance(home: Mapped, channel: int) -> tuple[float, float]:
    """Returns where a channel answers its own command most, measured and of the linearised loop [Hz]."""
    gain = home.map.gain[:, channel, channel]
    known = np.isfinite(gain)
    frequency_hz = home.map.frequency_hz[known]
    linear = home.linear_gain[known, channel, channel]
    return float(frequency_hz[np.argmax(gain[known])]), float(frequency_hz[np.argmax(linear)])


def _channels(solution: ExternalSolution, validation: ExternalValidation, paper: Mapping[str, Any]) -> Section:
    transfers = solution.transfers
    printed = {name: f"{one['nrmse']:.3f}" for name, one in paper["table_4"].items()}
    columns = (
        ("Channel", lambda pair: pair[1].output),
        ("Poles", lambda pair: str(int(transfers.poles[pair[0]]))),
        ("Zeros", lambda pair: str(int(transfers.zeros[pair[0]]))),
        ("Delay [samples]", lambda pair: str(int(transfers.delay_samples[pair[0]]))),
        ("NRMSE, paper", lambda pair: printed.get(pair[1].output, MISSING)),
        ("Ours", lambda pair: f"{pair[1].nrmse:.4f}"),
    )
    lead = (
        "The KR300 on its rail under a Cartesian position loop, with friction, ripple and encoders: fitted to its own"
        f" slow and fast chirps by the paper's rule, validated on the chirp to 2.08 Hz. {solution.coupling.sentence}"
        " What the robot reports comes from its motors, as the paper's does."
    )
    shown = table(columns, list(enumerate(validation.agreements)), fit="compact")
    return Section("The arm's channels", lead, (shown,))


def _coupling(homes: Sequence[Mapped], figures: Mapping[str, float], paper: Mapping[str, Any]) -> Section:
    printed = ", ".join(f"{output} to {command}" for output, command in paper["coupled"])
    rows = [("paper", f"{paper['decoupled_hz']:g}", MISSING, printed)]
    for index, home in enumerate(homes, start=1):
        crossing = np.where(home.map.own, np.nan, home.map.crossing_hz)
        order = sorted((float(crossing[at]), at) for at in np.ndindex(crossing.shape) if np.isfinite(crossing[at]))
        named = ", ".join(
            f"{home.outputs[output]} to {home.inputs[command]} ({hz:.1f})" for hz, (output, command) in order
        )
        limit = figures[f"arm.home_{index}.decoupled_hz"]
        rows.append((f"home {index}", significant(limit), significant(home.map.examined_hz), named or "none"))
    coupled = "Outputs that follow another's command (from [Hz])"
    heads = ("Robot", "Decoupled up to [Hz]", "Examined up to [Hz]", coupled)
    lead = (
        "Here the tool itself is measured, which shows what its motors hardly feel. Of the pairs of which the"
        f" linearised loop leaves no doubt, the maps are right about {100 * figures['arm.coupling_agreement']:.1f} %;"
        f" gains above the threshold lie {figures['arm.linear_error_percent']:.2g} % from the linearised ones in the"
        " median. Couplings are normalised by resolutions of 0.01 mm and 0.001 degrees."
    )
    # The strongest coupling of each home, and what the linearised loop says of it.
    drawn = []
    for index, home in enumerate(homes, start=1):
        gain = np.where(np.isfinite(home.map.gain) & ~home.map.own, home.map.gain, 0.0)
        output, command = np.unravel_index(np.argmax(gain.max(axis=0)), gain.shape[1:])
        pair = f"{home.outputs[output]} to {home.inputs[command]}"
        drawn.append(_against_linear(f"Home {index}: {pair}", home, int(output), int(command)))
    shown = Beside(tuple(drawn), columns=2)
    return Section("What couples", lead, (Table(heads, tuple(rows), prose=True), shown))


def _against_linear(title: str, home: Mapped, output: int, command: int) -> Figure:
    known = np.isfinite(home.map.gain[:, output, command])
    gains = {"measured": home.map.gain, "linearised": home.linear_gain}
    series = {name: gain[known, output, command] for name, gain in gains.items()}
    drawn = thinned(home.map.frequency_hz[known], series)
    return Figure(title, "Frequency [Hz]", "Gain, in resolutions", drawn, height=280)


def _further_arm(run: Run, case: CartesianCase) -> Further:
    return ((run, (*fit_outputs(case.fit), f"{case.homes}/record.h5")),)


ARM = Part("arm", _conclude_arm, _homes_tasks, map_home, _further_arm)


_PUBLISHED_RAD_S, _NEAR = 126.4, 0.01
_LOOP_ASKED = {
    "emps.relative_error_percent": Asked(upper=0.005),
    "emps.natural_frequency": Asked((1 - _NEAR) * _PUBLISHED_RAD_S, (1 + _NEAR) * _PUBLISHED_RAD_S),
}
_LOOP_DIGITS = 5


def _conclude_loop(_run: Run, _case: LoopCase, _own: Run, models: list[Artifact]) -> PartFound:
    solution = solution_from_artifact(models[0])
    traces, denominator = solution.traces, solution.transfer(0).denominator
    left = np.linalg.norm(traces.measured - traces.simulated)
    natural = float(np.sqrt(denominator[2]))
    figures = {
        "emps.relative_error_percent": 100 * float(left / np.linalg.norm(traces.measured)),
        "emps.natural_frequency": natural,
        "emps.damping": float(denominator[1]) / (2 * natural),
        "emps.gain": float(solution.transfer(0).static_gain[0, 0]),
    }
    rows = tuple((name, significant(value, _LOOP_DIGITS)) for name, value in figures.items())
    lead = (
        "A carriage on a ball screw, measured in its position loop: from commanded to actual position by two poles and"
        " a free gain. The relative error is the residual's norm over that of the position."
    )
    section = Section("Real data: the EMPS axis from outside", lead, (Table(("Figure", "Ours"), rows, fit="compact"),))
    return PartFound(figures, _LOOP_ASKED, (section,))


POSITION_LOOP = recorded_part("emps", "The EMPS axis", lambda case: (case.fit,), _conclude_loop)
