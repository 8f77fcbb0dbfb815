"""The command line: arguments in, exit code out."""

import dataclasses
import gc
import json
import os
import sys
import time
import traceback
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

import robid
from robid.artifacts.atomic import read_json
from robid.artifacts.lock import FOLDER_LOCK, locked
from robid.artifacts.store import inspect_artifact
from robid.backends.map import make_map
from robid.errors import ArtifactError, RobidError, SettingsError
from robid.families.family import Graded
from robid.families.files import experiment_schema, load_experiment
from robid.pipeline import (
    STAGES,
    Node,
    Result,
    Run,
    asked_for,
    choose_node,
    examine,
    execute,
    fresh_at,
    grade_of,
    require_inputs,
    run_all,
)
from robid.report.numbers import duration
from robid.settings.schema import robot_schema
from robid.stages.export import ExportOptions, check_options, export, export_plan, export_target, write_export
from robid.stages.export_excitation import (
    ExcitationExport,
    check_excitation_export,
    excitation_export_plan,
    export_excitation,
)
from robid.stages.replacing import check_outputs, settings_files
from robid.stages.report_content import gather
from robid.stages.stage import Stage
from robid.stages.terminal import Shell, channel_lines, dataset_table, make_console, section_table, status_table
from robid.studies.study import run_study

_UsageError: type[Exception] = typer.BadParameter.__bases__[0]
_PROBLEM, _INTERRUPTED = 5, 130
_TRUST = 2
_STRICT = "Exit with 5 unless the model can be trusted, even where it predicts well."

app = typer.Typer(
    help="Identifies the elastic dynamics of a robot from its own motor signals.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)

ExperimentFile = Annotated[Path, typer.Argument(metavar="EXPERIMENT.yaml", help="The experiment file.")]
RunFolder = Annotated[Path | None, typer.Option("--run-dir", help="The run folder; runs/<name> by default.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the result as one JSON object.")]
Debug = Annotated[bool, typer.Option("--debug", help="Show tracebacks.")]
Backend = Annotated[
    Literal["serial", "processes"] | None, typer.Option("--backend", help="Overrides execution.backend.")
]
Workers = Annotated[int | None, typer.Option("--workers", min=1, help="Overrides execution.workers.")]


def main() -> None:
    """Runs the command line and exits with its code."""
    code = run_command(sys.argv[1:])
    # What is left ends with the process: looking through it for garbage takes a quarter of a short command's time.
    gc.freeze()
    sys.exit(code)


def run_command(arguments: list[str]) -> int:
    """Runs a command; every error becomes one message and an exit code."""
    try:
        code = app(arguments or ["--help"], prog_name="robid", standalone_mode=False)
    except RobidError as error:
        return _fail(arguments, str(error), error.exit_code)
    except _UsageError as error:
        message = getattr(error, "format_message", error.__str__)()
        return _fail(arguments, f"{message}\n  remedy: `robid --help` lists commands and options", 2)
    except (KeyboardInterrupt, typer.Abort):
        code = _INTERRUPTED
    except Exception as error:  # noqa: BLE001  the one place that turns a defect into a message
        first = (str(error) or "no message").splitlines()[0]
        remedy = "report it with what --debug prints"
        return _fail(arguments, f"a defect of ours: {type(error).__name__}: {first}\n  remedy: {remedy}", 1)
    if code == _INTERRUPTED:
        return _fail(arguments, "interrupted; what is finished is kept, and the same command goes on from there", code)
    return int(code or 0)


def _fail(arguments: list[str], message: str, code: int) -> int:
    if "--debug" in arguments:
        typer.echo(traceback.format_exc(), err=True)
    typer.echo(f"robid: {message}", err=True)
    if "--json" in arguments:
        _print_json({"error": message, "exit_code": code})
    return code


def _print_json(value: Any) -> None:  # noqa: ANN401
    typer.echo(json.dumps(value, indent=2, ensure_ascii=False, default=str))


def _open(path: Path, folder: Path | None, backend: Literal["serial", "processes"] | None, workers: int | None) -> Run:
    loaded = load_experiment(path)
    execution = loaded.experiment.execution
    return Run(
        loaded=loaded,
        folder=folder or Path("runs") / loaded.experiment.name,
        backend=backend or execution.backend,
        workers=workers or execution.workers or os.cpu_count() or 1,
    )


def _shell(run: Run, *, as_json: bool) -> Shell:
    quiet = as_json or run.loaded.experiment.execution.log_level == "warning"
    shell = Shell(make_console(stderr=False), make_console(stderr=True), quiet)
    for note in run.loaded.robot.model_notes:
        shell.note(run.loaded.robot.name, note)
    return shell


def _add_stage(stage: Stage) -> None:
    """Adds a stage's command; the option that names what it runs for follows from the stage."""
    is_whole = stage.owned_by == "experiment"
    described = f"Name of the {stage.owned_by}; may be left out when there is only one."
    owner_option = typer.Option(f"--{stage.owned_by}", help=described, hidden=is_whole)

    strict_option = typer.Option("--strict", help=_STRICT, hidden=stage.owned_by != "fit")

    def command(
        experiment: ExperimentFile,
        owner: Annotated[str | None, owner_option] = None,
        run_dir: RunFolder = None,
        inputs: Annotated[
            list[Path] | None, typer.Option("--input", help="Read this artifact instead of the run folder's.")
        ] = None,
        output: Annotated[Path | None, typer.Option("--output", help="Write here instead.")] = None,
        force: Annotated[bool, typer.Option("--force", help="Replace an output that differs.")] = False,
        strict: Annotated[bool, strict_option] = False,
        as_json: AsJson = False,
        backend: Backend = None,
        workers: Workers = None,
        debug: Debug = False,
    ) -> int:
        del debug
        if strict and stage.owned_by != "fit":
            remedy = "leave it out; it belongs to `fit`, `validate` and `run`"
            raise SettingsError(f"`{stage.name}` gives no grade", where="--strict", remedy=remedy)
        run = _open(experiment, run_dir, backend, workers)
        node = choose_node(run, stage.name, owner)
        return _run_stage(run, node, inputs or [], output, force=force, strict=strict, as_json=as_json)

    app.command(stage.name, help=stage.does)(command)


def _run_stage(
    run: Run, node: Node, named: list[Path], output: Path | None, *, force: bool, strict: bool, as_json: bool
) -> int:
    shell = _shell(run, as_json=as_json)
    inputs = require_inputs(run, node, named)
    target = output or run.path(node.output)
    check_outputs(run.loaded, node.stage, node.plan, inputs, target)
    outcome, text = "fresh", "nothing to do"
    if force or fresh_at(node, inputs, target).status != "fresh":
        with locked(_lock(run, target), run.command(node)):
            # Another process may have made it meanwhile.
            state = fresh_at(node, inputs, target)
            if state.status == "stale" and not force:
                raise state.unreadable or ArtifactError(
                    f"The output is there, but differs ({state.why}).",
                    where=str(target),
                    remedy="`--force` replaces it; what was made from it is stale then",
                )
            begun = time.monotonic()
            with make_map(run.backend, run.workers) as parallel_map, shell.progress(node.output) as progress:
                figures = execute(run, node, inputs, target, parallel_map, progress)
        outcome, text = "made", f"{figures} ({duration(time.monotonic() - begun)})"
    problem, grade = node.stage.problem(target), grade_of(run, node, target)
    if as_json:
        told = {"outcome": outcome, "text": text, "problem": problem, **_graded(grade), **node.stage.told(target)}
        _print_json({"stage": node.stage.name, "for": node.owner, "output": str(target), **told})
    else:
        shell.say(f"{target}  {outcome}: {text}")
        shown = node.stage.show(target, run.loaded) if outcome == "made" else None
        if shown is not None:
            shell.out.print(shown)
    for warning in filter(None, (problem, _doubts(grade))):
        shell.warn(warning)
    return _PROBLEM if problem or (grade is not None and grade.fails(strict=strict)) else 0


def _graded(grade: Graded | None) -> dict[str, Any]:
    """What `--json` says of a grade."""
    return {} if grade is None else {"grade": grade.value, "grade_sentence": grade.sentence}


def _doubts(grade: Graded | None) -> str:
    """What a grade below the best warns of."""
    return grade.sentence if grade is not None and grade.value < _TRUST else ""


def _lock(run: Run, target: Path) -> Path:
    """Lock of the run folder, or of a file elsewhere."""
    inside = target.resolve().is_relative_to(run.folder.resolve())
    return run.path(FOLDER_LOCK) if inside else target.with_name(target.name + FOLDER_LOCK)


for _stage in STAGES:
    _add_stage(_stage)


def _tell(shell: Shell, result: Result) -> None:
    seconds = f" ({duration(result.seconds)})" if result.outcome == "made" else ""
    colon = ": " if result.text else ""
    shell.note(result.node.output, f"{result.outcome}{colon}{result.text}{seconds}")
    for warning in filter(None, (result.problem, _doubts(result.grade))):
        shell.warn(warning)


@app.command("run")
def run_experiment(
    experiment: ExperimentFile,
    run_dir: RunFolder = None,
    strict: Annotated[bool, typer.Option("--strict", help=_STRICT)] = False,
    as_json: AsJson = False,
    backend: Backend = None,
    workers: Workers = None,
    debug: Debug = False,
) -> int:
    """Runs everything that is not fresh, in order; goes on where a killed run stopped."""
    del debug
    run = _open(experiment, run_dir, backend, workers)
    shell = _shell(run, as_json=as_json)

    with locked(run.path(FOLDER_LOCK), f"robid run {experiment}"):
        results = run_all(run, lambda node: shell.progress(node.output), lambda result: _tell(shell, result))
    present = [path for result in results if result.outcome != "skipped" for path in result.node.plan.outputs]
    gathered = gather(run.loaded, run.folder, present)
    report = str(run.path("report.html"))
    if as_json:
        rows = {fit.headline.name: [dataclasses.asdict(row) for row in fit.parameters] for fit in gathered.fits}
        nodes = [
            {"output": result.node.output, "outcome": result.outcome, "text": result.text, "problem": result.problem}
            | _graded(result.grade)
            for result in results
        ]
        verdict = dataclasses.asdict(gathered.content.verdict)
        _print_json({"nodes": nodes, "parameters": rows, "verdict": verdict, "report": report})
        return _PROBLEM if any(result.fails(strict=strict) for result in results) else 0
    for fit in gathered.fits:
        if len(gathered.fits) > 1:
            shell.say(f"\nfit {fit.headline.name}")
        for table in fit.terminal:
            shell.out.print(table)
        if fit.headline.advice:
            shell.say(f"advice: {fit.headline.advice}")
    shell.say(f"\n{gathered.content.verdict.text}")
    shell.say(f"report: {report}")
    return _PROBLEM if any(result.fails(strict=strict) for result in results) else 0


@app.command("study")
def run_a_study(
    experiment: ExperimentFile,
    run_dir: RunFolder = None,
    force: Annotated[bool, typer.Option("--force", help="Do the tasks again that are done.")] = False,
    as_json: AsJson = False,
    backend: Backend = None,
    workers: Workers = None,
    debug: Debug = False,
) -> int:
    """Runs the study of an experiment file; goes on where a stopped one was."""
    del debug
    run = _open(experiment, run_dir, backend, workers)
    shell = _shell(run, as_json=as_json)
    with locked(run.path(FOLDER_LOCK), f"robid study {experiment}"):
        made = run_study(run, shell.progress, lambda result: _tell(shell, result), force=force)
    report = str(run.path("report.html"))
    if as_json:
        summary = read_json(run.path("summary.json"))
        verdict = dataclasses.asdict(made.conclusion.verdict)
        _print_json({"outcome": made.outcome, "summary": summary, "verdict": verdict, "report": report})
        return 0
    for warning in made.conclusion.warnings:
        shell.warn(warning)
    for section in made.conclusion.sections:
        for table in section.tables:
            shell.say("")
            shell.out.print(section_table(table.title or section.title, table.columns, table.texts))
    shell.say(f"\n{made.conclusion.verdict.text}\n{report}  {made.outcome}")
    return 0


@app.command("export")
def export_model(
    experiment: ExperimentFile,
    format_: Annotated[
        str,
        typer.Option("--format", help="What to write: mjcf, json, csv, mat, statespace; of a campaign csv, mat."),
    ],
    fit: Annotated[
        str | None, typer.Option("--fit", help="Name of the fit; may be left out if it is the only one.")
    ] = None,
    campaign: Annotated[
        str | None,
        typer.Option("--campaign", help="Name of a campaign, to write its excitation (csv, mat) instead of a fit."),
    ] = None,
    configuration: Annotated[
        int | None,
        typer.Option("--configuration", min=0, help="Index of one configuration; all of the fit by default."),
    ] = None,
    friction: Annotated[
        bool | None,
        typer.Option("--friction/--no-friction", help="MJCF: with friction and ripple (default), or without."),
    ] = None,
    output: Annotated[Path | None, typer.Option("--output", help="Write here instead of the fit's folder.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a file that differs.")] = False,
    run_dir: RunFolder = None,
    as_json: AsJson = False,
    debug: Debug = False,
) -> int:
    """Writes a fitted model, or the excitation of a campaign, for other programs: MJCF, JSON, CSV, MAT, state space."""
    del debug
    run = _open(experiment, run_dir, None, None)
    if campaign is not None:
        given = {"--fit": fit, "--configuration": configuration, "--friction": friction}
        others = [name for name, value in given.items() if value is not None]
        excitation = ExcitationExport(campaign, format_, output)
        check_excitation_export(excitation, others)
        return _export_excitation(run, excitation, force=force, as_json=as_json)
    node = choose_node(run, "fit", fit)
    options = ExportOptions(format_, configuration, friction, output)
    check_options(options, run.loaded, node.owner)
    inputs = require_inputs(run, dataclasses.replace(node, plan=export_plan(run.loaded, node.owner)), [])
    content, target = (
        export(options, run.loaded, node.owner, inputs),
        export_target(options, run.loaded, node.owner, run.folder),
    )
    with locked(_lock(run, target), f"robid export {experiment}"):
        outcome = write_export(target, content, {**settings_files(run.loaded), **inputs}, force=force)
    shell = _shell(run, as_json=as_json)
    problem = node.stage.problem(inputs["model"])
    if as_json:
        _print_json({"output": str(target), "format": format_, "outcome": outcome, "problem": problem})
    else:
        shell.say(f"{target}  {outcome}")
    if problem:
        shell.warn(problem)
    return 0


def _export_excitation(run: Run, options: ExcitationExport, *, force: bool, as_json: bool) -> int:
    node = choose_node(run, "design-excitation", options.campaign)
    plan = excitation_export_plan(node.owner)
    inputs = require_inputs(run, dataclasses.replace(node, plan=plan), [])
    files = export_excitation(options, run.loaded, inputs["excitation"], run.folder)
    read = {**settings_files(run.loaded), **inputs}
    with locked(_lock(run, options.target(run.folder)), f"robid export {run.loaded.path}"):
        outcomes = {str(path): write_export(path, content, read, force=force) for path, content in files.items()}
    if as_json:
        _print_json({"output": str(options.target(run.folder)), "format": options.format, "files": outcomes})
        return 0
    shell = _shell(run, as_json=False)
    for path, outcome in outcomes.items():
        shell.say(f"{path}  {outcome}")
    return 0


@app.command("status")
def show_status(
    experiment: ExperimentFile, run_dir: RunFolder = None, as_json: AsJson = False, debug: Debug = False
) -> int:
    """Says what is fresh, stale or missing, and why."""
    del debug
    run = _open(experiment, run_dir, None, None)
    states = examine(run, asked_for(run.loaded))
    if as_json:
        nodes = [
            {"stage": node.stage.name, "for": node.owner, "output": node.output}
            | {"status": state.status, "why": state.why, "problem": state.problem}
            | _graded(grade_of(run, node) if state.status == "fresh" else None)
            for node, state in states.items()
        ]
        _print_json({"run_dir": str(run.folder), "nodes": nodes})
        return 0
    rows = [
        (node.output, state.status, state.why or state.problem or _doubts(grade_of(run, node)).partition(":")[0])
        if state.status == "fresh"
        else (node.output, state.status, state.why or state.problem)
        for node, state in states.items()
    ]
    make_console(stderr=False).print(status_table(rows))
    return 0


@app.command("inspect")
def inspect_file(
    artifact: Annotated[Path, typer.Argument(metavar="ARTIFACT", help="An artifact, as in record.h5.")],
    as_json: AsJson = False,
    debug: Debug = False,
) -> int:
    """Describes an artifact: what it holds, in which units, and how it came about."""
    del debug
    found = inspect_artifact(artifact)
    if as_json:
        _print_json(found)
        return 0
    out, made = make_console(stderr=False), found["provenance"]
    lines = [
        f"{found['kind']} {found['schema_version']}, content {found['content_sha256']}",
        f"made by {made['stage']} at {made['finished_utc']} with robid {made['versions'].get('robid', 'unknown')}",
        *(f"from {name} {digest}" for name, digest in made["inputs"].items()),
        *(f"{name} = {value}" for name, value in found["attributes"].items()),
        *channel_lines(found["datasets"]),
    ]
    for line in lines:
        out.print(line, markup=False, highlight=False, soft_wrap=True)
    out.print(dataset_table(found["datasets"]))
    return 0


@app.command("schema")
def show_schema(
    robot: Annotated[bool, typer.Option("--robot", help="That of the robot file instead.")] = False,
    as_json: AsJson = False,
    debug: Debug = False,
) -> int:
    """Prints the JSON schema of the experiment file, for editors."""
    del as_json, debug
    _print_json(robot_schema() if robot else experiment_schema())
    return 0


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"robid {robid.__version__}")
        raise typer.Exit


@app.callback()
def _common(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    del version
