"""report: one page from all artifacts of a run, put together here, and its numbers as JSON."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from robid.artifacts.artifact import Artifact, Kind, Provenance
from robid.artifacts.atomic import replacing, write_json
from robid.artifacts.kinds import (
    DESIGN,
    EXCITATION,
    FRF,
    RECORD,
    design_from_artifact,
    excitation_from_artifact,
    frf_from_artifact,
    record_from_artifact,
)
from robid.artifacts.results import MODEL, VALIDATION
from robid.artifacts.store import inspect_artifact, read_artifact, read_header
from robid.artifacts.truth import read_truth
from robid.design.configurations.information import ConfigurationDesign
from robid.design.excitation.excitation import CampaignExcitation
from robid.frf.frf import Frf
from robid.frf.quality import saturation_text
from robid.models.family import Data, Shown, family_of
from robid.pipeline.estimate_frf import contradictions
from robid.pipeline.fit import data_of
from robid.pipeline.freshness import stamped
from robid.pipeline.measured import excitation_row, limits_sections
from robid.pipeline.plans import truth_input
from robid.pipeline.stage import Job, Stage, counted
from robid.report.design import design_section
from robid.report.experiment import (
    ConfigurationRow,
    ExcitationRow,
    StageRow,
    TorqueRow,
    experiment_section,
    run_section,
)
from robid.report.fits import fits_table
from robid.report.page import FitReport, ReportContent, Verdict, fit_sections, render
from robid.report.responses import (
    measured_sentence,
    response_headlines,
    response_sections,
    response_summary,
    responses_verdict,
)
from robid.report.section import Section
from robid.results.grade import DO_NOT_USE, PREDICTS, TRUST
from robid.results.plausible.evidence import gather_evidence
from robid.robot.kinematics import skeleton
from robid.settings.load import LoadedExperiment
from robid.signals.record import Record

_LEVELS: dict[int, Literal["ok", "warn", "bad"]] = {TRUST: "ok", PREDICTS: "warn", DO_NOT_USE: "bad"}


@dataclass(frozen=True)
class RunContent:
    """What a run holds."""

    content: ReportContent  # the page
    fits: tuple[FitReport, ...]  # what each fit adds to page, terminal and summary
    designs: dict[str, ConfigurationDesign]  # each design
    excitations: tuple[ExcitationRow, ...]  # the excitation of each campaign
    comparison: dict[str, float]  # numbers that compare fits, by dotted name
    responses: dict[str, float]  # numbers on each campaign's response, by dotted name
    measured: tuple[str, ...] = ()  # what each campaign's response is, in a phrase, where no fit was asked for


def gather(
    chain: Sequence[Stage], loaded: LoadedExperiment, folder: Path, present: Collection[str], *, signals: bool = False
) -> RunContent:
    """Reads the artifacts of a run and lays them out, with what records show in time where that is asked for.

    Raises:
        ArtifactError: If one cannot be read.
    """
    run = _read(loaded, folder, present)
    warnings = _warnings(loaded, run.frfs)
    shown = {name: _shown(loaded, folder, name, run, warnings) for name in run.models}
    if signals:
        shown = {name: replace(one, record=partial(_record, folder, run)) for name, one in shown.items()}
    fits, compared = _reports(loaded, shown)
    limits = limits_sections(loaded, folder, tuple(run.shapes)) if signals else ()
    excitations = tuple(
        excitation_row(loaded, name, one, run.shapes[name], run.frfs.get(name)) for name, one in run.excitations.items()
    )
    alone = [(name, frf) for name, frf in run.frfs.items() if name not in _fitted(loaded, run)]
    sections = (
        *fit_sections(fits),
        *response_sections(alone),
        *(_design(loaded, name, design) for name, design in run.designs.items()),
        *limits,
        *_experiment(loaded, run, excitations),
        *run_section(_stage_rows(chain, loaded, folder, present)),
    )
    content = ReportContent(
        title=loaded.experiment.name,
        verdict=_verdict(loaded, run, fits, warnings),
        robot=loaded.robot.name if loaded.experiment.robot is not None else _nameless(loaded),
        fits=fits_table(fits),
        headlines=tuple(fit.headline for fit in fits) or response_headlines(alone),
        warnings=warnings,
        sections=sections,
    )
    measured = () if loaded.experiment.fits else tuple(measured_sentence(*one) for one in alone)
    return RunContent(content, fits, run.designs, excitations, compared, _response_numbers(run), measured)


def _nameless(loaded: LoadedExperiment) -> str:
    """What is said of a robot without a file."""
    campaigns = loaded.experiment.campaigns.values()
    given = [campaign.is_response for campaign in campaigns if campaign.source is not None]
    what = "responses" if given and all(given) else "logs and responses" if any(given) else "logs"
    return f"known by its {what} alone"


def _reports(loaded: LoadedExperiment, shown: Mapping[str, Shown]) -> tuple[tuple[FitReport, ...], dict[str, float]]:
    """Lays out fits, those of one family beside each other, and compares these by dotted name."""
    families = {name: (family_of(loaded, name).name, family_of(loaded, name).reads) for name in shown}
    alike = {family: [name for name in shown if families[name] == family] for family in families.values()}
    besides = {name: tuple(shown[one] for one in alike[families[name]] if one != name) for name in shown}
    fits = tuple(family_of(loaded, name).report(replace(shown[name], beside=besides[name])) for name in shown)
    compared: dict[str, float] = {}
    for names in alike.values():
        compared |= family_of(loaded, names[0]).compare([shown[name] for name in names])
    return fits, compared


def _response_numbers(run: _Run) -> dict[str, float]:
    """Numbers on each campaign's response, by dotted name."""
    each = ((name, response_summary(frf)) for name, frf in run.frfs.items())
    return {f"campaigns.{name}.{key}": value for name, summary in each for key, value in summary.items()}


def _fitted(loaded: LoadedExperiment, run: _Run) -> set[str]:
    """Campaigns whose response stands on the page with a fit that read it."""
    return {
        campaign
        for name in run.models
        if "frf" in family_of(loaded, name).reads
        for campaign in (
            *loaded.experiment.fits[name].campaigns,
            *((loaded.experiment.fits[name].validate_on,) if name in run.validations else ()),
        )
        if campaign is not None
    }


def _shown(loaded: LoadedExperiment, folder: Path, name: str, run: _Run, warnings: tuple[str, ...]) -> Shown:
    fit, validation = loaded.experiment.fits[name], run.validations.get(name)
    own = [run.frfs[campaign] for campaign in fit.campaigns if "frf" in family_of(loaded, name).reads]
    new = None if fit.validate_on is None else run.frfs.get(fit.validate_on)
    true: Mapping[str, float] = {}
    if paths := truth_input(loaded, fit):
        truth = read_truth(folder / paths["truth"], folder / paths["true_record"])
        true = family_of(loaded, name).true_values(loaded, name, truth)
    taken = {what: run.models[other] for what, other in fit.takes.items() if other in run.models}
    return Shown(
        data=replace(data_of(loaded, name, own), taken=taken),
        model=run.models[name],
        validation=validation,
        new=None if validation is None else Data(loaded, name, new, taken=taken),
        true=true,
        told=warnings,
    )


def _record(folder: Path, run: _Run, campaign: str, row: int) -> Record | None:
    """Reads one configuration of a campaign's record, if there is one."""
    if campaign not in run.shapes:
        return None
    return record_from_artifact(
        read_artifact(folder / campaign / "record.h5", RECORD, row=row, leave_out=("reference",))
    )


def _experiment(loaded: LoadedExperiment, run: _Run, excitations: tuple[ExcitationRow, ...]) -> tuple[Section, ...]:
    removed = {name: np.sqrt(np.mean(frf.removed_torque_rms**2, axis=0)) for name, frf in run.frfs.items()}
    return experiment_section(
        loaded.robot.notes,
        excitations,
        tuple(
            TorqueRow(name, motor, value, frf.input_unit)
            for name, frf in run.frfs.items()
            if removed[name].any()
            for motor, value in zip(frf.input_names, removed[name].tolist(), strict=True)
        ),
        tuple(joint.name for joint in loaded.robot.joints),
        tuple(
            ConfigurationRow(name, index, tuple(row), loaded.robot.joint_units)
            for name, excitation in run.excitations.items()
            for index, row in enumerate(excitation.configurations.tolist())
        ),
    )


def _warnings(loaded: LoadedExperiment, frfs: dict[str, Frf]) -> tuple[str, ...]:
    """What the estimates note, and what of the campaigns' data contradicts the robot file."""
    notes = dict.fromkeys(note for frf in frfs.values() for note in frf.notes)
    for name, frf in frfs.items():
        notes |= dict.fromkeys(contradictions(loaded, name, gather_evidence(frf)))
    return tuple(notes)


@dataclass(frozen=True)
class _Run:
    """The artifacts by the name of their campaign, design or fit; of a record its shape alone."""

    designs: dict[str, ConfigurationDesign]
    excitations: dict[str, CampaignExcitation]
    shapes: dict[str, tuple[int, ...]]
    frfs: dict[str, Frf]
    models: dict[str, Artifact]
    validations: dict[str, Artifact]


def _read(loaded: LoadedExperiment, folder: Path, present: Collection[str]) -> _Run:
    experiment = loaded.experiment
    records = [name for name in experiment.campaigns if f"{name}/record.h5" in present]

    def there(names: Collection[str], pattern: str, kind: Kind) -> Iterator[tuple[str, Artifact]]:
        for name in names:
            if pattern.format(name) in present:
                yield name, read_artifact(folder / pattern.format(name), kind)

    designs = there(experiment.designs, "designs/{}.h5", DESIGN)
    excitations = there(records, "{}/excitation.h5", EXCITATION)
    frfs = there(experiment.campaigns, "{}/frf.h5", FRF)
    shapes = {name: inspect_artifact(folder / name / "record.h5").datasets["inputs"].shape for name in records}
    return _Run(
        designs={name: design_from_artifact(one) for name, one in designs},
        excitations={name: excitation_from_artifact(one) for name, one in excitations},
        shapes=shapes,
        frfs={name: frf_from_artifact(one) for name, one in frfs},
        models=dict(there(experiment.fits, "fits/{}/model.h5", MODEL)),
        validations=dict(there(experiment.fits, "fits/{}/validation.h5", VALIDATION)),
    )


def _design(loaded: LoadedExperiment, name: str, design: ConfigurationDesign) -> Section:
    campaign = loaded.experiment.campaigns[loaded.experiment.designs[name].campaign]
    return design_section(name, design, skeleton(loaded.robot.to_robot(campaign.payload_kg), design.configurations))


def _verdict(loaded: LoadedExperiment, run: _Run, fits: tuple[FitReport, ...], warnings: tuple[str, ...]) -> Verdict:
    if not fits and run.frfs and not loaded.experiment.fits:
        clipped = any(saturation_text(frf) for frf in run.frfs.values())
        return Verdict(responses_verdict(list(run.frfs.items())), "bad" if clipped else "warn" if warnings else "ok")
    if not fits:
        return Verdict("No model was fitted.", "warn")
    texts = [f"{fit.headline.name}: {fit.verdict}" if len(fits) > 1 else fit.verdict for fit in fits]
    return Verdict(" ".join(texts), _LEVELS[min(DO_NOT_USE if fit.grade is None else fit.grade for fit in fits)])


_SHORT = 8


def _stage_rows(
    chain: Sequence[Stage], loaded: LoadedExperiment, folder: Path, present: Collection[str]
) -> tuple[StageRow, ...]:
    makers = {
        stage.plan(loaded, name).outputs[0]: (stage, name)
        for stage in chain
        for name in stage.owners(loaded.experiment)
    }
    rows = []
    for path in (path for path in present if path.endswith(".h5")):
        stage, name = makers[path]
        header, seconds = read_header(folder / path), None
        made = header.provenance
        if made.started_utc and made.finished_utc:
            begun, ended = datetime.fromisoformat(made.started_utc), datetime.fromisoformat(made.finished_utc)
            seconds = (ended - begun).total_seconds()
        hashes = made.settings_hash[:_SHORT], header.content_sha256[:_SHORT]
        rows.append(StageRow(made.stage, path, *hashes, seconds, stage.phrase(loaded, name, folder / path)))
    return tuple(rows)


def run(chain: Sequence[Stage], job: Job) -> str:
    """Writes the page and its numbers on what a chain of stages has made; returns what is on it."""
    gathered = gather(chain, job.loaded, job.folder, job.inputs, signals=True)
    write_json(job.output.with_name("summary.json"), summarize(gathered))
    write_page(job.output, gathered.content, job.provenance())
    responses = sum(path.name == "frf.h5" for path in job.inputs.values())
    return counted(len(gathered.fits), "fit") if gathered.fits else f"responses of {counted(responses, 'campaign')}"


def write_page(path: Path, content: ReportContent, provenance: Provenance) -> None:
    """Writes a report that says how it came about, see `read_stamp`."""
    with replacing(path) as partial:
        partial.write_text(stamped(render(content), provenance), encoding="utf-8")


def summarize(gathered: RunContent) -> dict[str, float]:
    """Returns everything that a run says in numbers, in SI units."""
    found: dict[str, float] = {}
    for name, design in gathered.designs.items():
        found |= {f"designs.{name}.efficiency": design.efficiency, f"designs.{name}.gap": design.gap}
        found[f"designs.{name}.average_std"] = float(design.predicted_relative_std.mean())
        if design.stability is not None:
            found[f"designs.{name}.chosen_again"] = float(design.stability.kept.mean())
    for row in gathered.excitations:
        found[f"campaigns.{row.campaign}.measuring_time_s"] = row.duration_s
        found[f"campaigns.{row.campaign}.lines"] = row.lines
    for fit in gathered.fits:
        found |= {f"fits.{fit.headline.name}.{key}": value for key, value in fit.summary.items()}
    return found | gathered.responses | gathered.comparison
