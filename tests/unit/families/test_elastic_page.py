"""What is shown of an elastic fit beyond what every fit has."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO

from rich.console import Console

from robid.families.elastic.page.content import ElementErrors
from robid.families.elastic.page.resonances import interval_text
from robid.families.elastic.page.sections import element_sentence, fit_tables, sections
from robid.report.numbers import MISSING
from robid.report.section import Notes
from sample_reports import arm_report, bench_report


def printed(table, width):
    stream = StringIO()
    Console(file=stream, width=width).print(table)
    return stream.getvalue()


def test_interval_ends_differ():
    assert interval_text((12.341, 12.344)) == "12.341 … 12.344"
    assert interval_text((12.3, 12.4)) == "12.30 … 12.40"
    assert interval_text(None) == MISSING


def test_residuals_beyond_their_covariance_are_told():
    fit = arm_report().fit
    assert element_sentence(fit) == ""
    told = element_sentence(replace(fit, element_errors=ElementErrors(0.3, 0.41, 0.012)))
    assert told.startswith("Beyond their covariance are 30 % of the elements, where the model is off by 1.2 % (median)")
    assert "41 % are correlated over frequency" in told


def test_small_drives_show_the_models_own_modes():
    shown = [printed(table, 100) for table in fit_tables(bench_report().fit)]
    assert len(shown) == 2
    words = next(line.split() for line in shown[1].splitlines() if "antiresonance" in line)
    assert words == ["motor", "antiresonance", "53.95", "53.90", "…", "54.00", "53.97", MISSING]
    assert "1 more that the model does not have are in the report" in shown[1]
    assert len(list(fit_tables(arm_report().fit))) == 1


def test_notes_that_the_page_warns_of_are_not_repeated():
    fit = bench_report().fit
    assert any(isinstance(part, Notes) for part in sections(fit)[0].parts)
    assert not any(isinstance(part, Notes) for part in sections(fit, fit.frf.notes)[0].parts)
