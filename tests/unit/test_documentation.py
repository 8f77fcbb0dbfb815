"""What the documentation promises: examples load, commands parse, links lead somewhere, tables are the schemas'."""

import functools
import re
import shlex
import subprocess

import pytest
import typer

import json_tables
import robid
from robid.artifacts.kinds import DESIGN, EXCITATION, FRF, RECORD
from robid.artifacts.results import MODEL, VALIDATION
from robid.cli import app, run_command
from robid.errors import ArtifactError, DataError, SettingsError
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.known import FAMILIES, load_experiment
from robid.pipeline.graph import graph
from robid.settings.load import load_robot
from robid.simulate.truth import true_robot
from settings_tables import PAGES, ROOT, marked, renewed

DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "data/SOURCES.md",
    *sorted((ROOT / "docs").rglob("*.md")),
]
NAMES = [str(path.relative_to(ROOT)) for path in DOCUMENTS]
README = (ROOT / "README.md").read_text(encoding="utf-8")
START = (ROOT / "docs/start.md").read_text(encoding="utf-8")
CHAIN = (ROOT / "docs/concepts/chain.md").read_text(encoding="utf-8")
EXIT_CODES = (ROOT / "docs/reference/exit-codes.md").read_text(encoding="utf-8")
EXAMPLES = sorted((ROOT / "configs").glob("*.yaml"))
ROBOTS = sorted((ROOT / "configs/robots").glob("*.yaml"))
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)
PLACEHOLDER = "EXPERIMENT.yaml"
GENERATED = set(re.findall(r'"(reference/\w+\.md)":', (ROOT / "docs/site/reference.py").read_text(encoding="utf-8")))
FOLDERS = ("configs", "data", "docs", "robid", "tests")


def text_of(path):
    return path.read_text(encoding="utf-8")


def commands(text):
    """Every `robid ...` of a page, in blocks and within lines, without what a shell does with its output."""
    blocks = [re.split(r" #| [|>] ", line)[0] for _, block in FENCE.findall(text) for line in block.splitlines()]
    inline = re.findall(r"`([^`\n]+)`", FENCE.sub("", text))
    return [line.removeprefix(".venv/bin/") for line in [*blocks, *inline] if re.match(r"(\.venv/bin/)?robid ", line)]


def written(text):
    """Files that a page has its reader write, and those that its commands write."""
    code = "\n".join(block for _, block in FENCE.findall(text))
    begun = {f"{name}/{name}.yaml" for name in re.findall(r"^robid init (\w+) ", code, re.MULTILINE)}
    return begun | {
        *re.findall(r"^# (\w+\.yaml)$", code, re.MULTILINE),
        *re.findall(r"--(?:propose|output) (\S+)", code),
    }


@functools.cache
def outputs_of(example):
    loaded = load_experiment(example)
    return {f"runs/{loaded.experiment.name}/{path}" for node in graph(loaded) for path in node.plan.outputs}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_every_example_loads(path):
    experiment = load_experiment(path).experiment
    assert experiment.fits or all(
        campaign.is_arbitrary or campaign.finds_lines for campaign in experiment.campaigns.values()
    )


@pytest.mark.parametrize("path", ROBOTS, ids=lambda path: path.stem)
def test_every_robot_file_loads(path):
    assert load_robot(path).joints


def test_a_section_that_only_its_class_describes_has_one_line_that_is_written_anew():
    part = {"description": "Does\nthis.\n\nAttributes:\n    kind: Of what.", "properties": {}}
    schema = {"$defs": {"Part": part, "Whole": {"properties": {"part": {"$ref": "#/$defs/Part"}}}}}
    once = renewed("<!-- settings: Whole -->\n\nMore.\n", schema)
    assert "| `part` | section |  | Does this. |\n\nMore.\n" in once
    assert renewed(once, schema) == once


@pytest.mark.parametrize("pages", PAGES)
def test_tables_are_those_of_the_schema(pages):
    texts, schema = [text_of(ROOT / page) for page in pages], PAGES[pages]()
    assert sorted(marked("".join(texts))) == sorted(["file", *schema["$defs"]]), "each section has its table, once"
    for text in texts:
        assert renewed(text, schema) == text, "`.venv/bin/python tests/settings_tables.py` writes the tables anew"


def test_tables_of_answers_are_those_of_their_schemas():
    text = text_of(json_tables.PAGE)
    assert sorted(json_tables.marked(text)) == sorted(json_tables.types()), "each type of answer has its table, once"
    told = "raise the version of what changed; then `.venv/bin/python tests/json_tables.py` writes the tables anew"
    assert json_tables.renewed(text) == text, told


@pytest.mark.parametrize("name", NAMES)
def test_commands_parse_and_name_files_that_exist(name):
    group = typer.main.get_command(app)
    made = {path for example in EXAMPLES for path in outputs_of(example)}
    made |= written(text_of(ROOT / name))
    for command in commands(text_of(ROOT / name)):
        _, stage, *arguments = shlex.split(command)
        assert stage in group.commands, command
        if arguments and "--help" not in arguments:
            group.commands[stage].make_context(stage, list(arguments))
        for word in arguments:
            if word.endswith((".yaml", ".h5", ".html")) and word != PLACEHOLDER:
                assert word in made or (ROOT / word).is_file(), command


def test_the_readme_is_short():
    assert len(README.splitlines()) <= 130


def test_the_pages_of_the_site_have_an_example_of_every_command():
    pages = [path for path in DOCUMENTS if ROOT / "docs" in path.parents]
    shown = {command.split()[1] for page in pages for command in commands(text_of(page))}
    assert set(typer.main.get_command(app).commands) <= shown


def test_the_chain_has_a_command_for_every_stage_in_its_order():
    in_order = list(dict.fromkeys(node.stage.name for node in graph(load_experiment(ROOT / "configs/kr300.yaml"))))
    shown = [command.split()[1] for command in commands(CHAIN.partition("## Run one stage")[2].partition("- A ")[0])]
    assert shown == in_order


def test_run_folder_of_the_chain_is_that_of_the_default_experiment():
    made = {path.removeprefix("runs/kr300/") for path in outputs_of(ROOT / "configs/kr300.yaml")}
    made = {path for path in made if not path.startswith("validation/")}
    picture, _, after = CHAIN.partition("## Stages and files")
    table = set(re.findall(r"`([\w/]+\.(?:h5|html|json))`", after.partition("## Run the whole chain")[0]))
    drawn = set(re.findall(r"[\w/]+\.(?:h5|html|json)\b", picture))
    assert table == made
    assert drawn == made - {"estimation/truth.json"}


@pytest.mark.parametrize("name", [*NAMES, "CHANGELOG.md"])
def test_links_and_paths_lead_somewhere(name):
    page = ROOT / name
    text = FENCE.sub("", text_of(page))
    for target in re.findall(r"\]\(([^)]+)\)", text):
        path, _, anchor = target.partition("#")
        found = (page.parent / path).resolve() if path else page
        if found.is_relative_to(ROOT / "docs") and str(found.relative_to(ROOT / "docs")) in GENERATED:
            assert ROOT / "docs" in page.parents, "only the site has pages that the code writes"
            continue
        assert found.exists(), target
        if anchor:
            assert anchor in anchors(text_of(found)), target
    for path in re.findall(rf"`((?:{'|'.join(FOLDERS)})/[\w./-]*)`", text):
        assert (ROOT / path).exists(), path


def anchors(text):
    """Anchors of a page's headings, as GitHub makes them."""
    headings = re.findall(r"^#+ (.*)$", FENCE.sub("", text), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("name", NAMES)
def test_make_targets_exist(name):
    targets = set(re.findall(r"^([a-z-]+):.*## ", text_of(ROOT / "Makefile"), re.MULTILINE))
    text = text_of(ROOT / name)
    code = [block for _, block in FENCE.findall(text)] + re.findall(r"`([^`\n]+)`", FENCE.sub("", text))
    for words in re.findall(r"\bmake ([a-z -]+)", "\n".join(code)):
        assert set(words.split()) <= targets, words


@pytest.mark.parametrize(
    "page", [path for path in DOCUMENTS if ROOT / "docs" in path.parents], ids=lambda path: path.stem
)
def test_complete_examples_in_pages_load(page, tmp_path):
    (tmp_path / "robots").mkdir()
    for robot in ROBOTS:
        (tmp_path / "robots" / robot.name).write_text(text_of(robot), encoding="utf-8")
    for index, (language, block) in enumerate(FENCE.findall(text_of(page))):
        if language == "yaml":
            file = tmp_path / f"{index}.yaml"
            file.write_text(block, encoding="utf-8")
            assert load_experiment(file).experiment.campaigns


FIGURE = re.compile(r"\d+(?:[.,]\d+)? ?(?:%|dB|Hz|kHz|ms|s|min|minutes|hours|kg|N m|rad|MB|kB)(?![\w/])")


def figures(text):
    return set(FIGURE.findall(FENCE.sub("", text)))


def defaults():
    """Defaults of a fit that pages name."""
    options = ElasticOptions()
    shares = (options.confidence, options.identifiable_relative_std, options.weights.model_error)
    return {f"{100 * share:g} %" for share in shares}


def measuring_time(experiment, campaign, configurations):
    """Minutes that a simulated campaign takes, transients included, as `design-excitation` prints them."""
    about = experiment.campaigns[campaign]
    periods = about.periods + about.source.simulate.transient_periods
    motors = len(load_robot(ROOT / "configs/robots/kr300.yaml").joints)
    minutes = configurations * about.realizations * motors * periods * about.excitation.period_s / 60
    return f"{minutes:g} min"


def of_the_default_experiment():
    """Band, rate and measuring times of the default experiment."""
    experiment = load_experiment(ROOT / "configs/kr300.yaml").experiment
    robot = load_robot(ROOT / "configs/robots/kr300.yaml")
    chosen = experiment.designs["optimal"].count
    fresh = experiment.campaigns["validation"].configurations.random.count
    return {
        f"{experiment.campaigns['estimation'].excitation.high_hz:g} Hz",
        f"{1e-3 / robot.controller.sampling_period_s:g} kHz",
        measuring_time(experiment, "estimation", chosen),
        measuring_time(experiment, "validation", fresh),
    }


def test_the_readme_has_no_figure_that_nothing_prints():
    assert figures(README) == defaults() | of_the_default_experiment(), (
        "only defaults and the default experiment's plan"
    )


def test_the_home_page_has_no_figure_that_nothing_prints():
    assert figures(text_of(ROOT / "docs/index.md")) <= of_the_default_experiment()


def test_payload_and_limit_of_the_start_page_are_those_of_the_default_experiment():
    assert load_robot(ROOT / "configs/robots/kr300.yaml").payload.mass_kg == 150
    assert figures(START) == {"95 %", "150 kg"}


def test_the_sample_output_is_of_the_default_experiment():
    robot = load_robot(ROOT / "configs/robots/kr300.yaml").to_robot()
    options = load_experiment(ROOT / "configs/kr300.yaml").experiment.campaigns["estimation"].source.simulate
    true = true_robot(robot, options.truth)
    row = re.compile(
        r"^  (\w+) .*? ([kM]?)N m(?: s)?/rad .*? (?:a )?([\d.]+) +([\d.]+) +[+\u2212][\d.]+ %$", re.MULTILINE
    )
    springs, dampers = START.partition("\nSprings\n")[2].partition("Equivalent")[0].split("Dampers\n")
    for block, field in ((springs, "stiffness"), (dampers, "damping")):
        rows = row.findall(block)
        assert len(rows) == len([line for line in block.splitlines() if line.startswith("  ") and "..." not in line])
        for name, prefix, nominal, truth in rows:
            factor = {"": 1.0, "k": 1e3, "M": 1e6}[prefix]
            for shown, described in ((nominal, robot), (truth, true)):
                value = next(getattr(spring, field) for spring in described.springs if spring.name == name) / factor
                assert f"{value:.{len(shown.partition('.')[2])}f}" == shown, name


def test_exit_codes_of_the_page_are_those_of_the_errors():
    codes = {int(code) for code in re.findall(r"^\| (\d+) \|", EXIT_CODES, re.MULTILINE)}
    assert codes == {0, 1, SettingsError.exit_code, ArtifactError.exit_code, DataError.exit_code, 5, 130, 143}
    for error, word in ((SettingsError, "settings"), (ArtifactError, "artifact"), (DataError, "data")):
        assert re.search(rf"^\| {error.exit_code} \| .*{word}", EXIT_CODES, re.MULTILINE)


def test_the_page_of_exports_has_every_format_of_each_family():
    text = text_of(ROOT / "docs/reference/exports.md")
    rows = dict(re.findall(r"^\| `(\w+)` \| ((?:`\w+`(?:, )?)+)", text.partition("| format |")[0], re.MULTILINE))
    assert {name: set(re.findall(r"\w+", formats)) for name, formats in rows.items()} == {
        name: set(family.exports) for name, family in FAMILIES.items()
    }


def test_the_changelog_tells_formats_and_default_numbers():
    text = text_of(ROOT / "CHANGELOG.md")
    versions = re.split(r"^## ", text, flags=re.MULTILINE)[1:]
    assert versions[0].startswith(robid.__version__)
    for version in versions:
        assert "\n### File formats\n" in version
        assert "\n### Default numbers\n" in version
    for kind in (EXCITATION, RECORD, FRF, DESIGN, MODEL, VALIDATION):
        assert f"`{kind.name}` {kind.version}" in text


def test_the_picture_is_small():
    assert 10_000 < (ROOT / "docs/report.png").stat().st_size < 300_000


def test_no_file_names_this_machine_or_a_registry():
    listed = subprocess.run(["git", "-C", str(ROOT), "ls-files"], capture_output=True, text=True, check=False).stdout
    if not listed:
        pytest.skip("not a checkout: there is no list of tracked files")
    paths = [ROOT / name for name in listed.splitlines()]
    texts = {path: text_of(path).lower() for path in paths if path.suffix != ".png" and path.is_file()}
    words = [f"/{name}/" for name in ("work", "tmp", "root", "home")] + ["py" + "pi", "index" + "-url"]
    assert len(texts) > 100
    assert [(str(path), word) for path, text in texts.items() for word in words if word in text] == []


def test_only_make_bench_collects_the_bench():
    names = [path.name for path in (ROOT / "tests/bench").glob("*.py")]
    assert any(name.startswith("bench_") for name in names)
    assert not any(name.startswith("test_") for name in names)
    makefile = text_of(ROOT / "Makefile")
    recipe = re.search(r"^bench:.*\n\t(.*)$", makefile, re.MULTILINE).group(1)
    assert recipe.startswith("$(BENCH) ")
    assert "python_files=bench_*.py" in re.search(r"^BENCH := (.*)$", makefile, re.MULTILINE).group(1)


def test_sections_of_methods_that_docstrings_cite_have_a_page():
    pages = {int(path.name[:2]) for path in (ROOT / "docs/methods").glob("[0-9]*.md")}
    source = "\n".join(text_of(path) for path in (ROOT / "robid").rglob("*.py"))
    cited = {
        int(number)
        for part in re.findall(r"docs/methods,\s+sec\. (\d+(?: and \d+)?)", source)
        for number in part.split(" and ")
    }
    assert cited
    assert cited <= pages


@pytest.mark.parametrize("name", ["", *typer.main.get_command(app).commands])
def test_help_fits_80_columns_and_ends_with_a_command_that_parses(name, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    assert run_command([*name.split(), "-h"]) == 0
    text = capsys.readouterr().out
    assert "..." not in re.sub(r"\b[A-Z]+\.\.\.", "", text.partition("\n")[2])
    assert max(map(len, text.splitlines())) <= 80
    if name:
        words = shlex.split(text.rpartition("Example: robid ")[2])
        assert words[0] == name
        typer.main.get_command(app).commands[name].make_context(name, words[1:])
