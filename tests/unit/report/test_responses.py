"""Responses without a model on the page: numbers, gaps, mixed quantities, and all of it in a browser."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest

from robid.report.charts import BodeMatrix, BodeResponse, Overlay, bode_data
from robid.report.numbers import MISSING
from robid.report.page import ReportContent, Verdict, render
from robid.report.responses import (
    coherence_text,
    measured_sentence,
    response_headlines,
    response_sections,
    response_summary,
    responses_verdict,
)
from robid.report.section import Notes
from robid.signals.quantities import Channel
from sample_reports import arm_fit, bench_report

CHROMIUM = next((found for name in ("chromium", "chromium-browser") if (found := shutil.which(name))), None)

LOOK = """
  const plot = document.querySelector('.matrix .js-plotly-plot');
  const crosses = plot.data.filter((one) => one.marker && one.marker.symbol === 'x-thin').map((one) => one.x.length);
  const filled = plot.data.filter((one) => one.fill === 'toself').length;
  const hosts = [...document.querySelectorAll('[data-role="ratio"], [data-role="coherence"]')];
  const key = document.querySelector('.key').textContent;
  document.querySelector('.cell').click();
  const large = document.getElementById('enlarged-plot').data.length;
  document.title = JSON.stringify([crosses, filled, hosts.map((one) => !one.parentElement.hidden), key, large]);
"""


@pytest.fixture(scope="module")
def arm_frf():
    return arm_fit(2, 1, 20).frf


@pytest.fixture(scope="module")
def bench_frf():
    return bench_report().fit.frf


def with_gap(frf, *lines):
    dropped = np.zeros((1, len(frf.lines), 1), bool)
    dropped[0, list(lines)] = True
    return replace(frf, dropped=dropped)


def page_of(*campaigns):
    sections, heads = response_sections(campaigns), response_headlines(campaigns)
    return render(ReportContent("measured", Verdict(responses_verdict(campaigns), "ok"), "arm", heads, (), sections))


def test_each_kind_of_response_has_a_section_with_a_row_per_output(arm_frf, bench_frf):
    (alone,) = response_sections([("one", arm_frf), ("two", arm_frf)])
    assert alone.anchor == "responses"
    assert len(alone.tables[-1].rows) == 2 * 2 * 6
    other = replace(bench_frf, input_channels=(Channel("motor", "speed_reference", "rad/s"),))
    both = response_sections([("arm", arm_frf), ("cart", other)])
    assert [section.anchor for section in both] == ["responses-1", "responses-2"]
    assert [len(section.tables[-1].rows) for section in both] == [12, 2]


def test_mixed_quantities_are_named_and_have_both_units(bench_frf):
    channels = (Channel("cart", "position", "m", "tool"), Channel("cable", "angle", "rad", "tool"))
    mixed = replace(bench_frf, output_channels=channels)
    data = bode_data(response_sections([("log", mixed)])[0].parts[0])
    assert data["responses"][0]["outputs"] == ["cart position", "cable angle"]
    assert data["responses"][0]["unit"] == "m/(N m) or rad/(N m)"
    assert (data["input_quantity"], data["output_quantity"]) == ("torque", "")


def test_dropped_lines_are_counted_listed_and_crossed(bench_frf):
    gap = with_gap(bench_frf, 3, 7)
    (section,) = response_sections([("log", gap)])
    assert section.tables[-1].texts[0][3:5] == ("238", "2")
    (notes,) = (part for part in section.parts if isinstance(part, Notes))
    assert notes.items == (
        "log, configuration 1: 0°: 2 of 240 lines say too little of motor and were dropped: 14.00, 18.00 Hz.",
    )
    one = bode_data(section.parts[0])["responses"][0]["configurations"][0]
    assert one["dropped"] == [[14.0, 18.0]]
    assert one["magnitude"][0][0][3] is None
    assert one["incoherence"][0][3] is not None
    assert response_summary(gap)["response.dropped_lines"] == 2
    assert "2 of 240 with a dropped input" in measured_sentence("log", gap)


def test_the_verdict_tells_when_much_was_dropped(bench_frf):
    few, many = with_gap(bench_frf, 3, 7), with_gap(bench_frf, *range(100, 200))
    assert "too little" not in responses_verdict([("few", few)])
    told = responses_verdict([("few", few), ("many", many)])
    assert told.endswith("(median standard deviation). At 100 of 240 lines of many too little is known.")


def test_uncertainty_without_noise_is_shown_over_the_whole_variance(bench_frf):
    silent = replace(bench_frf, noise_covariance=None)
    one = bode_data(response_sections([("log", silent)])[0].parts[0])["responses"][0]["configurations"][0]
    assert one["noise"] is None
    radius = np.array(one["radius"][0][0]) / one["spread"]
    deviation = np.sqrt(bench_frf.element_variance()[0, :, 0, 0]) / np.abs(bench_frf.response[0, :, 0, 0])
    np.testing.assert_allclose(radius, deviation, rtol=5e-3)


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.5, "0.50"), (0.93, "0.930"), (0.99987, "0.99987"), (1.0, "0.999999"), (float("nan"), MISSING)],
)
def test_a_coherence_has_as_many_nines_as_it_has(value, text):
    assert coherence_text(value) == text


def test_verdict_and_summary_leave_out_what_is_unknown(bench_frf):
    bare = replace(bench_frf, total_covariance=None, noise_covariance=None, coherence=None, silent_level=None)
    assert (
        responses_verdict([("log", bare)])
        == "No fit was asked for; the response is measured, with unknown uncertainty."
    )
    assert set(response_summary(bare)) == {"response.dropped_lines"}
    assert [number.label for number in response_headlines([("log", bare)])[0].numbers] == ["Lines"]


def overlaid(frf):
    finer = np.linspace(frf.frequency_hz[0], 2 * frf.frequency_hz[-1], 50)
    response = np.full((len(frf.configurations), 50, *frf.response.shape[2:]), 30.0 + 1j)
    overlay = Overlay("second", finer, response, np.full(response.shape, 0.2))
    return BodeMatrix("", (BodeResponse("", frf, overlays=(overlay,)),), measured="first", quality=False)


def test_overlays_have_lines_and_bands_of_their_own(arm_frf):
    data = bode_data(overlaid(arm_frf))
    assert data["measured"] == "first"
    (told,) = data["responses"][0]["overlays"]
    one = data["responses"][0]["configurations"][0]
    assert told["name"] == "second"
    assert len(told["frequency"]) == len(one["overlays"][0]["magnitude"][0][0]) == 50
    assert one["overlays"][0]["radius"][5][5][0] == 0.2
    assert "noise" not in one


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_the_page_draws_gaps_overlays_and_quality_without_a_complaint(tmp_path, bench_frf):
    html = page_of(("log", with_gap(bench_frf, 3, 7)))
    content = ReportContent(
        "two",
        Verdict("Both.", "ok"),
        "arm",
        sections=(replace(response_sections([("log", bench_frf)])[0], parts=(overlaid(bench_frf),)),),
    )
    found = []
    for number, page in enumerate((html, render(content))):
        file = tmp_path / f"{number}.html"
        file.write_text(page.replace("</body>", f"<script>{LOOK}</script></body>"), encoding="utf-8")
        flags = ["--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--virtual-time-budget=8000"]
        command = [CHROMIUM, *flags, f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", file.as_uri()]
        done = subprocess.run(command, capture_output=True, text=True, timeout=90, check=True)
        assert [line for line in done.stderr.splitlines() if "CONSOLE" in line] == []
        found.append(json.loads(re.search(r"<title>(\[.*?\])</title>", done.stdout).group(1)))
    gaps, over = found
    assert gaps[0] == [2, 2]
    assert gaps[2] == [True, True]
    assert "dropped line" in gaps[3]
    assert (over[0], over[1], over[2]) == ([], 4, [False, False])
    assert over[3].startswith("firstsecond")
    assert over[4] == 8
