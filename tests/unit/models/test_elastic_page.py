"""What is shown of an elastic fit beyond what every fit has."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

from robid.models.elastic.fit.gears_alone import WITH_CHAIN
from robid.models.elastic.page.gather import RepeatRow
from robid.models.elastic.page.gears import GearRow, gear_sentence
from robid.models.elastic.page.report import element_sentence, fit_summary, fit_tables, sections
from robid.models.elastic.page.resonances import interval_sentence, interval_text, resonance_section
from robid.report.numbers import MISSING
from robid.report.section import Notes
from sample_reports import arm_report, bench_report
from terminals import screen


def test_interval_ends_differ():
    assert interval_text((12.341, 12.344)) == "12.341 … 12.344"
    assert interval_text((12.3, 12.4)) == "12.30 … 12.40"
    assert interval_text(None) == MISSING


def test_residuals_beyond_their_covariance_are_told():
    fit = arm_report().fit
    assert element_sentence(fit) == ""
    told = element_sentence(
        replace(fit, model_error=SimpleNamespace(share_above=0.3, share_correlated=0.41, median_level=0.012))
    )
    assert told.startswith("Beyond their covariance are 30 % of the elements, where the model is off by 1.2 % (median)")
    assert "41 % are correlated over frequency" in told


def test_small_drives_show_the_models_own_modes():
    shown = [screen(table, 100) for table in fit_tables(bench_report().fit)]
    assert len(shown) == 2
    words = next(line.split() for line in shown[1].splitlines() if "antiresonance" in line)
    peak, model, zero = ["53.97", "53.88", "…", "54.06"], "53.99", ["53.95", "53.90", "…", "54.00"]
    assert words == ["motor", "antiresonance", *peak, model, *zero]
    assert "1 more that the model does not have are in the report" in shown[1]
    assert len(list(fit_tables(arm_report().fit))) == 1


def test_a_page_says_what_the_intervals_of_resonances_hold():
    frf = arm_report().fit.frf
    places = np.arange(2.0)[:, None]
    lone = replace(frf, realization_error=None, total_covariance=None, configurations=places)
    assert "not what another measurement of the same robot would find" in interval_sentence(lone)
    several = replace(lone, total_covariance=np.ones((2, 1, 1, 1)), realization_error=np.ones((2, 3, 1, 1, 1)))
    assert "leaving out each of 3 realizations" in interval_sentence(several)
    again = replace(several, configurations=np.zeros((2, 1)))
    assert interval_sentence(again).endswith(
        "realizations changes and what measurements of the same configuration scatter."
    )


def test_a_row_sets_a_peak_beside_a_peak_and_a_pole_beside_a_pole():
    fit = bench_report().fit
    (table,) = resonance_section(fit.resonances, fit.frf, 0.95)[0].parts
    heads = list(table.columns)
    row = list(table.rows[0].cells)
    assert heads[3:6] == ["Peak or dip [Hz]", "95 % interval", "Model's peak [Hz]"]
    assert row[3:6] == ["53.97", "53.88 … 54.06", "53.99"]
    assert heads[8:13] == [
        "Pole or zero [Hz]",
        "Interval of pole",
        "Model's pole [Hz]",
        "Interval of model's",
        "Damping",
    ]
    assert row[8:13] == ["53.94", "53.85 … 54.03", "53.95", "53.90 … 54.00", "1.0 %"]


def test_what_several_campaigns_measured_stands_in_one_table():
    fit = bench_report().fit
    repeat = RepeatRow(("monday", "monday", "friday"), 53.91, 54.02, 53.96, (53.7, 54.2), 53.93, (53.6, 54.3))
    rows = (replace(fit.resonances[0], repeat=repeat), *fit.resonances[1:])
    every, pooled = resonance_section(rows, fit.frf, 0.95)[0].parts
    assert every.caption.endswith("what monday, friday scatter in the same configuration.")
    (row,) = pooled.rows
    assert row.cells[3:] == (
        "monday (2 times), friday", "53.96", "53.91 … 54.02", "53.70 … 54.20", "53.93", "53.60 … 54.30",
    )  # fmt: skip
    shown = screen(list(fit_tables(replace(fit, resonances=rows)))[1], 100)
    assert "measured intervals hold what monday, friday scatter in the same configuration" in shown
    summary = fit_summary(replace(fit, resonances=rows), None)
    place = "resonances.configuration_1.motor.antiresonance_1"
    assert summary[f"{place}.repeats"] == 3
    assert summary[f"{place}.mean_peak_upper_hz"] == 54.2
    assert summary[f"{place}.mean_measured_hz"] == 53.93


def test_notes_that_the_page_warns_of_are_not_repeated():
    fit = bench_report().fit
    assert any(isinstance(part, Notes) for part in sections(fit)[0].parts)
    assert not any(isinstance(part, Notes) for part in sections(fit, fit.frf.notes)[0].parts)


def test_terminal_and_page_say_that_a_gear_is_fitted_with_what_lies_in_line_and_what_it_alone_may_be():
    rows = (
        GearRow("gear_1", "N m/rad", (1.9e6, 2.1e6), 2.2e6, (1.9e6, 2.7e6), 0.235),
        GearRow("gear_2", "N m/rad", (0.9e6, 1.1e6), 1.0e6, (0.9e6, 1.1e6), 0.0),
    )
    fit = bench_report().fit
    told = replace(fit, gears=rows, estimates=replace(fit.estimates, about=gear_sentence(rows)))
    shown = " ".join(screen(next(iter(fit_tables(told))), 400).split())
    assert WITH_CHAIN in shown
    assert "gear_1 1.90 … 2.70 MN m/rad" in shown
    assert "gear_2 0.9" not in shown  # whose file takes the share for granted
    (section,) = [each for each in sections(told) if each.anchor == "gears-alone"]
    (table,) = section.parts
    assert [row[0] for row in table.rows] == ["gear_1", "gear_2"]
    assert table.rows[0][1:4] == ("1.90 … 2.10", "2.20", "1.90 … 2.70")
    found = fit_summary(told, None)
    assert (found["gears.gear_1.alone_lower"], found["gears.gear_1.alone_upper"]) == (1.9e6, 2.7e6)
    assert not [each for each in sections(fit) if each.anchor == "gears-alone"]
