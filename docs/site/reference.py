"""Pages of the site that the code writes: commands, messages, artifacts, Python; and tutorials from their notebooks.

mkdocs calls `on_files` before it reads the pages.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import jupytext
import robid
import typer
from mkdocs.structure.files import File
from robid.arrays import quantities
from robid.artifacts.kinds import DESIGN, EXCITATION, FRF, RECORD
from robid.artifacts.results import MODEL, VALIDATION
from robid.cli import app
from robid.commands.explain import LETTERS, codes_explained, explanation, read_texts
from robid.design.configurations.information import ConfigurationDesign
from robid.design.excitation.excitation import CampaignExcitation
from robid.frf.frf import Frf
from robid.results.estimate import Estimate
from robid.results.grade import Grade
from robid.results.outcome import Outcome
from robid.signals.record import Record

ARTIFACTS = (
    (EXCITATION, {"": CampaignExcitation}),
    (RECORD, {"": Record}),
    (FRF, {"": Frf}),
    (DESIGN, {"": ConfigurationDesign}),
    (MODEL, {"estimate/": Estimate, "grade/": Grade}),
    (VALIDATION, {"outcome/": Outcome, "grade/": Grade}),
)


def on_files(files: Any, config: Any) -> Any:
    """Adds the pages."""
    pages = {
        "reference/commands.md": commands(),
        "reference/messages.md": messages(),
        "reference/artifacts.md": artifacts(),
        "reference/python.md": python(),
        "reference/sources.md": Path(config.config_file_path)
        .with_name("data")
        .joinpath("SOURCES.md")
        .read_text("utf-8"),
    }
    for notebook in sorted(Path(config.docs_dir, "tutorials").glob("*.py")):
        pages[f"tutorials/{notebook.stem}.md"] = tutorial(notebook)
    for path, text in pages.items():
        files.append(File.generated(config, path, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Leads links of the repository to the pages of their files; the search lists decisions and studies last."""
    if page.file.src_uri.startswith(("decisions/", "reference/studies")):
        page.meta["search"] = {"boost": 0.2}
    up = "../" * page.file.src_uri.count("/")
    text = re.sub(r"\]\((?:\.\./)+data/SOURCES\.md", f"]({up}reference/sources.md", markdown)
    inside = r"[\w./-]*" if page.file.src_uri.startswith("tutorials/") else r"[\w./-]*tutorials/"
    return re.sub(rf"(\]\({inside}\w+)\.py\)", r"\1.md)", text)


def commands() -> str:
    """The page of the commands: their help, as a terminal shows it."""
    parts = ["# Commands", "`robid COMMAND -h` shows the same in a terminal."]
    for name, command in typer.main.get_command(app).commands.items():
        context = command.make_context(f"robid {name}", [], resilient_parsing=True, terminal_width=100)
        parts += [f"## {name}", f"```text\n{command.get_help(context)}\n```"]
    return "\n\n".join(parts) + "\n"


def messages() -> str:
    """The page of the messages, from their explanations."""
    parts = ["# Messages", "`robid explain CODE` shows the same in a terminal."]
    for letter, about in LETTERS.items():
        text = read_texts(letter)
        parts += [f"## {letter}: {about.kind}", f"About {about.about}. Exit code {about.exit_code}."]
        for code in codes_explained(text):
            one = explanation(code, text)
            parts += [f"### {code}", f"{one.means}\n\n**Why** {one.why}\n\n**Do** {one.do}"]
    return "\n\n".join(parts) + "\n"


def artifacts() -> str:
    """The page of the files, from the dataclasses that lie in them."""
    parts = ["# Artifacts", "HDF5 files. `robid inspect FILE` shows what is in one. Every dataset has the attributes"]
    parts[-1] += " `units` and `axes`; what only one kind of model has lies in a group of its name."
    for kind, inside in ARTIFACTS:
        parts += [f"## `{kind.name}` {kind.version}", f"Made by `{kind.made_by}`."]
        rows = [row for prefix, one in inside.items() for row in _datasets(one, prefix)]
        parts += ["\n".join(["| dataset | unit | axes | content |", "|---|---|---|---|", *rows])]
    return "\n\n".join(parts) + "\n"


def _datasets(kind: type, prefix: str) -> Iterator[str]:
    hints = get_type_hints(kind)
    for name, said in quantities(kind).items():
        inner = get_args(hints[name])
        row = inner[0] if get_origin(hints[name]) is tuple and inner and dataclasses.is_dataclass(inner[0]) else None
        for key in [""] if row is None else [f"/{field.name}" for field in dataclasses.fields(row)]:
            unit = "" if said.unit == "1" else said.unit
            yield f"| `{prefix}{name}{key}` | {unit} | {', '.join(said.axes.split())} | {said.meaning} |"


def python() -> str:
    """The page of the Python interface: what `robid` exports."""
    parts = ["# Python", "What `import robid` offers. [From Python](../how-to/python.md) shows how it is used."]
    parts += [f"::: robid.{name}" for name in robid.__all__ if name != "__version__"]
    return "\n\n".join(parts) + "\n"


def tutorial(path: Path) -> str:
    """A notebook as a page, its cells of code as they are."""
    cells = jupytext.read(path).cells
    told = (one.source if one.cell_type == "markdown" else f"```python\n{one.source}\n```" for one in cells)
    return "\n\n".join(told) + f"\n\nThe notebook: `docs/tutorials/{path.name}`.\n"
