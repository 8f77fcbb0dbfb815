"""The table of fits under the verdict: one row each, linked, with the counts that the page gives elsewhere."""

from dataclasses import replace

import pytest

from robid.models.elastic.page.report import fit_report
from robid.report.fits import fits_table
from robid.report.page import Basis, ReportContent, Verdict, fit_sections, render
from robid.report.section import Cell


@pytest.fixture(scope="module")
def reports(arm):
    found = fit_report(arm.fit)
    other = replace(found, headline=replace(found.headline, name="second"), grade=0)
    return replace(found, basis=Basis(("one", "two"), "new", "0.2 of allowed", "1.5"), grade=2), other


def test_each_fit_has_a_row_with_what_its_grade_rests_on(reports):
    table = fits_table(reports)
    first, second = table.texts
    assert len(table.rows) == 2
    assert first[1:4] == ("trust", "0.2 of allowed", "1.5")
    assert first[5:] == ("one, two", "new")
    assert (second[0], second[1], second[-1]) == ("second", "do not use", "not validated")
    marks = [row[1].mark for row in table.rows]
    assert marks == ["good", "bad"]


def test_the_count_is_that_of_the_numbers_above_it(reports):
    (numbers,) = (each for each in reports[0].headline.numbers if each.label.endswith("identified"))
    (count,) = {row[4] for row in fits_table(reports).texts}
    assert count in {numbers.value, numbers.detail.removesuffix(" parameters")}


def test_links_lead_to_the_fits_own_sections(reports):
    table = fits_table(reports)
    page = render(ReportContent("t", Verdict("v", "ok"), "r", fits=table, sections=fit_sections(reports)))
    links = [cell.link for row in table.rows for cell in row if isinstance(cell, Cell) and cell.link]
    assert len(set(links)) == 2
    assert all(f'<section id="{link[1:]}">' in page for link in links)


def test_a_page_without_fits_has_no_table():
    assert fits_table(()) is None
