"""Pages of the site that the code writes: commands, messages, artifacts, Python; and tutorials from their notebooks.

mkdocs calls `on_files` before it reads the pages.
"""

from __future__ import annotations

import ast
import dataclasses
import inspect
import io
import re
import textwrap
import tokenize
from collections.abc import Iterator
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import jupytext
import typer
from mkdocs.structure.files import File

import robid
from robid.arrays import quantities
from robid.artifacts.kinds import DESIGN, EXCITATION, FRF, RECORD
from robid.artifacts.results import MODEL, VALIDATION
from robid.cli import app
from robid.commands.explain import LETTERS, codes_explained, explanation, read_grades, read_texts
from robid.design.configurations.information import ConfigurationDesign
from robid.design.configurations.options import DesignOptions
from robid.design.excitation.excitation import CampaignExcitation
from robid.frf.frf import Frf
from robid.frf.options import EstimateOptions
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.external.fit.options import ExternalOptions
from robid.models.lpv.fit.options import LpvOptions
from robid.models.rigid.fit.options import RigidFitOptions
from robid.results.estimate import Estimate
from robid.results.grade import Grade
from robid.results.outcome import Outcome
from robid.signals.record import Record
from robid.signals.response_options import ResponseOptions

ARTIFACTS = (
    (EXCITATION, {"": CampaignExcitation}),
    (RECORD, {"": Record}),
    (FRF, {"": Frf}),
    (DESIGN, {"": ConfigurationDesign}),
    (MODEL, {"estimate/": Estimate, "grade/": Grade}),
    (VALIDATION, {"outcome/": Outcome, "grade/": Grade}),
)


OPTIONS: dict[str, dict[str, type]] = {
    "estimate_frf": {"": EstimateOptions},
    "choose_configurations": {"": DesignOptions},
    "make_responses": {"": ResponseOptions},
    "read_responses": {"": ResponseOptions},
    "fit_model": {"elastic": ElasticOptions, "rigid": RigidFitOptions, "external": ExternalOptions, "lpv": LpvOptions},
}
"""Options of functions of the Python interface, by what they belong to."""


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
    parts = ["# Messages", "`robid explain CODE` shows the same in a terminal, `robid explain grades` the grades."]
    parts += ["## Grades"]
    for name, one in read_grades().items():
        parts.append(f"### {name}\n\n{one.means}\n\n**Why** {one.why}\n\n**Do** {one.do}")
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
    for name in robid.__all__:
        if name == "__version__":
            continue
        parts.append(f"::: robid.{name}")
        value = getattr(robid, name)
        if dataclasses.is_dataclass(value):
            parts.append(fields(value))
        for kind, options in OPTIONS.get(name, {}).items():
            of = f'{name}("{kind}", ...)' if kind else f"{name}(...)"
            about = f"Options of `{of}`, by name:"
            parts += [about, options_table(options)]
    return "\n\n".join(parts) + "\n"


def fields(kind: type) -> str:
    """A table of a dataclass's fields: unit, axes and meaning, as their annotations or comments say them."""
    declares = any("Quantity(" in str(one) for one in kind.__annotations__.values())
    said, commented = quantities(kind) if declares else {}, comments(kind)
    rows = ["| field | unit | axes | meaning |", "|---|---|---|---|"]
    for field in dataclasses.fields(kind):
        about = said.get(field.name)
        unit, axes = ("", "") if about is None else (about.unit, ", ".join(about.axes.split()))
        told = ". ".join(text for text in (about.meaning if about else "", commented.get(field.name, "")) if text)
        rows.append(f"| `{field.name}` | {'' if unit == '1' else unit} | {axes} | {_cell(told)} |")
    return "\n".join(rows)


def comments(kind: type) -> dict[str, str]:
    """What comments say of each field of a dataclass: at the end of its line, or on the lines above it."""
    source = textwrap.dedent(inspect.getsource(kind))
    tokens = tokenize.generate_tokens(io.StringIO(source).readline)
    lines = {one.start[0]: one.string.lstrip("# ") for one in tokens if one.type == tokenize.COMMENT}
    body = ast.parse(source).body[0].body  # type: ignore[attr-defined]
    found, before = {}, 0
    for node in body:
        if isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            own = [lines[line] for line in range(before + 1, node.end_lineno + 1) if line in lines]
            found[node.target.id] = " ".join(own)
        before = node.end_lineno
    return found


def options_table(kind: type, prefix: str = "") -> str:
    """A table of options with defaults; a section's options stand below it as `section.option`."""
    return "\n".join(["| option | default | what |", "|---|---|---|", *_options(kind, prefix)])


def _options(kind: type, prefix: str) -> Iterator[str]:
    hints = get_type_hints(kind)
    for field in dataclasses.fields(kind):
        inner, described = hints[field.name], field.metadata.get("description", "")
        shown = "" if dataclasses.is_dataclass(inner) else _default(field)
        yield f"| `{prefix}{field.name}` | {shown} | {_cell(described)} |"
        if dataclasses.is_dataclass(inner):
            yield from _options(inner, f"{prefix}{field.name}.")


def _default(field: dataclasses.Field[Any]) -> str:
    if field.default_factory is not dataclasses.MISSING:
        return f"`{field.default_factory()!r}`"
    default = field.default
    if default is dataclasses.MISSING:
        return "required"
    return f"`{list(default) if isinstance(default, tuple) else default!r}`"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def tutorial(path: Path) -> str:
    """A notebook as a page, its cells of code as they are."""
    cells = jupytext.read(path).cells
    told = (one.source if one.cell_type == "markdown" else f"```python\n{one.source}\n```" for one in cells)
    return "\n\n".join(told) + f"\n\nThe notebook: `docs/tutorials/{path.name}`.\n"
