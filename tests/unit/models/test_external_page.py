"""What the page shows of an external fit: numbers as they were found, and figures of every channel."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest

from external_loops import BANDS, NEW_BAND, channels, command_of, linear, shot_of
from robid.models.external.fit.fitting import fit_external
from robid.models.external.fit.options import CouplingOptions, ExternalOptions
from robid.models.external.judge.plausible import assess_external
from robid.models.external.judge.validating import validate_external
from robid.models.external.page.charts import excitation_figures, locus_figure, response_figures, step_figure
from robid.models.external.page.data import coupling_section, new_section, own_section
from robid.models.external.page.report import sections, transfer_text
from robid.models.parameters import parameter_rows
from robid.report.numbers import MINUS
from robid.report.page import ReportContent, Verdict, render
from robid.report.parameters import Estimates
from robid.report.section import Beside, Choice, Figure, Notes

CHROMIUM = next((found for name in ("chromium", "chromium-browser") if (found := shutil.which(name))), None)
OPTIONS = ExternalOptions(poles=2, zeros=1, delay_samples=3)
PLANTS = [linear([3.0, 400.0], [1.0, 22.0, 400.0], 3), linear([-5.0, 350.0], [1.0, 20.0, 350.0], 3)]


@pytest.fixture(scope="module")
def solution():
    shots = [shot_of(PLANTS, band, moving=index) for band in BANDS for index in range(2)]
    return fit_external(shots, channels("XZ", "position_command"), channels("XZ"), "zoh", OPTIONS)


@pytest.fixture(scope="module")
def validation(solution):
    new = [shot_of(PLANTS, NEW_BAND, 77, moving=index) for index in range(2)]
    return validate_external(solution, new, assess_external(solution, OPTIONS).findings)


@pytest.fixture(scope="module")
def page(solution, validation):
    rows = parameter_rows(solution.estimate, {})
    return sections(solution, Estimates(rows), new_section(solution, validation), CouplingOptions())


def figures(parts):
    for part in parts:
        if isinstance(part, Figure):
            yield part
        elif isinstance(part, Beside):
            yield from figures(part.parts)
        elif isinstance(part, Choice):
            for _, inner in part.options:
                yield from figures(inner)


def chosen(parts):
    """Counts the figures that are seen before anybody chooses."""
    counts = [chosen(part.options[0][1]) if isinstance(part, Choice) else len(list(figures([part]))) for part in parts]
    return sum(counts)


@pytest.mark.parametrize(
    ("numerator", "denominator", "text"),
    [
        ([0, 0, 3.0], [1, 4, 3.0], "3.0000 / (s² + 4.0000 s + 3.0000)"),
        ([0, -5.0, 350.25], [1, 0, 12.5], f"({MINUS}5.0000 s + 350.25) / (s² + 12.500)"),
        ([0, 2.0, 0], [0, 1, 1.0], "2.0000 s / (s + 1.0000)"),
        ([0.0], [1.0, 0.0], "0 / s"),
    ],
)
def test_transfer_functions_are_written_as_they_are_read(numerator, denominator, text):
    assert transfer_text(np.array(numerator, float), np.array(denominator, float)) == text


def test_the_page_has_its_sections_and_a_figure_of_every_channel(page):
    assert [section.anchor for section in page] == [
        *("transfers", "traces", "parameters", "response", "dynamics", "decoupling", "excitation")
    ]
    for section in page:
        for part in section.parts:
            if isinstance(part, Choice):
                assert [name for name, _ in part.options] == ["X", "Z"], section.title
                assert all(list(figures(inner)) for _, inner in part.options)


def test_tables_hold_what_was_found(page, solution, validation):
    transfers, quality, *_ = page[0].tables
    assert [row[:3] for row in transfers.texts] == [("X", "1 / 2", "3 (36 ms)"), ("Z", "1 / 2", "3 (36 ms)")]
    assert {(row[0], row[3]) for row in quality.texts} == {
        (one.output, f"{one.nrmse:.4f}") for one in solution.agreements
    }
    (new,) = page[1].tables
    assert [row[3] for row in new.texts] == [f"{one.nrmse:.4f}" for one in validation.agreements]
    assert validation.outcome.verdict in page[1].lead
    assert "Nominal" not in page[2].tables[0].columns


def test_differences_lie_within_the_bounds_that_are_drawn(page, validation):
    shown, difference = list(figures(page[1].parts))[:2]
    assert [curve.name for curve in shown.curves] == ["measured", "simulated"]
    left, bounds = difference.curves
    found, factor, wide = validation.traces, 1e3, NormalDist().inv_cdf(0.5 + 0.5 * validation.confidence)
    rows = np.flatnonzero((found.output == 0) & (found.shot == found.shot[0]))
    off, half = factor * (found.measured - found.predicted)[rows], factor * wide * found.std[rows]
    kept = {float(time): place for place, time in enumerate(found.time_s[rows])}
    np.testing.assert_allclose(left.y, [off[kept[time]] for time in left.x])
    np.testing.assert_allclose(bounds.upper, [half[kept[time]] for time in bounds.x])
    assert (max(left.y), min(left.y)) == pytest.approx((off.max(), off.min()))
    assert np.mean(np.abs(off) <= half) == pytest.approx(validation.bounds[0].inside, abs=0.02)


def test_a_step_that_goes_the_wrong_way_first_is_named(page, solution):
    (notes,) = [part for part in page[0].parts if isinstance(part, Notes)]
    told = [note for note in notes.items if "wrong way first" in note]
    assert len(told) == 1
    assert told[0].startswith("Z: ")
    assert solution.steps.undershoot[1] > 0.005 > solution.steps.undershoot[0]


def test_the_empirical_response_lies_on_the_model_from_samples_to_samples(solution):
    magnitude, phase = response_figures(solution, 1)
    for figure in (magnitude, phase):
        measured, model = figure.curves
        assert measured.points
        inside = [place for place, y in enumerate(measured.y) if np.isfinite(y)]
        assert len(inside) > 50
        at = np.interp([measured.x[place] for place in inside], model.x, model.y)
        lower, upper = (np.array(each)[inside] for each in (measured.lower, measured.upper))
        assert np.mean((at >= lower) & (at <= upper)) > 0.75  # neighbours are alike
    assert all(-720 <= y <= 90 for y in phase.curves[0].y if np.isfinite(y))


def test_steps_end_at_the_static_gain_and_bounds_are_of_the_level(solution):
    figure = step_figure(solution.steps, 0, 1.0, 0.9)
    (course,) = figure.curves
    half = (np.array(course.upper) - course.lower) / 2
    wide = NormalDist().inv_cdf(0.95)
    np.testing.assert_allclose(half, wide * solution.steps.std[:, 0], atol=1e-12)
    assert course.y[-1] == pytest.approx(1.0, abs=0.02)
    assert [line.at for line in figure.lines] == [0.0, 1.0]


def test_the_locus_leaves_out_roots_beyond_half_the_sampling_rate(solution):
    figure = locus_figure(solution, 1)
    shown = {curve.name: curve for curve in figure.curves}
    np.testing.assert_allclose(sorted(shown["poles"].y), [-np.sqrt(250), np.sqrt(250)], rtol=0.02)
    np.testing.assert_allclose(shown["zeros"].x, [70.0], rtol=0.05)
    assert figure.equal
    reach = figure.x_range[1]
    assert 70 < reach < 100
    far = replace(solution.loci, zeros=np.full_like(solution.loci.zeros, 1e4))
    assert locus_figure(replace(solution, loci=far), 1).x_range[1] < 30


def test_excitation_is_shown_against_the_resolution_in_millimetres(solution):
    time, spectrum = excitation_figures(solution.excitation, 0, 0, ("m", "m"))
    assert max(time.curves[0].y) == pytest.approx(1e3 * command_of(*BANDS[0]).max(), rel=0.01)
    assert time.y_title == "[mm]"
    (line,) = spectrum.lines
    assert (line.along, line.name) == ("y", "resolution")
    assert line.at == pytest.approx(1e-2)


def test_coupled_pairs_are_red_and_above_the_thresholds(solution):
    found = solution.coupling
    ratio, coupled = found.ratio.copy(), found.coupled.copy()
    ratio[:, 1, 0], coupled[:, 1, 0] = 0.4, True
    crossing = np.where(found.own, np.nan, np.array([[np.nan, np.inf], [3.2, np.nan]]))
    changed = replace(found, ratio=ratio, coupled=coupled, crossing_hz=crossing)
    (section,) = coupling_section(changed, solution.ports, CouplingOptions())
    assert not coupling_section(replace(changed, own=np.ones((2, 2), bool)), solution.ports, CouplingOptions())
    pairs, limits = section.tables
    assert pairs.rows[1][1].text == "0.40"
    assert [cell.mark for cell in pairs.rows[1][1:]] == ["bad", ""]
    assert limits.texts[0][2] == "Z from 3.20 Hz"
    (chart,) = figures(section.parts)
    assert {line.at for line in chart.lines} == {0.7, 0.15, float(found.limit.max())}
    assert chart.y_range[0] < 0.15 < 0.4 < chart.y_range[1]
    assert "Z to X" in " ".join(chart.curves[1].texts)


def test_each_record_is_shown_by_itself(page, solution, validation):
    (choice,) = (part for part in page[1].parts if isinstance(part, Choice))
    for output, (name, (records,)) in enumerate(choice.options):
        assert name == "XZ"[output]
        own, new = (
            np.unique(found.shot[found.output == output]).tolist() for found in (solution.traces, validation.traces)
        )
        titles = [*(f"{validation.traces.shots[shot]} (validation)" for shot in new)]
        titles += [f"{solution.traces.shots[shot]} (fit)" for shot in own]
        assert [title for title, _ in records.options] == titles
        for _, (shown, difference) in records.options:
            assert (np.diff(shown.curves[0].x) > 0).all(), "one record, whose time does not begin anew"
            assert difference.curves[0].name == "measured less simulated"


def test_own_data_stand_in_for_new_ones(solution):
    section = own_section(solution)
    assert section.title == "On its own data"
    first = next(figures(section.parts))
    assert [curve.name for curve in first.curves] == ["measured", "simulated"]
    assert not first.curves[1].lower


@pytest.mark.browser
@pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not installed")
def test_every_figure_is_drawn_without_a_complaint(tmp_path, page):
    path = tmp_path / "report.html"
    path.write_text(render(ReportContent("tool", Verdict("It holds.", "ok"), "", sections=page)), encoding="utf-8")
    flags = ("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync")
    quiet = ("--disable-background-networking", "--disable-component-update", "--enable-logging=stderr")
    command = [CHROMIUM, *flags, *quiet, "--virtual-time-budget=8000", f"--user-data-dir={tmp_path / 'profile'}"]
    done = subprocess.run(
        [*command, "--dump-dom", path.as_uri()], capture_output=True, text=True, timeout=90, check=True
    )
    assert [line for line in done.stderr.splitlines() if "CONSOLE" in line] == []
    visible = sum(chosen(section.parts) for section in page)
    assert done.stdout.count("chart js-plotly-plot") == visible


def test_a_matrix_has_all_its_channels_and_judges_steps_of_its_own_alone():
    options = replace(OPTIONS, matrix="full", poles=4, zeros=3)
    shots = [shot_of(PLANTS, band, moving=index) for band in BANDS for index in range(2)]
    solution = fit_external(shots, channels("XZ", "position_command"), channels("XZ"), "zoh", options)
    found = sections(
        solution, Estimates(parameter_rows(solution.estimate, {})), own_section(solution), CouplingOptions()
    )
    assert [row[0] for row in found[0].tables[0].texts] == ["X", "X/Z", "Z/X", "Z"]
    choices = [part for section in found for part in section.parts if isinstance(part, Choice)]
    assert [[name for name, _ in part.options] for part in choices] == [
        *(["X", "Z"], ["X", "X/Z", "Z/X", "Z"], ["X", "X/Z", "Z/X", "Z"], ["X", "Z"])
    ]
    steps = next(table for section in found for table in section.tables if table.title == "Steps")
    assert [row[0] for row in steps.texts] == ["X", "Z"]
