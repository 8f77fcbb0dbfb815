"""export --campaign: an excitation as tables or MAT at the controller's rate, and responses, for other programs."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robid.artifacts.kinds import EXCITATION, FRF, excitation_from_artifact, frf_from_artifact
from robid.artifacts.store import read_artifact
from robid.design.excitation.excitation import UNITS, CampaignExcitation
from robid.errors import ArtifactError, SettingsError, require_module
from robid.models.encode import encode_mat, encode_table
from robid.pipeline.frf_formats import Response, response_json, response_mat, response_tables, response_uff
from robid.pipeline.stage import Plan, counted
from robid.settings.experiment import Campaign
from robid.settings.load import LoadedExperiment
from robid.settings.robot import RobotFile
from robid.signals.quantities import readable, readable_units
from robid.versions import __version__

_WHERE = "export"


@dataclass(frozen=True)
class _Format:
    """A format: the file's name, suffixes that it may have, and what writes it; a folder of tables without a writer."""

    file: str
    suffixes: tuple[str, ...]
    write: Callable[[Response], bytes] | None = None


FRF_FORMATS = {
    "csv": _Format("", ()),
    "mat": _Format("frf.mat", (".mat",), response_mat),
    "json": _Format("frf.json", (".json",), response_json),
    "uff": _Format("frf.uff", (".uff", ".unv"), response_uff),
}


@dataclass(frozen=True)
class FrfExport:
    """What to export."""

    campaign: str  # the campaign
    format: str  # `csv`, one table for each configuration, or `mat`, `json`, `uff`, all in one file
    configuration: int | None = None  # index of one configuration; None for all
    output: Path | None = None  # folder of the tables, or the file; None for the campaign's folder

    def target(self, folder: Path) -> Path:
        """Returns the folder of the tables, or the file."""
        return self.output or folder / self.campaign / "export" / FRF_FORMATS[self.format].file


def check_frf_export(options: FrfExport, others: Sequence[str]) -> None:
    """Refuses options that do not belong to a response, and a format whose package is missing.

    Raises:
        SettingsError: With every problem.
    """
    problems = [f"S103 `{option}` is for a fit, not for the responses of a campaign" for option in others]
    if options.format in {"h5", "hdf5"}:
        problems.append(
            f"S104 `{options.campaign}/frf.h5` in the run folder is HDF5 already (`robid inspect` describes it)"
        )
    elif options.format not in FRF_FORMATS:
        known = ", ".join(f"`{name}`" for name in FRF_FORMATS)
        problems.append(f"S105 responses are exported as one of {known}, not as `{options.format}`")
    elif options.output is not None:
        suffixes = FRF_FORMATS[options.format].suffixes
        if suffixes and options.output.suffix not in suffixes:
            problems.append(f"S106 `--output {options.output}` must end with {' or '.join(suffixes)}")
        if not suffixes and options.output.suffix:
            problems.append(f"S107 `--output {options.output}` must be a folder for one table per configuration")
    if problems:
        raise SettingsError("; ".join(problems), where=_WHERE, remedy="`robid export --help` says what goes together")
    if options.format == "uff":
        require_module("pyuff", "uff", "Writing UFF58")


def frf_export_plan(campaign: str) -> Plan:
    """Returns what the export of responses reads."""
    return Plan((), {}, {"frf": f"{campaign}/frf.h5"})


def export_frf(options: FrfExport, loaded: LoadedExperiment, source: Path, folder: Path) -> dict[Path, bytes]:
    """Makes the content of every exported file, by its path; options are checked.

    Raises:
        SettingsError: If the configuration does not exist.
    """
    frf = frf_from_artifact(read_artifact(source, FRF))
    count, only = len(frf.configurations), options.configuration
    if only is not None and only >= count:
        what = f"S108 campaign `{options.campaign}` has no configuration {only + 1} (it has 1 to {count})"
        raise SettingsError(what, where="--configuration", remedy="name one of them, or none for all")
    numbers = list(range(count)) if only is None else [only]
    joints = tuple(joint.name for joint in loaded.robot.joints)
    response = Response(loaded.experiment.name, options.campaign, joints, tuple(numbers), frf.select(numbers))
    target, write = options.target(folder), FRF_FORMATS[options.format].write
    if write is not None:
        return {target: write(response)}
    tables = response_tables(response)
    return {target / f"frf_c{number + 1}.csv": table for number, table in zip(numbers, tables, strict=True)}


_HOW = {
    "speed_reference": "Add it to each motor's speed reference, and its integral of zero mean to the angle reference.",
    "position_reference": "Add it to each motor's angle reference.",
    "torque": "Add it to each motor's torque at the controller's output.",
    "pose_reference": "Command it as displacement from the home pose, along and about the axes of the tool there.",
}


@dataclass(frozen=True)
class ExcitationExport:
    """What to export."""

    campaign: str  # the campaign
    format: str  # `csv`, one table for each experiment, or `mat`, all in one file
    output: Path | None = None  # folder of the tables, or the MAT file; None for the campaign's folder

    def target(self, folder: Path) -> Path:
        """Returns the folder of the tables, or the MAT file."""
        default = folder / self.campaign / "export"
        return self.output or (default / "excitation.mat" if self.format == "mat" else default)


def check_excitation_export(options: ExcitationExport, others: Sequence[str]) -> None:
    """Refuses options that do not belong to an excitation, before anything is read.

    Raises:
        SettingsError: With every problem.
    """
    problems = [f"S100 `{option}` is for a fit, not for the excitation of a campaign" for option in others]
    if options.format not in ("csv", "mat"):
        problems.append(f"S101 an excitation is exported as `csv` or `mat`, not as `{options.format}`")
    elif options.output is not None and (options.output.suffix == ".mat") != (options.format == "mat"):
        wanted = "must end with .mat" if options.format == "mat" else "must be a folder for one table per experiment"
        problems.append(f"S102 `--output {options.output}` {wanted}")
    if problems:
        raise SettingsError("; ".join(problems), where="export", remedy="`robid export --help` says what goes together")


def excitation_export_plan(campaign: str) -> Plan:
    """Returns what the export of an excitation reads."""
    return Plan((), {}, {"excitation": f"{campaign}/excitation.h5"})


def export_excitation(
    options: ExcitationExport, loaded: LoadedExperiment, source: Path, folder: Path
) -> dict[Path, bytes]:
    """Makes the content of every exported file, by its path; options are checked.

    Raises:
        ArtifactError: If the excitation was not designed here.
    """
    content = excitation_from_artifact(read_artifact(source, EXCITATION))
    excitation, joints = content.excitation, tuple(joint.name for joint in loaded.robot.joints)
    if not excitation.reference.size:
        message = "A031 It contains only the lines of what somebody else played: there is nothing to export."
        remedy = "`references` under `source.acquire` let it be designed here"
        raise ArtifactError(message, where=str(source), remedy=remedy)
    origin = f"Excitation of campaign {options.campaign}, experiment {loaded.experiment.name}, robid {__version__}"
    periods, target = _periods(loaded.experiment.campaigns[options.campaign]), options.target(folder)
    told = [origin, *_instructions(content, periods, loaded.robot)]
    columns = [f"{name} [{UNITS[excitation.kind]}]" for name in joints]
    if excitation.channels:
        columns = [f"{channel.name} [{channel.unit}]" for channel in excitation.channels]
    if options.format == "mat":
        return {target: encode_mat(_arrays(content, periods, told, joints, columns))}
    travel = [] if excitation.travel is None else [excitation.travel]
    heads = ["time [s]", *columns, *(f"{name} travel [rad]" for name in joints if travel)]
    time = np.arange(excitation.reference.shape[2]) * excitation.sampling_period_s
    tables = {}
    for real, exp in np.ndindex(*excitation.reference.shape[:2]):
        notes = [origin, f"Realization {real + 1}, experiment {exp + 1}.", *told[1:]]
        played = np.column_stack([time, excitation.reference[real, exp], *travel])
        tables[target / f"excitation_r{real + 1}_e{exp + 1}.csv"] = encode_table(notes, heads, played)
    return tables


def _periods(campaign: Campaign) -> tuple[int, int]:
    """Periods until the steady state and periods to record."""
    source = campaign.source
    if source is not None and source.acquire is not None:
        return source.acquire.drop_periods, campaign.periods
    transient = 1 if source is None or source.simulate is None else source.simulate.transient_periods
    return transient, campaign.periods


def _instructions(content: CampaignExcitation, played: tuple[int, int], robot: RobotFile) -> list[str]:
    excitation, (transient, periods) = content.excitation, played
    n_real, n_exp, n_sample, _ = excitation.reference.shape
    of, wanted = "all motors at once", "torque and angle of every motor, and this reference"
    if excitation.channels:
        of, wanted = "one channel after the other", "the commands as they were sent and the measured pose"
    blocks = f"{counted(n_real, 'realization')} of {counted(n_exp, 'experiment')}"
    lines = [
        f"{excitation.kind} of {of} [{UNITS[excitation.kind]}]: {_HOW[excitation.kind]}",
        f"One period: {n_sample} samples of {excitation.sampling_period_s:g} s, {excitation.period_s:g} s.",
        f"Repeat it without a gap, at least {counted(transient + periods, 'period')} and one to spare"
        f" ({transient} until the steady state, {periods} to record).",
        f"Play {blocks} in each of {counted(len(content.configurations), 'configuration')}; log {wanted},"
        " at this rate.",
    ]
    if excitation.travel is not None:
        lines.append("Add each motor's travel to its angle reference meanwhile, from the configuration on.")
    units = readable_units(robot.joint_units, len(robot.joints))
    for number, positions in enumerate(readable(content.configurations, robot.joint_units), start=1):
        named = zip(robot.joints, positions.tolist(), units, strict=True)
        told = ", ".join(f"{joint.name} {value:.6g}" + (" m" if unit == "m" else "") for joint, value, unit in named)
        lines.append(f"Configuration {number} [deg]: {told}")
    return lines


def _arrays(
    content: CampaignExcitation,
    played: tuple[int, int],
    told: list[str],
    motors: tuple[str, ...],
    columns: list[str],
) -> dict[str, object]:
    excitation, (transient, periods) = content.excitation, played
    travel = {} if excitation.travel is None else {"travel": excitation.travel, "travel_units": "rad"}
    return {
        **travel,
        "origin": told[0],
        "instructions": told[1:],
        "reference": excitation.reference,
        "reference_axes": "realization, experiment, sample, motor",
        "reference_units": UNITS[excitation.kind],
        "kind": excitation.kind,
        "motor_names": motors,
        "columns": columns,
        "time_s": np.arange(excitation.reference.shape[2]) * excitation.sampling_period_s,
        "sampling_period_s": excitation.sampling_period_s,
        "period_s": excitation.period_s,
        "transient_periods": transient,
        "recorded_periods": periods,
        "excited_lines": excitation.excited_lines,
        "detection_lines": excitation.detection_lines,
        "configurations_rad": content.configurations,
    }
