"""`robid design-configs --next`: the configuration to visit next after a fit, and what that would bring."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from rich.text import Text

from robid.arrays import Meaning
from robid.commands.output import Answer, print_json
from robid.commands.shared import choose_node, make_shell, require_inputs
from robid.design.configurations.comparison import Alternative
from robid.errors import SettingsError
from robid.pipeline.export import export_plan
from robid.pipeline.fit import read_data
from robid.pipeline.graph import Node, Run
from robid.pipeline.next_visit import Proposal, following, propose_visit
from robid.pipeline.plans import design_plan
from robid.pipeline.stage import Job
from robid.report.numbers import joint_text, percent
from robid.report.terminal_table import Column, TerminalTable
from robid.settings.load import LoadedExperiment
from robid.signals.quantities import readable, readable_units

_TITLES = {"parameters": "for its parameters", "prediction": "for predictions"}


@dataclass(frozen=True)
class Expected:
    """What some visits are expected to give."""

    relative_std: Annotated[float, Meaning("Median of the parameters' relative deviations.")]
    worst_relative_std: Annotated[float, Meaning("The largest of them.")]
    prediction_error: Annotated[float, Meaning("Expected relative error of predictions, root mean square.")]


@dataclass(frozen=True)
class NextNumbers:
    """The configuration that helps most, for one purpose."""

    purpose: Annotated[str, Meaning("`parameters` or `prediction`.")]
    candidate: Annotated[int, Meaning("Number of the candidate, from 1.")]
    positions: Annotated[tuple[float, ...], Meaning("Its joints' positions on the arm side, in `units`.")]
    units: Annotated[tuple[str, ...], Meaning("Unit of each, as `deg`.")]
    after: Annotated[Expected, Meaning("What is expected with one visit of it more.")]


@dataclass(frozen=True)
class NextAnswer(Answer, type="design-next"):
    """The configuration to visit next after a fit."""

    design: Annotated[str, Meaning("Design whose candidates are offered.")]
    fit: Annotated[str, Meaning("Fit that it goes on from.")]
    now: Annotated[Expected, Meaning("What the fit's configurations are expected to give.")]
    next: Annotated[tuple[NextNumbers, ...], Meaning("The candidate that helps most, for each purpose where one does.")]


def check_next(others: Mapping[str, object]) -> None:
    """Refuses `--next` beside options that it does not know.

    Raises:
        SettingsError: If one is given.
    """
    given = [name for name, value in others.items() if value]
    if given:
        message = f"S603 `{given[0]}` says nothing of a visit that is only proposed"
        raise SettingsError(message, where="--next", remedy=f"leave out {given[0]}")


def propose_next(run: Run, design: str | None, fit: str, *, as_json: bool) -> int:
    """Prints which candidate to visit next after a fit, for either purpose; returns the exit code."""
    node, after = choose_node(run, "design-configs", design), choose_node(run, "fit", fit, "with --next")
    if run.loaded.experiment.fits[fit].family != "elastic":
        message = f"S604 fit `{fit}` is not of family elastic, and configurations are chosen for its parameters"
        raise SettingsError(message, where="--next", remedy="name an elastic fit")
    loaded = following(run.loaded, node.owner, fit)
    shell = make_shell(run, as_json=as_json)
    label = f"{node.owner} after {fit}"
    with run.make_map() as parallel_map, shell.progress(label, workers=run.at_a_time) as progress:
        read = require_inputs(run, _with_model(run, after), [])
        visited = read_data(run.loaded, fit, {name: path for name, path in read.items() if name != "model"}).frf
        if visited is None:
            raise RuntimeError("an elastic fit has no responses")
        inputs = {**_candidates(run, node, loaded), "model": read["model"], "between": read["model"]}
        job = Job(
            loaded, node.stage.name, node.owner, {}, run.folder, inputs, {}, run.folder, parallel_map, 1, progress
        )
        found = propose_visit(job, visited.configurations)
    if as_json:
        print_json(_answer(node.owner, fit, found, loaded))
        return 0
    shell.show(_table(found, loaded))
    shell.say("nothing is written; `configurations: {list_deg: [...]}` in a campaign measures one of them")
    return 0


def _with_model(run: Run, node: Node) -> Node:
    """The fit, read with its own model, so that all of it must belong together."""
    return replace(node, plan=export_plan(run.loaded, node.owner))


def _candidates(run: Run, node: Node, loaded: LoadedExperiment) -> dict[str, Path]:
    """Designs that the candidates come from."""
    plan = design_plan(loaded, node.owner)
    others = {name: path for name, path in plan.inputs.items() if name not in ("model", "between")}
    return require_inputs(run, replace(node, plan=replace(plan, inputs=others)), [])


def _expected(one: Alternative) -> Expected:
    return Expected(one.relative_std, one.worst_relative_std, one.prediction_error)


def _answer(design: str, fit: str, found: Proposal, loaded: LoadedExperiment) -> NextAnswer:
    joint_units = loaded.robot.joint_units
    units = readable_units(joint_units, found.candidates.shape[1])
    best = tuple(
        NextNumbers(
            each.purpose,
            each.candidate + 1,
            tuple(readable(found.candidates[each.candidate], joint_units).tolist()),
            units,
            _expected(each.after),
        )
        for each in found.best
    )
    return NextAnswer(design, fit, _expected(found.now), best)


def _table(found: Proposal, loaded: LoadedExperiment) -> TerminalTable:
    joint_units = loaded.robot.joint_units
    n_joint = found.candidates.shape[1]
    units = readable_units(joint_units, n_joint)
    table = TerminalTable(
        (
            Column("next", numbers=False),
            Column("candidate"),
            *(Column(f"q{number + 1}", leaves=1) for number in range(n_joint)),
            *(Column(name) for name in ("median", "worst", "prediction")),
        )
    )

    def figures(one: Alternative) -> tuple[str, ...]:
        return percent(one.relative_std), percent(one.worst_relative_std), percent(one.prediction_error)

    table.add("as it is", "", *("",) * n_joint, *figures(found.now))
    for each in found.best:
        values = readable(found.candidates[each.candidate], joint_units).tolist()
        places = (joint_text(value, unit) for value, unit in zip(values, units, strict=True))
        table.add(Text(_TITLES[each.purpose]), str(each.candidate + 1), *places, *figures(each.after))
    helped = {each.purpose for each in found.best}
    for purpose in _TITLES:
        if purpose not in helped:
            table.add(Text(f"{_TITLES[purpose]}: none"), *("",) * (n_joint + 4))
    return table
