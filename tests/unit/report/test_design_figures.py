"""Figures of a design: what they hold, and that a browser draws them."""

from __future__ import annotations

import json
import re
import shutil
import subprocess

import numpy as np
import pytest

from robid.report.design import information_figure, skeleton_figure, weight_figure
from robid.report.page import ReportContent, Verdict, render
from robid.report.section import Beside, Section
from robid.studies.zimmermann2023.report import deviation_figures, step_response_figures
from robid.studies.zimmermann2023.steps import StepResponses

CHROMIUM = next((found for name in ("chromium", "chromium-browser") if (found := shutil.which(name))), None)
NAMES = ("7", "12")
POINTS = np.arange(2 * 3 * 3.0).reshape(2, 3, 3) / 10


def responses():
    time = np.linspace(0, 0.1, 3)
    path = np.zeros((2, 1, 3, 3))
    path[1, 0, :, :2] = [[0, 0], [3e-3, 4e-3], [6e-3, 8e-3]]
    tool = np.stack([path, path + np.array([0, 0, 1e-3])])
    torque = np.arange(2 * 2 * 3.0).reshape(2, 2, 1, 3)
    return StepResponses(
        time_s=time,
        models=("global", "optimal"),
        axes=("axis_1",),
        configurations=np.zeros((2, 1)),
        move_s=np.full((2, 1), 0.05),
        path=path,
        tool_true=tool,
        tool_model=tool + np.array([0, 0, 2e-3]),
        torque_true=torque,
        torque_model=torque + 1,
    )


def figures():
    counts = np.array([6.0, 24.0])
    sets = {"optimal": np.array([0.08, 0.04]), "guess": np.array([0.1, 0.05])}
    return (
        skeleton_figure(POINTS, np.array([0.25, 0.75]), NAMES, np.array([[1.0, 2.0, 3.0]])),
        weight_figure(np.array([0.25, 0.75, 1e-9]), (*NAMES, "nothing")),
        information_figure(np.array([[1.0, 2.0], [3.0, 6.0]]), ("gear_1", "gear_2"), NAMES),
        *deviation_figures(counts, sets, {name: 3 * values for name, values in sets.items()}),
        *step_response_figures(responses(), 1, 0, "optimal"),
    )


def page_of(*sections):
    return ReportContent("study", Verdict("All is known.", "ok"), "an arm", sections=sections)


def data_of(html):
    return json.loads(re.search(r'id="data">(.*?)</script>', html, re.DOTALL).group(1))["figures"]


def test_arms_and_bars_reach_the_page():
    arms, weights, information, *_ = data_of(render(page_of(Section("Design", parts=figures()))))
    assert arms["kind"] == "skeletons"
    assert (arms["names"][1], arms["weights"][1]) == ("12", 0.75)
    assert arms["points"][1] == [list(row) for row in POINTS[1].round(4)]
    assert arms["others"] == [[1.0, 2.0, 3.0]]
    assert weights["labels"] == list(NAMES)
    assert weights["parts"][0][1] == [0.25, 0.75]
    assert information["flat"]
    assert [values for _, values in information["parts"]] == [[0.25, 0.25], [0.75, 0.75]]


def test_deviations_are_in_per_cent_and_logarithmic():
    average, worst = data_of(render(page_of(Section("Design", parts=figures()))))[3:5]
    assert average["curves"][0] == {"name": "optimal", "x": [6.0, 24.0], "y": [8.0, 4.0]}
    assert worst["curves"][1]["y"] == [30.0, 15.0]
    assert average["log_x"]
    assert average["log_y"]


def test_a_step_shows_one_configuration_in_millimetres():
    displacement, torque, error, path = data_of(render(page_of(Section("Design", parts=figures()))))[5:]
    lengths = {curve["name"]: curve["y"] for curve in displacement["curves"]}
    assert lengths["rigid robot"] == [0.0, 5.0, 10.0]
    assert lengths["true robot"] == pytest.approx([1.0, 26**0.5, 101**0.5], rel=1e-4)
    assert [curve["y"] for curve in torque["curves"]] == [[9.0, 10.0, 11.0], [10.0, 11.0, 12.0]]
    assert [curve["y"] for curve in error["curves"]] == [[2.0, 2.0, 2.0]] * 2
    assert [curve["y"] for curve in path["curves"]] == [[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]


def test_names_and_points_must_agree():
    with pytest.raises(ValueError, match="n_conf=2"):
        skeleton_figure(POINTS[:1], np.ones(1), NAMES)


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_arms_and_bars_are_drawn_in_a_browser(tmp_path):
    page = tmp_path / "report.html"
    page.write_text(render(page_of(Section("Design", parts=(Beside(figures(), 2),)))), encoding="utf-8")
    drawing = ("--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")
    flags = ("--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-sync", *drawing)
    quiet = ("--disable-background-networking", "--disable-component-update", "--enable-logging=stderr")
    command = [CHROMIUM, *flags, *quiet, "--virtual-time-budget=8000", f"--user-data-dir={tmp_path / 'profile'}"]
    done = subprocess.run(
        [*command, "--dump-dom", page.as_uri()], capture_output=True, text=True, timeout=90, check=True
    )
    complaints = [line for line in done.stderr.splitlines() if "CONSOLE" in line and "willReadFrequently" not in line]
    assert complaints == []
    assert len(re.findall(r'class="chart js-plotly-plot"', done.stdout)) == len(figures())
    assert len(re.findall(r'class="gl-container"', done.stdout)) > 0
    assert f">{NAMES[1]}</text>" in done.stdout
