"""Arguments and options of single commands: of stages, `reprocess`, `export` and `inspect`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import typer

from robid.commands.options import export_formats, names_in
from robid.signals.log_options import LogFormat

# Of stages
Inputs: TypeAlias = Annotated[
    list[Path] | None,
    typer.Option("--input", metavar="FILE", help="Read this artifact instead of the run folder's. Can be repeated."),
]
Output: TypeAlias = Annotated[Path | None, typer.Option("--output", metavar="FILE", help="Write here instead.")]
ForceOutput: TypeAlias = Annotated[bool, typer.Option("--force", help="Replace an output that differs.")]
Try: TypeAlias = Annotated[
    list[str] | None,
    typer.Option(
        "--try",
        metavar="NAME",
        help="Refit from the minimum found with this in `free` too, and show both side by side; writes nothing unless"
        " --output says where. Can be repeated.",
    ),
]
NextAfter: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--next",
        metavar="FIT",
        help="Say which candidate to visit next after this fit, and what that would bring; writes nothing.",
        autocompletion=names_in("fits"),
    ),
]

# Of `reprocess`
Manifest: TypeAlias = Annotated[
    Path, typer.Argument(metavar="MANIFEST", help="The manifest, CSV or Parquet: a row a robot.")
]
RowExperiment: TypeAlias = Annotated[
    Path, typer.Argument(metavar="EXPERIMENT.yaml", help="The experiment file, with ${row.column} to be filled.")
]
Keep: TypeAlias = Annotated[bool, typer.Option("--keep", help="Keep records and responses of every row.")]
ForceRows: TypeAlias = Annotated[bool, typer.Option("--force", help="Try rows again that have failed.")]
RowTimeout: TypeAlias = Annotated[
    float | None,
    typer.Option(
        "--row-timeout", metavar="SECONDS", min=1e-3, help="Time that a row may take; then it fails, the rest goes on."
    ),
]
Pages: TypeAlias = Annotated[
    Literal["all", "none", "flagged"],
    typer.Option("--pages", help="Rows that get a page of their own; `flagged` are outliers and failures."),
]
StrictRows: TypeAlias = Annotated[
    bool,
    typer.Option("--strict", help="Exit with 5 if a row is graded *do not use* or off the fleet, or a robot drifts."),
]
Stream: TypeAlias = Annotated[
    bool, typer.Option("--stream", help="With --json: one object a row as it finishes, each on a line.")
]
DryRows: TypeAlias = Annotated[
    bool, typer.Option("--dry-run", help="Say which rows would be made, and why; make and write nothing.")
]

# Of `export`
ExportFormat: TypeAlias = Annotated[
    str,
    typer.Option(
        "--format",
        metavar="FORMAT",
        autocompletion=export_formats,
        help="What to write: mjcf, json, csv, mat, by family statespace, robot, urdf, control, hdf5; of a"
        " campaign's excitation csv, mat; of its responses csv, mat, json, uff.",
    ),
]
FitName: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--fit",
        metavar="NAME",
        help="Name of the fit; may be left out if it is the only one.",
        autocompletion=names_in("fits"),
    ),
]
CampaignName: TypeAlias = Annotated[
    str | None,
    typer.Option(
        "--campaign",
        metavar="NAME",
        help="Name of a campaign, to write its excitation or responses instead of a fit.",
        autocompletion=names_in("campaigns"),
    ),
]
WhatOfCampaign: TypeAlias = Annotated[
    Literal["excitation", "frf"] | None,
    typer.Option("--what", help="Of a campaign: its excitation (default), or its frequency responses (frf)."),
]
ConfigurationNumber: TypeAlias = Annotated[
    int | None, typer.Option("--configuration", min=1, help="Number of one configuration, from 1; all by default.")
]
WithFriction: TypeAlias = Annotated[
    bool | None,
    typer.Option("--friction/--no-friction", help="MJCF: with friction and ripple (default), or without."),
]
ExportOutput: TypeAlias = Annotated[
    Path | None, typer.Option("--output", help="Write here instead of the fit's folder.")
]
ForceFile: TypeAlias = Annotated[bool, typer.Option("--force", help="Replace a file that differs.")]

# Of `inspect`
InspectedFiles: TypeAlias = Annotated[
    list[Path],
    typer.Argument(metavar="FILE...", help="An artifact, as in record.h5; a log, or the files of one; or responses."),
]
DrawnPage: TypeAlias = Annotated[Path | None, typer.Option("--output", help="Draw the log here, as a page.html.")]
Propose: TypeAlias = Annotated[
    Path | None, typer.Option("--propose", help="Write the proposed experiment file here, as a new bench.yaml.")
]
FormatOfLog: TypeAlias = Annotated[
    LogFormat | None, typer.Option("--format", help="Format of the log; recognized from the file when not given.")
]
DialectMarks: TypeAlias = Annotated[
    list[str] | None,
    typer.Option("--dialect", help="How a table of text is written, as `header_line=3`; recognized when not given."),
]
SamplingPeriod: TypeAlias = Annotated[
    float | None, typer.Option("--sampling-period", help="Sampling period of a log that has no time [s].")
]
