"""Sections of a study on the page: tables, curves, and both in a browser."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace

import pytest

from robid.report.content import ReportContent, Verdict
from robid.report.page import render, write_report
from robid.report.section import Beside, Curve, Figure, Section, Table

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


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_curves_are_drawn_without_a_complaint(tmp_path):
    page = tmp_path / "report.html"
    write_report(page, study_content())
    flags = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync")
    quiet = ("--disable-background-networking", "--disable-component-update", "--enable-logging=stderr")
    command = [CHROMIUM, *flags, *quiet, "--virtual-time-budget=8000", f"--user-data-dir={tmp_path / 'profile'}"]
    done = subprocess.run(
        [*command, "--dump-dom", page.as_uri()], capture_output=True, text=True, timeout=90, check=True
    )
    assert [line for line in done.stderr.splitlines() if "CONSOLE" in line] == []
    assert len(re.findall(r'class="chart js-plotly-plot"', done.stdout)) == 3
    assert len(re.findall(r'class="legendtext"', done.stdout)) >= 4
