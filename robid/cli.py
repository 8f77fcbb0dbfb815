"""The command line: arguments in, exit code out. What a command does is imported when it is called: help is quick."""

import errno
import gc
import sys
import traceback
from contextlib import suppress
from copy import copy
from pathlib import Path
from typing import Annotated, Literal

import typer

from robid.commands import own_options as own
from robid.commands.options import (
    AsJson,
    Backend,
    Debug,
    ExperimentFile,
    RunFolder,
    Scheduler,
    Strict,
    Workers,
    answering_commands,
    known_codes,
)
from robid.commands.output import ErrorAnswer, print_json, print_plain
from robid.commands.stages import stage_command
from robid.errors import ArtifactError, RobidError, SettingsError, codes_in
from robid.interrupts import code_of_interrupt, forget_interrupts, hearing, was_interrupted
from robid.pipeline.chain import STAGES
from robid.pipeline.graph import Run
from robid.printable import printable
from robid.streams import prepare_streams
from robid.versions import __version__

_INTERRUPTED = 130
_LONGEST_S = 1e9
_SHOWN = 60
_UsageError: type[Exception] = typer.BadParameter.__bases__[0]

app = typer.Typer(
    help="Identifies the elastic dynamics of a robot from its own motor signals.",
    epilog="Example: robid init first --example drive && robid run first/first.yaml",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Runs the command line and exits with its code."""
    prepare_streams()
    try:
        code = run_command(sys.argv[1:])
    except KeyboardInterrupt:  # a second one, while the first was answered
        code = code_of_interrupt()
    finally:
        with suppress(RobidError, KeyboardInterrupt):
            sys.stdout.flush()
    forget_interrupts()
    # What is left ends with the process: looking through it for garbage takes a quarter of a short command's time.
    gc.freeze()
    sys.exit(code)


def run_command(arguments: list[str]) -> int:
    """Runs a command; every error becomes one message and an exit code."""
    with hearing():
        return _run(arguments)


def _run(arguments: list[str]) -> int:
    try:
        code = _app_for(arguments)(arguments or ["--help"], prog_name="robid", standalone_mode=False)
        sys.stdout.flush()
    except (KeyboardInterrupt, typer.Abort):
        return _stop(arguments)
    except Exception as error:  # noqa: BLE001  the one place that turns a defect into a message
        return _stop(arguments) if was_interrupted() else _fail(arguments, *_told(error))
    # typer answers an interrupt with a code.
    return _stop(arguments) if code == _INTERRUPTED else int(code or 0)


def _stop(arguments: list[str]) -> int:
    message = "interrupted; what is finished is kept, and the same command goes on from there"
    return _fail(arguments, message, code_of_interrupt())


def _app_for(arguments: list[str]) -> typer.Typer:
    """The commands, or only the one that is called: to lay out the options of all takes a while."""
    called = [one for one in app.registered_commands if one.name in arguments[:1]]
    alone = copy(app)
    alone.registered_commands = called or app.registered_commands
    return alone


def _told(error: Exception) -> tuple[str, int]:
    """Message and exit code of an error."""
    if isinstance(error, RobidError):
        return str(error), error.exit_code
    if isinstance(error, _UsageError):
        message = getattr(error, "format_message", error.__str__)()
        called = getattr(getattr(error, "ctx", None), "command_path", "robid")
        return f"S377 {printable(message, keep='')}\n  remedy: `{called} --help` lists what there is", 2
    if isinstance(error, OSError) and error.errno == errno.ENAMETOOLONG:
        what = f"A041 A path is longer than the system takes: {str(error.filename or '')[:_SHOWN]}..."
        return f"{what}\n  remedy: name another folder with --run-dir, or shorten the name", ArtifactError.exit_code
    first = (str(error) or "no message").splitlines()[0]
    remedy = "report it with what --debug prints"
    return f"a defect of ours: {type(error).__name__}: {first}\n  remedy: {remedy}", 1


def _fail(arguments: list[str], message: str, code: int) -> int:
    from robid.report.wrapping import terminal_width, wrap

    if "--debug" in arguments:
        typer.echo(printable(traceback.format_exc()), err=True)
    typer.echo(wrap(printable(f"robid: {message}"), terminal_width(sys.stderr)), err=True)
    codes = codes_in(message)
    if codes and sys.stderr.isatty():
        typer.echo(f"  `robid explain {codes[0]}` says more", err=True)
    if "--json" in arguments:
        print_json(ErrorAnswer(message, codes, code), one_line="--stream" in arguments)
    return code


def _open(
    path: Path,
    folder: Path | None,
    backend: Literal["serial", "processes", "dask"] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
) -> Run:
    from robid.commands.shared import open_run

    return open_run(path, folder, backend, workers, scheduler)


for _stage in STAGES:
    app.command(_stage.name, help=_stage.does)(stage_command(_stage))


@app.command("run")
def run_everything(
    experiment: ExperimentFile,
    run_dir: RunFolder = None,
    strict: Strict = False,
    as_json: AsJson = False,
    dry: Annotated[
        bool, typer.Option("--dry-run", help="Say what would be made and what it needs; make and write nothing.")
    ] = False,
    backend: Backend = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    _debug: Debug = False,
) -> int:
    """Runs everything that is not fresh, in order; goes on where a killed run stopped."""
    run = _open(experiment, run_dir, backend, workers, scheduler)
    if dry:
        from robid.commands.dry_run import dry_run

        return dry_run(run, as_json=as_json)
    from robid.commands.run import run_experiment

    return run_experiment(run, strict=strict, as_json=as_json)


@app.command("reprocess")
def reprocess_rows(
    manifest: own.Manifest,
    experiment: own.RowExperiment,
    run_dir: RunFolder = None,
    keep: own.Keep = False,
    force: own.ForceRows = False,
    row_timeout: own.RowTimeout = None,
    pages: own.Pages = "flagged",
    strict: own.StrictRows = False,
    as_json: AsJson = False,
    stream: own.Stream = False,
    dry_run: own.DryRows = False,
    backend: Backend = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    _debug: Debug = False,
) -> int:
    """Runs an experiment for every row of a manifest, only what changed; results in one table."""
    from robid.commands.reprocess import reprocess
    from robid.fleet.run import Options

    if row_timeout is not None and not row_timeout < _LONGEST_S:
        raise typer.BadParameter(f"{row_timeout:g} is no time that a row may take", param_hint="--row-timeout")
    options = Options(keep, force, row_timeout, pages)
    return reprocess(
        manifest,
        experiment,
        run_dir,
        options,
        backend,
        workers,
        scheduler,
        strict=strict,
        as_json=as_json,
        stream=stream,
        dry_run=dry_run,
    )


@app.command("study")
def run_a_study(
    experiment: ExperimentFile,
    run_dir: RunFolder = None,
    force: Annotated[bool, typer.Option("--force", help="Do the tasks again that are done.")] = False,
    as_json: AsJson = False,
    backend: Backend = None,
    workers: Workers = None,
    scheduler: Scheduler = None,
    _debug: Debug = False,
) -> int:
    """Runs the study of an experiment file; goes on where a stopped one was."""
    from robid.commands.shared import open_run
    from robid.commands.study import study_experiment
    from robid.studies.settings.study import load_with_study

    run = open_run(experiment, run_dir, backend, workers, scheduler, load_with_study)
    return study_experiment(run, force=force, as_json=as_json)


@app.command("export")
def export_model(
    experiment: ExperimentFile,
    format_: own.ExportFormat,
    fit: own.FitName = None,
    campaign: own.CampaignName = None,
    what: own.WhatOfCampaign = None,
    configuration: own.ConfigurationNumber = None,
    friction: own.WithFriction = None,
    output: own.ExportOutput = None,
    force: own.ForceFile = False,
    run_dir: RunFolder = None,
    as_json: AsJson = False,
    _debug: Debug = False,
) -> int:
    """Writes a fitted model, or the excitation or responses of a campaign, for other programs."""
    from robid.commands.export import export_campaign, export_fit, export_response
    from robid.pipeline.export import ExportOptions
    from robid.pipeline.export_campaign import ExcitationExport, FrfExport

    run, index = _open(experiment, run_dir), None if configuration is None else configuration - 1
    if what == "frf":
        of_fits = {"--fit": fit, "--friction": friction}
        others = [name for name, value in of_fits.items() if value is not None]
        response = FrfExport(campaign or "", format_, index, output)
        return export_response(run, campaign, response, others, force=force, as_json=as_json)
    if campaign is None and what is not None:
        raise SettingsError("S002 `--what` is about a campaign", where="export", remedy="name it with --campaign")
    if campaign is None:
        options = ExportOptions(format_, index, friction, output)
        return export_fit(run, fit, options, force=force, as_json=as_json)
    given = {"--fit": fit, "--configuration": configuration, "--friction": friction}
    others = [name for name, value in given.items() if value is not None]
    return export_campaign(run, ExcitationExport(campaign, format_, output), others, force=force, as_json=as_json)


@app.command("compare")
def compare_frfs(
    responses: Annotated[
        list[str],
        typer.Argument(
            metavar="RESULT...",
            help="Two run folders, as runs/kr300 (RUN:FIT for one of its fits); or two to six responses, each"
            " EXPERIMENT.yaml:CAMPAIGN (its run folder is runs/<name>) or a frf.h5; the first is the reference.",
        ),
    ],
    output: Annotated[Path | None, typer.Option("--output", help="Write a page (.html) that overlays them.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a page that differs.")] = False,
    as_json: AsJson = False,
    _debug: Debug = False,
) -> int:
    """Sets the fits of two runs, or frequency responses, side by side, and says where they differ."""
    from robid.commands.compare import compare_responses
    from robid.commands.compare_runs import compare_runs, names_runs

    chosen = compare_runs if names_runs(responses) else compare_responses
    return chosen(responses, output, force=force, as_json=as_json)


@app.command("status")
def tell_status(
    experiment: ExperimentFile, run_dir: RunFolder = None, as_json: AsJson = False, _debug: Debug = False
) -> int:
    """Says what is fresh, stale or missing, and why."""
    from robid.commands.status import show_status

    return show_status(_open(experiment, run_dir), as_json=as_json)


@app.command("upgrade")
def upgrade_settings(
    files: Annotated[list[Path], typer.Argument(metavar="FILE...", help="Experiment and robot files.")],
    as_json: AsJson = False,
    _debug: Debug = False,
) -> int:
    """Rewrites experiment and robot files of an older schema version; comments and layout stay."""
    from robid.commands.upgrade import upgrade_files

    return upgrade_files(files, as_json=as_json)


@app.command("inspect")
def inspect_file(
    files: own.InspectedFiles,
    output: own.DrawnPage = None,
    propose: own.Propose = None,
    format_: own.FormatOfLog = None,
    dialect: own.DialectMarks = None,
    sampling_period_s: own.SamplingPeriod = None,
    as_json: AsJson = False,
    _debug: Debug = False,
) -> int:
    """Says what is in an artifact; of a log also what its variables look like, and how to import it."""
    from robid.commands.inspect import LogInspection, describe_artifact, is_artifact, read_dialect

    options = LogInspection(format_, sampling_period_s, output, propose, read_dialect(dialect or []))
    if is_artifact(files[0]):
        return describe_artifact(files, options, as_json=as_json)
    from robid.settings.other_files import refuse_no_log

    for file in files:
        refuse_no_log(file)
    from robid.commands.inspect_log import describe_log
    from robid.commands.inspect_response import describe_response, found_response

    response = found_response(files, options)
    if response is not None:
        return describe_response(response, options, as_json=as_json)
    return describe_log(files, options, as_json=as_json)


@app.command("init")
def start_experiment(
    folder: Annotated[
        Path, typer.Argument(metavar="NAME", help="The folder to make; the experiment is named as it is.")
    ],
    example: Annotated[
        Literal["kr300", "rail", "drive"] | None,
        typer.Option("--example", help="Begin with an example; `drive` is a single geared drive, done in seconds."),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option("--model", metavar="FILE", help="Begin with a rigid URDF or MJCF of your robot; it is copied."),
    ] = None,
    log: Annotated[
        Path | None,
        typer.Option("--log", metavar="FILE", help="With --model: a log of the robot, to identify it from."),
    ] = None,
    as_json: AsJson = False,
    _debug: Debug = False,
) -> int:
    """Makes a folder with the files of a first experiment."""
    from robid.commands.init import start

    return start(folder, example, model, log, as_json=as_json)


@app.command("doctor")
def check_installation(as_json: AsJson = False, _debug: Debug = False) -> int:
    """Says whether the installation works: packages, backends, a small identification with a known truth."""
    from robid.commands.doctor import examine_installation

    return examine_installation(as_json=as_json)


@app.command("explain")
def explain_codes(
    codes: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[CODE...]",
            help="Codes of messages, as S007, or `grades`, or one of them; without any: what letters stand for.",
            autocompletion=known_codes,
        ),
    ] = None,
    as_json: AsJson = False,
    _debug: Debug = False,
) -> int:
    """Says what the code of a message or a grade means, why it stands and what to do."""
    from robid.commands.explain import explain

    return explain(codes or [], as_json=as_json)


@app.command("schema")
def show_schema(
    robot: Annotated[bool, typer.Option("--robot", help="That of the robot file instead.")] = False,
    command: Annotated[
        str | None,
        typer.Option(
            "--of",
            metavar="COMMAND",
            help="That of what a command prints with --json instead.",
            autocompletion=answering_commands,
        ),
    ] = None,
    _as_json: AsJson = False,
    _debug: Debug = False,
) -> int:
    """Prints the JSON schema of the experiment file, for editors."""
    if command is not None:
        from robid.commands.answers import schema_of

        if robot:
            what = "S546 `--robot` and `--of` name two schemas"
            raise SettingsError(what, where="schema", remedy="leave out one of them")
        print_plain(schema_of(command))
        return 0
    from robid.models.known import experiment_schema
    from robid.settings.load import robot_schema
    from robid.studies.settings.study import Study

    print_plain(robot_schema() if robot else experiment_schema(study=Study))
    return 0


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"robid {__version__}")
        raise typer.Exit


@app.callback()
def _common(
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


_EXAMPLES = {
    "design-configs": "design-configs configs/kr300.yaml",
    "design-excitation": "design-excitation configs/kr300.yaml --campaign estimation",
    "simulate-or-acquire": "simulate-or-acquire configs/kr300.yaml --campaign estimation",
    "estimate-frf": "estimate-frf configs/kr300.yaml --campaign estimation",
    "fit": "fit configs/kr300.yaml --try load_damping",
    "validate": "validate configs/kr300.yaml --strict",
    "report": "report configs/kr300.yaml",
    "run": "run configs/kr300.yaml --workers 2",
    "reprocess": "reprocess configs/fleet/robots.csv configs/fleet/arm.yaml",
    "study": "study configs/studies/frf.yaml",
    "export": "export configs/kr300.yaml --format mjcf",
    "compare": "compare configs/kr300.yaml:estimation configs/kr300.yaml:validation",
    "status": "status configs/kr300.yaml",
    "upgrade": "upgrade configs/kr300.yaml",
    "inspect": "inspect bench.mcap --propose bench.yaml",
    "init": "init first --example drive",
    "doctor": "doctor",
    "explain": "explain D184 F020",
    "schema": "schema --robot",
}
for _command in app.registered_commands:
    # The list of commands would cut what they do at 45 characters.
    _command.short_help = _command.help = _command.help or str(_command.callback.__doc__)
    _command.epilog = f"Example: robid {_EXAMPLES[str(_command.name)]}"
