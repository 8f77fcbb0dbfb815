"""What the commands have in common: the run, the node they are about and what it reads, the terminal, exit codes."""

from __future__ import annotations

import os
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from robid.arrays import Meaning
from robid.artifacts.atomic import FOLDER_LOCK, check_folders
from robid.artifacts.store import read_header
from robid.backends.addresses import warning_of
from robid.errors import ArtifactError, SettingsError, require_module
from robid.models.known import load_experiment
from robid.pipeline.chain import STAGES
from robid.pipeline.freshness import State, outputs_at, state_of_output
from robid.pipeline.graph import Node, Result, Run, examine, graph, needed_for, run_folder
from robid.pipeline.terminal import Shell, make_console
from robid.report.numbers import duration
from robid.settings.experiment import Execution
from robid.settings.load import LoadedExperiment

if TYPE_CHECKING:
    from robid.results.grade import Grade


PROBLEM = 5
_TRUST = 2


def open_run(
    path: Path,
    folder: Path | None,
    backend: Literal["serial", "processes", "dask"] | None,
    workers: int | None,
    scheduler: str | None = None,
    load: Callable[[Path], LoadedExperiment] = load_experiment,
) -> Run:
    """Loads an experiment; folder, backend, workers and scheduler are its own where none are given.

    Raises:
        SettingsError: If the file cannot be used, a scheduler is given to another backend, or the backend is not
            installed.
    """
    loaded = load(path)
    execution = loaded.experiment.execution
    return Run(
        loaded=loaded,
        folder=folder or run_folder(loaded),
        backend=choose_backend(execution, backend, scheduler),
        workers=workers or execution.workers or os.cpu_count() or 1,
        scheduler=scheduler or execution.scheduler,
    )


def choose_backend(
    execution: Execution, backend: Literal["serial", "processes", "dask"] | None, scheduler: str | None
) -> Literal["serial", "processes", "dask"]:
    """Returns the backend that is asked for, an experiment's own where none is.

    Raises:
        SettingsError: If it is not installed, or a scheduler is given to another one.
    """
    chosen = backend or execution.backend
    if chosen == "dask":
        require_module("distributed", "dask", "The backend dask")
    elif scheduler is not None:
        remedy = "add `--backend dask`"
        raise SettingsError(
            f"S015 the backend {chosen} has no scheduler", where=f"--scheduler {scheduler}", remedy=remedy
        )
    return chosen


def make_shell(run: Run, *, as_json: bool) -> Shell:
    """Returns where a command talks to."""
    quiet = as_json or run.loaded.experiment.execution.log_level == "warning"
    shell = Shell(make_console(stderr=False), make_console(stderr=True), quiet)
    warn_of_scheduler(shell, run.backend, run.scheduler)
    return shell


def warn_of_scheduler(shell: Shell, backend: str, scheduler: str | None) -> None:
    """Warns where the address of a scheduler leads to another machine without encryption."""
    warning = warning_of(scheduler) if backend == "dask" else ""
    if warning:
        shell.warn(warning)


@dataclass(frozen=True)
class Told:
    """What `--json` says of an output of the chain."""

    stage: Annotated[str, Meaning("Command that makes it.")]
    name: Annotated[str, Meaning("Campaign, design, fit or experiment that it is for.")]
    output: Annotated[str, Meaning("Its main file; of `run` and `status` in their `run_dir`.")]
    problem: Annotated[str, Meaning("What went wrong numerically; empty when all is well.")]
    grade: Annotated[
        int | None,
        Meaning("2 *trust*, 1 *predicts, but single parameters may be off*, 0 *do not use*; null where none is given."),
    ]
    grade_sentence: Annotated[str | None, Meaning("The grade, why it is no better, and the likeliest cause.")]


def told(node: Node, output: str, problem: str, grade: Grade | None) -> dict[str, Any]:
    """The fields of `Told`."""
    about = {"stage": node.stage.name, "name": node.owner, "output": output, "problem": problem}
    return about | {"grade": None, "grade_sentence": None} if grade is None else about | graded(grade)


def graded(grade: Grade) -> dict[str, Any]:
    """A grade as answers have it."""
    return {"grade": grade.value, "grade_sentence": grade.sentence}


def findings(grade: Grade | None) -> str:
    """What a grade below the best warns of."""
    return grade.sentence if grade is not None and grade.value < _TRUST else ""


def lock_of(run: Run, target: Path) -> Path:
    """Returns the lock of the run folder, or of a file elsewhere.

    Raises:
        ArtifactError: If a folder within the run folder is a link.
    """
    check_folders(run.folder, [target])
    inside = target.resolve().is_relative_to(run.folder.resolve())
    return run.path(FOLDER_LOCK) if inside else target.with_name(target.name + FOLDER_LOCK)


def tell(shell: Shell, result: Result) -> None:
    """Says what became of a node."""
    seconds = f" ({duration(result.seconds)})" if result.outcome == "made" else ""
    colon = ": " if result.text else ""
    shell.note(result.node.output, f"{result.outcome}{colon}{result.text}{seconds}")
    for warning in filter(None, (result.problem, findings(result.grade))):
        shell.warn(warning)


def choose_node(run: Run, stage_name: str, owner: str | None, option: str = "") -> Node:
    """Finds the node of a stage for an owner, or the only one; `option` says how one is named but by the usual option.

    Raises:
        SettingsError: If the owner is unknown, or is not named and there is more than one.
    """
    nodes = [node for node in graph(run.loaded) if node.stage.name == stage_name]
    stage = next(stage for stage in STAGES if stage.name == stage_name)
    known = ", ".join(f"`{node.owner}`" for node in nodes) or "none"
    given = f"with --{stage.owned_by}"
    if owner is None and len(nodes) == 1:
        return nodes[0]
    for node in nodes:
        if node.owner == owner:
            return node
    what = f"`{stage_name}` has no {stage.owned_by} `{owner}`" if owner else f"`{stage_name}` needs --{stage.owned_by}"
    raise SettingsError(
        f"S007 {what}; there are: {known}", where=str(run.loaded.path), remedy=f"name one of them {option or given}"
    )


def require_inputs(run: Run, node: Node, named: list[Path], *, goes_on: bool = False) -> dict[str, Path]:
    """Returns where a node's inputs lie: in the run folder, or named artifacts in the place of those of their kinds.

    What was made from named artifacts does for a stage that goes on from it (`goes_on`); what else is said of the run
    folder needs all of it to belong together.

    Raises:
        ArtifactError: If one is missing or stale, with the command that makes it.
        SettingsError: If a named one is of a kind that the node does not read.
    """
    nodes = graph(run.loaded)
    instead = {slot: path for path in named for slot in _slots(nodes, node, path)}
    states = examine(run, nodes)
    makers = {path: other for other in nodes for path in other.plan.outputs}
    for other in needed_for(nodes, [path for name, path in node.plan.inputs.items() if name not in instead]):
        damage = states[other].unreadable
        if damage is not None:
            raise damage
    inputs = {}
    for name, path in node.plan.inputs.items():
        if name in instead:
            inputs[name] = instead[name]
            continue
        maker = makers[path]
        state = states[maker]
        if state.blocked and node.stage.takes_what_is_there:
            continue
        if state.status != "fresh" and not (goes_on and state.named):
            why = f" ({state.why})" if state.why else ""
            ready = all(states[makers[one]].status == "fresh" for one in maker.plan.inputs.values())
            remedy = _what_makes(run, maker, state, ready=ready)
            raise ArtifactError(f"A019 The input is {state.status}{why}.", where=str(run.path(path)), remedy=remedy)
        inputs[name] = run.path(path)
    return inputs


def _what_makes(run: Run, maker: Node, state: State, *, ready: bool) -> str:
    """Says which commands make an input: its own stage first where that has all that it reads."""
    there = state.status == "stale" and run.path(maker.output).exists()
    own = f"`{run.command(maker)}{' --force' * there}` makes it"
    if maker.stage.on_request(run.loaded, maker.owner):
        return own
    every = f"`robid run {run.loaded.path}{run.in_folder}` makes all that is needed"
    return f"{own}; {every}" if ready else f"{every}; {own}"


def _slots(nodes: tuple[Node, ...], node: Node, path: Path) -> list[str]:
    """Names of the inputs of a node that an artifact is: all that lie in one place of the run folder.

    Of several places that hold its kind it takes the one whose campaign, design or fit it says that it was made for,
    else that of the input which is called as the kind is.
    """
    makers = {output: maker for maker in nodes for output in maker.plan.outputs}
    header = None if path.suffix == ".json" else read_header(path)
    kind = "truth" if header is None else header.kind
    inputs = node.plan.inputs.items()
    places = dict.fromkeys(place for _, place in inputs if _kind_at(makers[place], place) == kind)
    if not places:
        what = f"S008 `{node.stage.name}` reads no {kind}"
        remedy = f"it reads: {', '.join(dict.fromkeys(place for _, place in inputs)) or 'no artifact'}"
        raise SettingsError(what, where=f"--input {path}", remedy=remedy)
    settings = () if header is None else header.provenance.settings
    own = [place for place in places if _is_of(makers[place], settings)] or [*places]
    first = [place for place in own if node.plan.inputs.get(kind) == place]
    if len(own) > 1 and not first:
        what = f"S513 `{node.stage.name}` reads several of kind {kind}, and this one is of none of them"
        remedy = f"name one that was made for the campaign, design or fit of {' or '.join(own)}"
        raise SettingsError(what, where=f"--input {path}", remedy=remedy)
    chosen = own[0] if len(own) == 1 else first[0]
    return [name for name, place in inputs if place == chosen]


def _kind_at(maker: Node, place: str) -> str:
    """Kind of what a node writes at a place of the run folder."""
    return Path(place).stem if place != maker.output or maker.stage.kind is None else maker.stage.kind.name


def _is_of(maker: Node, settings: Collection[str]) -> bool:
    """Whether an artifact that was made by some settings, by their dotted names, is one of a node's owner."""
    section = f"{maker.stage.owned_by}s.{maker.owner}"
    return any(name == section or name.startswith(f"{section}.") for name in settings)


def fresh_at(node: Node, inputs: Mapping[str, Path], output: Path) -> State:
    """Tells whether a file would come out the same if the node's stage wrote it from these inputs."""
    named = {name: str(path) for name, path in inputs.items()}
    moved = replace(node.plan, outputs=tuple(map(str, outputs_at(node.plan, output))), inputs=named)
    return state_of_output(node.stage, moved, Path(), {str(path): State("fresh") for path in inputs.values()})
