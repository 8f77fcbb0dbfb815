"""The page: self-contained, complete, of bounded size."""

from __future__ import annotations

import json
import re
from dataclasses import replace
from html import unescape
from html.parser import HTMLParser

import numpy as np
import pytest

from robid.models.elastic.page.report import headline
from robid.report.charts import BodeResponse, band_radius
from robid.report.numbers import MINUS, MISSING, percent
from robid.report.page import ReportContent, Verdict, render
from robid.report.parameter_section import identified_phrase, parameter_section
from robid.report.parameters import Estimates, ParameterRow, misfit_sentence, parameter_line

FETCHING = {"src", "href", "srcset", "action", "poster", "data", "xlink:href", "background", "formaction"}


class PageReader(HTMLParser):
    """Collects attributes that fetch, the text of the body, and the scripts."""

    def __init__(self):
        super().__init__()
        self.fetched, self.texts, self.styles = [], [], []
        self.policy = self.inside = ""

    def handle_starttag(self, tag, attrs):
        self.inside = tag
        self.fetched += [value for name, value in attrs if name in FETCHING]
        attributes = dict(attrs)
        if attributes.get("http-equiv") == "Content-Security-Policy":
            self.policy = attributes["content"]

    def handle_endtag(self, _tag):
        self.inside = ""

    def handle_data(self, data):
        if self.inside != "script":
            (self.styles if self.inside == "style" else self.texts).append(data)


def read_page(html):
    reader = PageReader()
    reader.feed(html)
    reader.close()
    return reader


def page_text(html):
    return re.sub(r"\s+", " ", unescape(" ".join(read_page(html).texts)))


def embedded(html):
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', html, re.DOTALL)
    return json.loads(found.group(1))


@pytest.fixture(scope="module")
def arm_page(arm_content):
    return render(arm_content)


@pytest.fixture(scope="module")
def bench_page(bench_content):
    return render(bench_content)


def test_nothing_is_fetched(arm_page, bench_page):
    for html in (arm_page, bench_page):
        reader = read_page(html)
        assert reader.fetched
        assert all(value.startswith("#") for value in reader.fetched)
        assert not re.search(r"@import|url\(", "".join(reader.styles))
        assert "default-src 'none'" in reader.policy
        assert "connect-src" not in reader.policy
        assert "http" not in reader.policy


def test_plotly_is_there_once_and_cannot_send(arm_page):
    assert arm_page.count("plotly.js v") == 1
    assert 'plotlyServerURL: ""' in arm_page


def test_twelve_configurations_stay_below_eight_megabytes(large):
    html = render(large.content)
    assert len(large.fit.frf.configurations) == 12
    assert len(html.encode()) < 8e6


def test_the_verdict_comes_before_everything_else(arm_page, arm_content):
    text = page_text(arm_page)
    assert (
        text.index(arm_content.verdict.text)
        < text.index("Springs identified")
        < text.index("Every column is one input")
    )


def test_every_row_is_on_the_page(arm_page, arm):
    text = page_text(arm_page)
    fit = arm.fit
    for row in fit.estimates.rows:
        line = parameter_line(row, fit.estimates.identifiable_relative_std)
        assert f"{line.name} {line.estimate} {line.lower} … {line.upper} {line.unit}" in text
    for row in fit.resonances:
        assert row.measured_hz is None or f"{row.measured_hz:.4g}"[:4] in text
    for row in (*fit.estimation_costs, *fit.validation_costs):
        assert f"{row.cost:.5f}" in text
    for stage in arm.stages:
        assert stage.artifact in text
        assert stage.content_hash in text
    for configuration in arm.configurations:
        for angle in np.rad2deg(configuration.positions):
            assert f"{angle:.1f}".replace("-", "\N{MINUS SIGN}") in text
    for words in (
        *arm.robot_notes,
        *arm.warnings,
        *fit.frf.notes,
        "1 min 11 s",
        "108 %",
        "61.37",
        "5.0 s 1.83 17.3 dB",
        "not seen",
    ):
        assert words in text


def test_the_figures_hold_the_data(arm_page, arm):
    fit = arm.fit
    bode, ratios = embedded(arm_page)["figures"][:2]
    estimation, validation = bode["responses"]
    for drawn, frf, model in (
        (estimation, fit.frf, fit.model_response),
        (validation, fit.validation_frf, fit.validation_model),
    ):
        chosen = drawn["configurations"][1]
        measured = 10 ** (np.array(chosen["magnitude"]) / 20) * np.exp(1j * np.deg2rad(chosen["phase"]))
        np.testing.assert_allclose(measured, np.moveaxis(frf.response[1], 0, -1), rtol=2e-3)
        (curve,) = chosen["models"]
        predicted = 10 ** (np.array(curve["magnitude"]) / 20) * np.exp(1j * np.deg2rad(curve["phase"]))
        np.testing.assert_allclose(predicted, np.moveaxis(model[1], 0, -1), rtol=2e-3)
    title, rows = ratios["panels"][0]
    first = fit.estimates.rows[0]
    assert title == "Springs"
    assert rows[0]["truth"] == pytest.approx(first.truth / first.nominal, rel=1e-4)


def test_the_figures_hold_distortion_noise_and_the_response_before_compensation(arm_page, arm):
    frf = arm.fit.frf
    chosen = embedded(arm_page)["figures"][0]["responses"][0]["configurations"][1]

    def drawn(kind):
        return np.array(chosen[kind])[:, None] + np.array(chosen["factor"])[None]

    for kind in ("odd", "even"):
        expected = 20 * np.log10(np.moveaxis(frf.response_level(kind)[1], 0, -1))
        np.testing.assert_allclose(drawn(kind), expected, atol=0.11)
    ratio = np.array(chosen["magnitude"]) - drawn("noise")
    np.testing.assert_allclose(ratio, 10 * np.log10(np.moveaxis(frf.signal_to_noise[1], 0, -1)), atol=0.12)
    before = 10 ** (np.array(chosen["uncompensated"]) / 20)
    np.testing.assert_allclose(before, np.moveaxis(np.abs(frf.uncompensated_response[1]), 0, -1), rtol=2e-3)
    np.testing.assert_allclose(chosen["incoherence"], 1 - frf.coherence[1].T, rtol=6e-3)


def test_what_is_not_known_is_not_drawn(bench):
    fit = bench.fit
    names = ("noise_covariance", "coherence", "silent_level", "uncompensated_response")
    bare = replace(fit, frf=replace(fit.frf, **dict.fromkeys(names)))
    chosen = embedded(render(replace(bench, fit=bare).content))["figures"][0]["responses"][0]["configurations"][0]
    assert all(chosen[name] is None for name in ("noise", "incoherence", "odd", "even", "uncompensated"))


def test_the_band_holds_the_truth_as_often_as_its_level_says(arm):
    frf = arm.fit.frf
    rng = np.random.default_rng(8)
    error = np.sqrt(frf.element_variance() / 2) * (
        rng.normal(size=frf.response.shape) + 1j * rng.normal(size=frf.response.shape)
    )
    radius = band_radius(frf, 0.95) * np.abs(frf.response)
    assert np.mean(np.abs(error) < radius) == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / error.size))


def test_unidentifiable_rows_are_grey_and_say_why(arm_page):
    before = arm_page.split("<details>")[0]
    assert len(re.findall(r'<tr class="unidentified">', before)) == 2
    rows = re.findall(r'<tr class="note unidentified">(.*?)</tr>', before, re.DOTALL)
    assert len(rows) == 2
    told = [row.replace("\N{NO-BREAK SPACE}", " ") for row in rows]
    assert all("not identifiable: predicted deviation 55 %, above 20 %" in row for row in told)


def test_torque_nonlinearities_are_apart_and_relative_to_nothing(arm_page):
    apart = re.search(r"<details>(.*?)</details>", arm_page, re.DOTALL).group(1)
    text = page_text(apart)
    assert "Torque nonlinearities (nuisance), 3" in text
    assert "axis_1.level 3.21 3.09 … 3.33 % 3.10" in text
    assert f"axis_1.lag {MINUS}0.250 {MINUS}0.310 … {MINUS}0.190 samples" in text
    assert f"axis_1.shape 40 {MINUS}50 … 130 % {MISSING} {MISSING} not identifiable" in text
    assert "axis_1.level" not in arm_page.replace(apart, "")


def test_a_large_residual_is_told(arm):
    estimates = arm.fit.estimates
    assert misfit_sentence(replace(estimates, misfit=25.0)).startswith("The residual is 5.0 times as large as noise")
    assert misfit_sentence(replace(estimates, misfit=0.9)) == ""


def test_what_predicts_stands_beside_what_is_there():
    row = ParameterRow(
        "gear", "stiffness", "N m/rad", 1.0, 2.0, 1.9, 2.3, 0.05, physical=2.1, effective=(2.0, 1.99, 2.01)
    )
    line = parameter_line(row, 0.2)
    assert (line.predicts, line.physical, line.half_width) == ("0.50 %", "2.100", "9.5 %")
    (section,) = parameter_section(Estimates((row,)))
    table = next(part for part in section.parts if hasattr(part, "columns"))
    assert table.columns[:5] == ("Parameter", "Estimate", "Estimate ±", "Physical", "Physical 95 % interval")
    assert table.rows[0].cells[:5] == ("gear", "2.000", "0.50 %", "2.100", "1.900 … 2.300")
    assert "what the robot file may have wrong" in table.caption


def test_identified_phrase_counts_and_measures(arm, bench):
    estimates = arm.fit.estimates
    springs = [row for row in estimates.rows if row.kind == "stiffness"]
    half = np.median([(row.upper - row.lower) / 2 / row.estimate for row in springs])
    assert identified_phrase(estimates) == f"13 of 13 springs identified within ±{percent(half)} (median, 95 %)"
    assert identified_phrase(bench.fit.estimates) == "1 of 1 spring identified within ±0.26 % (95 %)"


def test_without_truth_there_are_no_truth_columns(bench_page, arm_page):
    assert "Off truth" in page_text(arm_page)
    assert "Off truth" not in page_text(bench_page)


def test_without_covariance_the_page_says_so_in_the_data(bench):
    fit = bench.fit
    bare = replace(fit, frf=replace(fit.frf, total_covariance=None, noise_covariance=None))
    data = embedded(render(replace(bench, fit=bare).content))
    assert data["figures"][0]["responses"][0]["configurations"][0]["radius"] is None


def test_text_cannot_break_out_of_the_page(bench_page):
    assert "but </script> one" not in bench_page
    assert "but </script> one damper" in page_text(bench_page)
    assert "no effect <here>" in page_text(bench_page)


def test_numbers_that_are_not_finite_do_not_break_the_figures(bench):
    fit = bench.fit
    response = fit.model_response.copy()
    response[0, 3] = np.nan
    data = embedded(render(replace(bench, fit=replace(fit, model_response=response)).content))
    assert data["figures"][0]["responses"][0]["configurations"][0]["models"][0]["magnitude"][0][0][3] is None


def test_a_report_without_a_fit_still_stands():
    html = render(ReportContent("empty", Verdict("Nothing was fitted.", "warn"), "robot"))
    assert "Nothing was fitted." in page_text(html)


def test_a_model_of_another_shape_is_refused(arm):
    with pytest.raises(ValueError, match="model_response"):
        BodeResponse("Estimation", arm.fit.frf, (("model", arm.fit.model_response[:, :-1]),))


def test_key_numbers_count_what_the_rows_say(arm, bench):
    shown = {number.label: number for number in headline(arm.fit).numbers}
    assert shown["Springs identified"].value == "13 of 13"
    of_model = [row for row in arm.fit.estimates.rows if row.kind != "friction"]
    known = sum(row.identified for row in of_model)
    assert shown["Springs identified"].detail == f"{known} of {len(of_model)} parameters"
    assert len(of_model) < len(arm.fit.estimates.rows)
    assert shown["Starts at the best"].value == "18 of 20"
    costs = [row.cost for row in arm.fit.validation_costs]
    assert float(shown["Validation cost / noise"].value) == pytest.approx(np.mean(costs) / 0.0191, rel=5e-3)
    assert {number.label for number in headline(bench.fit).numbers} == {
        "Springs identified", "Spring interval", "Resonances off", "Estimation cost",
    }  # fmt: skip


@pytest.mark.parametrize(("row", "words"), [
    ({"identifiable": False, "identified": False, "predicted_relative_std": 0.35},
     "not identifiable: predicted deviation 35 %, above 20 %"),
    ({"identifiable": False, "identified": False, "predicted_relative_std": 0.04, "known_relative_std": 0.05},
     "known beforehand to 5.0 %, and the data were predicted to leave 4.0 %"),
    ({"identifiable": False, "identified": False, "predicted_relative_std": 0.15, "known_relative_std": 0.23},
     "not identifiable: known beforehand to 23 %, and the data were predicted to leave 15 %"),
    ({"predicted_relative_std": 0.019, "identified": False}, "not identified: the interval came out at ±50 %"),
    ({"predicted_relative_std": 0.019}, ""),
])  # fmt: skip
def test_a_row_says_the_figure_that_decided(row, words):
    line = parameter_line(ParameterRow("gear", "stiffness", "N m/rad", 1.0, 2.0, 1.0, 3.0, 0.019, **row), 0.2)
    assert line.note == words


def test_the_page_says_what_set_the_width(arm):
    estimates = replace(arm.fit.estimates, interval_rule="noise; jackknife over 6 places")
    page = page_text(render(replace(arm, fit=replace(arm.fit, estimates=estimates)).content))
    assert "The intervals' width is set by noise; jackknife over 6 places." in page
