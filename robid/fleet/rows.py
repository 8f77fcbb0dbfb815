"""The rows of a manifest as experiments: all are checked before the first one runs; which of them are due, and why."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from robid.artifacts.artifact import canonical_hash
from robid.errors import SettingsError
from robid.fleet.ledger import Ledger, logs_away, read_ledger, why_stale
from robid.fleet.manifest import COLUMNS, ID, Manifest, Robots, read_manifest, robots_of, wrong_rows, wrong_times
from robid.models.known import load_row
from robid.pipeline.graph import Node, asked_for
from robid.pipeline.plans import experiment_count, response_files
from robid.settings.base import DATA_VARIABLE, data_path
from robid.settings.experiment import Experiment
from robid.settings.load import LoadedExperiment, read_robot
from robid.settings.placeholders import Row, check_placeholders, leads_outside, placeholders
from robid.settings.problems import SettingsProblem, format_field
from robid.settings.yaml import Document, FieldPath, parse_yaml, read_text

_SHOWN_PROBLEMS = 20
_SHOWN_ROWS = 3


@dataclass(frozen=True)
class PlannedRow:
    """A row that can be run."""

    row: Row
    settings_hash: str  # hash of all settings that its stages read
    logs: Mapping[str, Path]  # its logs by campaign and name


@dataclass(frozen=True)
class Fleet:
    """An experiment file with the rows of a manifest, checked."""

    template: Document  # the experiment file, with placeholders
    text: str
    manifest: Manifest
    rows: tuple[PlannedRow, ...]
    robots: Robots  # whose measurements the rows are
    experiment: Experiment  # the experiment of the first row; name, backend and workers are those of all
    warnings: tuple[str, ...]  # what is odd, but no problem


def load_fleet(manifest_path: Path, template_path: Path) -> Fleet:
    """Reads a manifest and an experiment file and checks every row.

    Raises:
        SettingsError: With every problem of the manifest, or of the experiments that its rows make.
    """
    manifest, text = read_manifest(manifest_path), read_text(template_path)
    template = parse_yaml(template_path, text)
    asked = placeholders(template)
    used = {column for columns in asked.values() for column in columns}
    problems = [str(problem) for problem in check_placeholders(template, manifest.columns)]
    problems += [*wrong_rows(manifest, used), *wrong_times(manifest)]
    _refuse(problems)
    first, rows, twins = _check_rows(manifest, template, asked)
    unused = [f"`{column}`" for column in manifest.columns if column not in {ID, *COLUMNS, *used}]
    warnings = [*twins[:_SHOWN_PROBLEMS]]
    warnings += [f"and {len(twins) - _SHOWN_PROBLEMS} more such rows"] if len(twins) > _SHOWN_PROBLEMS else []
    warnings += [f"{manifest_path}: no placeholder asks for {', '.join(unused)}"] if unused else []
    if not used:
        warnings.append(f"{template_path}: it has no placeholder, so that all rows are the same")
    robots = robots_of(manifest, asked.get(("robot",), ()))
    return Fleet(template, text, manifest, rows, robots, first.experiment, tuple(warnings))


def chain_of(loaded: LoadedExperiment) -> tuple[Node, ...]:
    """Returns what a row makes: all but a report of its own."""
    return tuple(node for node in asked_for(loaded) if node.stage.owned_by != "experiment")


def settings_hash_of(nodes: Iterable[Node]) -> str:
    """Returns the hash of all settings that a row's stages read."""
    return canonical_hash({node.output: node.plan.settings for node in nodes})


def logs_of(nodes: Iterable[Node]) -> dict[str, Path]:
    """Returns a row's logs by campaign and name."""
    return {f"{node.owner}: {name}": path for node in nodes for name, path in node.plan.files.items()}


def _check_rows(
    manifest: Manifest, template: Document, asked: Mapping[FieldPath, Sequence[str]]
) -> tuple[LoadedExperiment, tuple[PlannedRow, ...], list[str]]:
    """Plans every row, and tells of twins; the first one's experiment stands for what all have in common."""
    read = cache(read_robot)
    first: LoadedExperiment | None = None
    planned: list[PlannedRow] = []
    wrong: dict[SettingsProblem, list[Row]] = {}
    seen: dict[str, Row] = {}
    twins: list[str] = []
    for row in manifest.rows:
        loaded, problems = load_row(template, row, read)
        if loaded is not None:
            problems = list(_row_problems(template, loaded, asked, row))
            nodes = chain_of(loaded)
            planned.append(PlannedRow(row, settings_hash_of(nodes), logs_of(nodes)))
            first = first or loaded
            twin = seen.setdefault(_measurement(nodes) or row.id, row)
            if twin is not row:
                twins.append(
                    f"{row.place}: row {row.id} is row {twin.id} again, {twin.place}: the same logs and settings"
                )
        for problem in problems:
            wrong.setdefault(problem, []).append(row)
    _refuse([_told(problem, rows, len(manifest.rows), asked) for problem, rows in wrong.items()])
    if first is None:
        message = "a manifest without a problem has a row"
        raise RuntimeError(message)
    return first, tuple(planned), twins


def _measurement(nodes: Iterable[Node]) -> str:
    """What the result of a row that reads logs comes from, however the names of these are spelt; else empty."""
    nodes = tuple(nodes)
    files = logs_of(nodes)
    real = {path: os.path.realpath(path) for path in set(files.values())}
    logs = {name: real[path] for name, path in files.items()}
    settings = {node.output: _without_files(node.plan.settings) for node in nodes}
    return canonical_hash({"logs": logs, "settings": settings}) if logs else ""


def _without_files(settings: Any) -> Any:  # noqa: ANN401
    if isinstance(settings, Mapping):
        return {key: _without_files(value) for key, value in settings.items() if key != "file"}
    return [_without_files(each) for each in settings] if isinstance(settings, list) else settings


def _row_problems(
    template: Document, loaded: LoadedExperiment, asked: Mapping[FieldPath, Sequence[str]], row: Row
) -> Iterator[SettingsProblem]:
    """What is wrong with a row's experiment here alone: it fits nothing, or a link leads out of a folder."""

    def problem(field: FieldPath, message: str) -> SettingsProblem:
        return SettingsProblem(template.path, template.line(field), format_field(field), message)

    if not loaded.experiment.fits:
        yield problem(("fits",), "S378 is missing: the rows of a table of results are the parameters of fits")
    if ("robot",) in loaded.written and loaded.robot_path is not None:
        outside = leads_outside(loaded.robot_path, row.folder)
        if outside:
            yield problem(("robot",), outside)
    for field in asked:
        folder = row.folder if field in loaded.written else data_path(DATA_VARIABLE, Path())
        for path in _log_paths(loaded, field):
            outside = leads_outside(path, folder)
            if outside:
                yield problem(field, outside)


def _log_paths(loaded: LoadedExperiment, field: FieldPath) -> Iterator[Path]:
    """Where the logs or responses are that a field names; none for other fields."""
    from robid.settings.checks.configurations import configuration_count

    if field[-1] != "file" or not {"acquire", "response"} & set(field):
        return
    campaign = loaded.experiment.campaigns[str(field[1])]
    if campaign.source is not None and campaign.source.response is not None:
        yield from response_files(loaded, campaign, campaign.source.response).values()
        return
    acquire = None if campaign.source is None else campaign.source.acquire
    if acquire is None:
        return
    of_channel = None if field[-2] == "acquire" else getattr(acquire, str(field[-3]))[field[-2]].file
    named = acquire if of_channel is None else replace(acquire, file=of_channel)
    n_conf = configuration_count(loaded.experiment, campaign) or 1
    counts = (n_conf, campaign.realizations, experiment_count(campaign, acquire))
    yield from dict.fromkeys(named.log_path(loaded.path.parent, *place) for place in np.ndindex(*counts))


def _told(problem: SettingsProblem, rows: Sequence[Row], n_row: int, asked: Mapping[FieldPath, Sequence[str]]) -> str:
    """A problem with the rows that have it, and the columns that it may come from."""
    if len(rows) == n_row > 1:
        return f"all rows: {problem}"
    fields = {format_field(field): columns for field, columns in asked.items()}
    columns = fields.get(problem.field) or next(
        (columns for field, columns in fields.items() if field.startswith(problem.field)), ()
    )
    of = f", column{'s' * (len(columns) > 1)} {', '.join(f'`{name}`' for name in columns)}" if columns else ""
    others = [row.id for row in rows[1 : 1 + _SHOWN_ROWS]]
    more = f" and {len(rows) - 1 - len(others)} more" if len(rows) > 1 + len(others) else ""
    also = f" (so rows {', '.join(others)}{more})" if others else ""
    return f"{rows[0].place}: row {rows[0].id}{of}{also}: {problem}"


def _refuse(problems: Sequence[str]) -> None:
    if not problems:
        return
    more = [f"S047 and {len(problems) - _SHOWN_PROBLEMS} more"] if len(problems) > _SHOWN_PROBLEMS else []
    remedy = "correct the manifest or the experiment file; nothing was started"
    raise SettingsError("\n".join([*problems[:_SHOWN_PROBLEMS], *more]), remedy=remedy)


@dataclass(frozen=True)
class Look:
    """What a batch has to do."""

    due: tuple[tuple[PlannedRow, str], ...]  # the rows to be made, in the order of the manifest, each with the reason
    fresh: Mapping[str, Ledger]  # the others' ledgers in outline, by id
    away: Mapping[str, tuple[str, ...]]  # which logs are away of those that therefore stay as they are, by id

    @property
    def reasons(self) -> dict[str, list[str]]:
        """Ids of the rows to be made by reason, the most frequent first."""
        found: dict[str, list[str]] = {}
        for planned, why in self.due:
            found.setdefault(why, []).append(planned.row.id)
        return dict(sorted(found.items(), key=lambda item: -len(item[1])))


def look(fleet: Fleet, rows: Path, *, keep: bool, force: bool) -> Look:
    """Tells the rows that are to be made from those that are fresh; writes nothing.

    Raises:
        ArtifactError: If a folder in the place of a row's is none.
    """
    due, fresh, away = [], {}, {}
    for planned in fleet.rows:
        folder = rows / planned.row.id
        ledger = read_ledger(folder)
        why = why_stale(ledger, planned.settings_hash, planned.logs, folder, keep=keep, force=force)
        if ledger is None or why:
            due.append((planned, why))
            continue
        fresh[planned.row.id] = ledger.outline
        gone = logs_away(ledger, planned.logs)
        if gone:
            away[planned.row.id] = gone
    return Look(tuple(due), fresh, away)
