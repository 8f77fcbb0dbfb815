"""Sections of a study on the page: tables, curves, and both in a browser."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace

import pytest

from robid.report.charts import BodeMatrix, BodeResponse, Layer, Mark, Ratio, RatioChart, Waterfall
from robid.report.page import ReportContent, Verdict, render
from robid.report.section import Bars, Beside, Cell, Choice, Curve, Figure, Folded, Line, Notes, Row, Section, Table

CHROMIUM = next((found for name in ("chromium", "chromium-browser") if (found := shutil.which(name))), None)


def study_content():
    nan = float("nan")
    table = Table(("Method", "Error"), (("ours", "1.0 %"), ("<theirs>", "2.0 %")), caption="In per cent.", strong=0)
    curves = (Curve("ours", (1.0, 10.0), (0.123456789, nan)), Curve("theirs", (1.0, 10.0), (0.5, 0.7)))
    straight = Figure("Straight", "x", "y", curves, log_x=False, log_y=False)
    empty = Figure("Empty", "x", "y", (Curve("none", (1.0,), (nan,)),))
    sections = (
        Section("First", "A lead.", (table, Figure("Logarithmic", "f [Hz]", "e", curves))),
        Section("Second", parts=(straight, empty)),
    )
    return ReportContent("study", Verdict("All is known.", "ok"), "an arm", sections=sections)


def test_sentences_wrap_and_figures_stand_beside_each_other():
    table = Table(("Claim", "Found"), (("It is so.", "It is."),), prose=True)
    figure = Figure("Small", "", "", (Curve("a", (1.0,), (2.0,)),), y_range=(1.0, 4.0), height=150, legend=False)
    content = ReportContent("study", Verdict("All is known.", "ok"), "an arm")
    html = render(replace(content, sections=(Section("One", "", (table, Beside((figure, figure), 2))),)))
    assert '<table class="prose">' in html
    assert '<th scope="row">It is so.</th><td>It is.</td>' in html
    assert html.count('class="beside" style="--columns: 2"') == 1
    data = json.loads(re.search(r'id="data">(.*?)</script>', html, re.DOTALL).group(1))
    expected = {"y_range": [1.0, 4.0], "height": 150, "legend": False}
    assert {key: data["figures"][1][key] for key in expected} == expected


def test_tables_and_curves_stand_on_the_page():
    html = render(study_content())
    assert '<li><a href="#section-2">Second</a></li>' in html
    assert '<tr class="stressed"><th scope="row">ours</th><td class="n">1.0 %</td></tr>' in html
    assert "&lt;theirs&gt;" in html
    assert "<theirs>" not in html
    assert re.findall(r'data-figure="(\d)"', html) == ["0", "1", "2"]
    data = json.loads(re.search(r'id="data">(.*?)</script>', html, re.DOTALL).group(1))
    assert [figure["log_x"] for figure in data["figures"]] == [True, False, True]
    assert data["figures"][0]["curves"][0] == {"name": "ours", "x": [1.0, 10.0], "y": [0.12346, None]}


def test_a_page_without_sections_has_none():
    html = render(ReportContent("empty", Verdict("Nothing is known.", "warn"), "an arm"))
    assert "<section" not in html
    assert "data-figure=" not in html


def family_content(frf):
    """What a family that the page has never heard of could show."""
    models = (("first", frf.response), ("second", 2 * frf.response))
    response = BodeResponse("Measured", frf, models, (Mark(0, "motor", 53.9),), "what stands out")
    bode = BodeMatrix("", (response,), 0.9, "position", "position", "1")
    ratios = RatioChart(
        "",
        (("Masses", (Ratio("m1", 1.1, 1.0, 1.2, 1.05), Ratio("m2", 0.9, 0.5, 2.0, identifiable=False))),),
        "90 % interval",
    )
    bars = Bars(
        "", "Cost", ("1", "2", "1"), (("cost", (3.0, 4.0, 2.0)),), groups=(("seen", 2), ("new", 1)), marks=(1, None, 3)
    )
    points = Figure(
        "", "Start", "Cost", (Curve("best", (0.0, 1.0), (1.0, 2.0), ("a", "b"), points=True),), x_labels=("3", "7")
    )
    table = Table(
        ("Name", "Kind", "Share", ""),
        (
            Row(("m1", "mass", Cell("10 %", "good"), Cell("10 %", share=0.1)), group="Masses", choice="one"),
            Row(("f1", Cell("force", badge="b", hint="borrowed"), "1", "1"), faint=True, group="Forces", choice="two"),
        ),
        styles=("name", "text", "number", "meter"),
        choice="Side",
        footer=(("Sum", "2"),),
    )
    sections = (
        Section("Response", "", (bode, Notes(("a note",))), "response", "Fit rigid"),
        Section(
            "Parameters", "", (ratios, Beside((bars, points)), Folded("More", (table,))), "parameters", "Fit rigid"
        ),
        Section("Alone", "", (points,)),
    )
    return ReportContent("family", Verdict("It fits.", "ok"), "an arm", sections=sections)


def test_any_section_may_hold_any_figure(bench):
    html = render(family_content(bench.fit.frf))
    data = json.loads(re.search(r'id="data">(.*?)</script>', html, re.DOTALL).group(1))["figures"]
    assert [figure["kind"] for figure in data] == ["bode", "ratios", "bars", "curves", "curves"]
    assert data[0]["responses"][0]["models"] == ["first", "second"]
    assert data[0]["responses"][0]["configurations"][0]["marks"] == [["motor", 53.9]]
    assert data[2]["groups"] == [["seen", 2], ["new", 1]]
    assert data[2]["marks"] == [1.0, None, 3.0]
    assert html.index("Fit rigid") < html.index('<section id="response">') < html.index('<section id="section-3">')


def test_cells_say_more_than_their_text(bench):
    html = render(family_content(bench.fit.frf))
    assert '<td class="n"><span class="yes">10 %</span></td>' in html
    assert '<meter min="0" max="1" high="0.9" value="0.1">10 %</meter>' in html
    assert '<tr class="unidentified" data-choice="two">' in html
    assert '<abbr title="borrowed">b</abbr> force' in html
    assert "<abbr>b</abbr> borrowed." in html
    assert '<th colspan="4" scope="rowgroup">Forces</th>' in html
    assert '<th scope="row">Sum</th><td class="n" colspan="3">2</td>' in html
    (table,) = family_content(bench.fit.frf).sections[1].tables
    assert table.texts == (("m1", "mass", "10 %", "10 %"), ("f1", "force", "1", "1"))


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_every_kind_of_figure_is_drawn_in_any_section(tmp_path, bench):
    html = dumped(tmp_path, family_content(bench.fit.frf))
    assert len(re.findall(r'class="chart js-plotly-plot" data-figure', html)) == 4
    assert len(re.findall(r'class="cell"', html)) == 2
    assert "enlarge load position per motor position" in html
    for word in ("second", "before compensation", "estimate with 90 % interval", "not identifiable"):
        assert f"</i>{word}</span>" in html
    assert re.search(r'class="annotation-text"[^>]*>(<tspan[^>]*>)?new<', html)


def chosen_content():
    """Curves with bands, lines and symbols, of which the reader sees one at a time."""
    nan = float("nan")
    band = Curve(
        "model", (1.0, 2.0, 3.0, 4.0), (1.0, 2.0, nan, 2.0), lower=(0.5, 1.5, nan, 1.0), upper=(2.0, 3.0, nan, 4.0)
    )
    poles = Curve("poles", (-1.0,), (2.0,), points=True, symbol="cross", shade=1)
    first = Figure("Gain", "f [Hz]", "Gain", (band,), lines=(Line("y", 2.0, "limit"), Line("x", 3.0)))
    second = Figure("Plane", "Re", "Im", (poles,), log_x=False, log_y=False, equal=True, x_range=(-2.0, 0.0))
    table = Table(("Channel", "Gain"), (("X", "1"),))
    choice = Choice("Channel", (("X", (first,)), ("Y", (second, table))))
    return ReportContent("chosen", Verdict("It fits.", "ok"), "an arm", sections=(Section("One", "", (choice,)),))


def test_a_choice_holds_figures_and_tables():
    content = chosen_content()
    html = render(content)
    assert re.findall(r'data-option="(\w)"', html) == ["X", "Y"]
    gain, plane = json.loads(re.search(r'id="data">(.*?)</script>', html, re.DOTALL).group(1))["figures"]
    assert gain["curves"][0]["lower"] == [0.5, 1.5, None, 1.0]
    assert gain["lines"] == [{"along": "y", "at": 2.0, "name": "limit"}, {"along": "x", "at": 3.0, "name": ""}]
    poles = {"name": "poles", "x": [-1.0], "y": [2.0], "points": True, "symbol": "cross", "shade": 1}
    assert plane["curves"][0] == poles
    assert plane["equal"]
    assert [table.columns for table in content.sections[0].tables] == [("Channel", "Gain")]


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_what_is_chosen_is_drawn_and_the_rest_when_its_turn_comes(tmp_path):
    html = dumped(tmp_path, chosen_content())
    assert len(re.findall(r'class="chart js-plotly-plot"', html)) == 1
    assert ">limit<" in html
    assert html.count('hidden=""') == 1
    step = "document.querySelector('[aria-label=\"next channel\"]').click();"
    later = dumped(tmp_path, chosen_content(), f"<script>{step}</script>")
    assert len(re.findall(r'class="chart js-plotly-plot"', later)) == 2
    assert re.search(r'data-option="X" hidden=""', later)


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_curves_are_drawn_without_a_complaint(tmp_path):
    html = dumped(tmp_path, study_content())
    assert len(re.findall(r'class="chart js-plotly-plot"', html)) == 3
    assert len(re.findall(r'class="legendtext"', html)) >= 4


def space_content():
    """Curves behind one another, log and linear."""
    nan = float("nan")
    layers = (
        Layer("measured", (1.0, 10.0), ((1.0, 2.0), (3.0, nan)), "points"),
        Layer("model", (1.0, 5.0, 10.0), ((1.0, 1.5, 2.0), (3.0, 3.5, 4.123456)), "dashed"),
    )
    figures = (
        Waterfall("Gain", "f [Hz]", "slide [m]", "Gain [dB]", (-0.35, 0.4), layers),
        Waterfall("Turned", "f [Hz]", "slide [m]", "Phase", (-0.35, 0.4), layers[1:], log_x=False),
    )
    return ReportContent("space", Verdict("It fits.", "ok"), "a screw", sections=(Section("One", "", figures),))


def test_curves_in_space_reach_the_page():
    html = render(space_content())
    first, second = json.loads(re.search(r'id="data">(.*?)</script>', html, re.DOTALL).group(1))["figures"]
    assert (first["kind"], first["log_x"], second["log_x"]) == ("waterfall", True, False)
    assert first["places"] == [-0.35, 0.4]
    assert first["layers"][0] == {
        "name": "measured",
        "drawn": "points",
        "x": [1.0, 10.0],
        "heights": [[1.0, 2.0], [3.0, None]],
    }
    assert first["layers"][1]["heights"][1][2] == 4.1235


@pytest.mark.parametrize("heights", [((1.0, 2.0),), ((1.0, 2.0), (1.0,)), ()])
def test_a_curve_in_space_has_as_many_heights_as_places_and_lines(heights):
    with pytest.raises(ValueError, match="Layer `model` must have one height"):
        Waterfall("", "", "", "", (0.0, 1.0), (Layer("model", (1.0, 2.0), heights),))


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_curves_in_space_are_drawn_without_a_complaint(tmp_path):
    told = (
        "const first = document.querySelector('.js-plotly-plot');"
        "document.title = [...first.data.map((one) => one.x.length), first.layout.scene.xaxis.type].join(' ');"
    )
    html = dumped(tmp_path, space_content(), f"<script>{told}</script>", in_space=True)
    assert len(re.findall(r'class="gl-container"', html)) > 0
    assert "<title>6 8 log</title>" in html


def dumped(tmp_path, content, script="", *, in_space=False):
    """The page as a browser shows it, without a complaint."""
    page = tmp_path / "report.html"
    page.write_text(render(content).replace("</body>", f"{script}</body>"), encoding="utf-8")
    software = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
    flags = ("--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-sync")
    drawing = software if in_space else ("--disable-gpu",)
    quiet = ("--disable-background-networking", "--disable-component-update", "--enable-logging=stderr")
    profile = f"--user-data-dir={tmp_path / 'profile'}"
    command = [CHROMIUM, *flags, *drawing, *quiet, "--virtual-time-budget=8000", profile]
    done = subprocess.run(
        [*command, "--dump-dom", page.as_uri()], capture_output=True, text=True, timeout=90, check=True
    )
    told = [line for line in done.stderr.splitlines() if "CONSOLE" in line]
    assert [line for line in told if not (in_space and "willReadFrequently" in line)] == []
    return done.stdout
