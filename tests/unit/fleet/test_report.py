"""The page of a fleet: failures by cause, outliers with links, drifts, populations, parameters over rows."""

from dataclasses import replace

import pytest

from fabricated_fleets import entry, failed, found_in, ledger, sound, with_factor
from robid.fleet.comparison import flagged
from robid.fleet.ledger import FileKey, causes
from robid.fleet.report import failure_content, report_content, write_report
from robid.report.numbers import MISSING
from robid.report.page import render
from robid.report.section import Choice

SPRING = "gear_a1.stiffness"
ENDS = {"physical_low": 0.68e6, "physical_high": 0.72e6}
ROWS = [
    ledger("r1", [entry(SPRING, 1e6, physical_low=0.98e6, physical_high=1.02e6)]),
    ledger("r2", [entry(SPRING, 0.7e6, **ENDS)]),
    failed("r3", "a channel is dead"),
    failed("r4", "samples are lost"),
    failed("r5", "samples are lost"),
    ledger("r6", grade=(0, "Do not use: the signs are wrong.")),
]


def section(content, title):
    return next(each for each in content.sections if each.title.startswith(title))


def figure_of(content, name=SPRING):
    choice = next(part for part in section(content, "Parameters").parts if isinstance(part, Choice))
    return dict(choice.options)[name][0]


def test_failures_are_grouped_by_cause_the_most_frequent_first():
    assert [(message, ids) for _, message, _, ids in causes(ROWS)] == [
        ("samples are lost", ["r4", "r5"]),
        ("a channel is dead", ["r3"]),
    ]


def test_the_page_says_what_failed_and_shows_every_row_with_its_interval():
    content = report_content(found_in(ROWS))
    assert content.verdict.text == "3 of 6 rows done; 3 failed; 1 graded do not use."
    assert section(content, "Failures").tables[0].texts[0][:3] == ("data", "2", "samples are lost")
    [row] = section(content, "Parameters").tables[0].texts
    assert row[0] == SPRING
    assert row[3:] == ("2", "1000", "850", "700", "1000", "2.4 %")
    figure = figure_of(content)
    points, intervals = figure.curves
    assert points.y == (1e6, 0.7e6)
    assert points.texts == ("r1: 1.00, 0.98 to 1.02 MN m/rad", "r2: 700, 680 to 720 kN m/rad")
    assert intervals.x == (0, 0, 0, 1, 1, 1)
    assert intervals.y[:2] + intervals.y[3:5] == (0.98e6, 1.02e6, 0.68e6, 0.72e6)
    assert figure.lines[0].at == 1e6
    assert [row[0] for row in section(content, "Grades").tables[0].texts] == ["do not use", "trust"]


@pytest.mark.parametrize(
    ("nominal", "text"),
    [((1e6, 1e6), "1000.0"), ((1e6, 2e6), "several"), ((None, None), MISSING), ((1e6, None), "several")],
)
def test_the_robot_files_value_is_shown_where_all_say_the_same(nominal, text):
    rows = [ledger(f"r{place}", [entry(SPRING, 0.7e6, nominal=value)]) for place, value in enumerate(nominal)]
    [row] = section(report_content(found_in(rows)), "Parameters").tables[0].texts
    assert row[4] == text


def with_outliers(count=40):
    fleet = list(sound(count))
    fleet[7] = with_factor(fleet[7], SPRING, 0.7)
    fleet[9] = replace(with_factor(fleet[9], SPRING, 0.8), misfits={"elastic": {"misfit": 5.0}})
    fleet[11] = failed("r11", "a channel is dead")
    return fleet


def test_outliers_have_a_sentence_each_and_lead_to_their_pages(tmp_path):
    (tmp_path / "rows/r7").mkdir(parents=True)
    (tmp_path / "rows/r7/report.html").touch()
    found = found_in(with_outliers(), tmp_path / "rows")
    assert flagged(found) == [9, 7, 11]
    content = report_content(found)
    assert content.verdict.text == "39 of 40 rows done; 1 failed; 2 off the fleet."
    assert [each.title for each in content.sections[:3]] == ["Failures by cause", "Outliers", "Populations"]
    first, second = section(content, "Outliers").tables[0].texts
    assert first[0] == "r9"
    assert first[1].startswith("misfit is 5.")
    assert "times the fleet's 1.0" in first[1]
    assert first[2] == f"{SPRING} \N{MINUS SIGN}20 %"
    assert "29 % below the fleet's 1.00 MN m/rad" in second[1]
    assert "robots differ by" in second[1]
    html = render(content)
    assert '<a href="rows/r7/report.html">r7</a>' in html
    assert "rows/r9/report.html" not in html
    figure = figure_of(content)
    assert figure.curves[2].name == "off the fleet"
    assert len(figure.curves[2].x) == 2


def test_of_many_rows_the_page_shows_how_they_are_distributed():
    found = found_in(with_outliers(400))
    values, strangers = figure_of(report_content(found)).curves
    assert len(values.x) == 201
    assert (values.y[0], values.y[-1]) == (
        min(found.collected["elastic", SPRING].middle),
        max(found.collected["elastic", SPRING].middle),
    )
    assert strangers.x[0] == 0.0  # the softest of all
    few = len(render(report_content(found_in(with_outliers(301)))))
    assert len(render(report_content(found_in(with_outliers(2000))))) < few + 20_000


def test_very_many_failures_and_outliers_are_named_in_part():
    fleet = list(sound(1000))
    fleet[:300] = [failed(each.id, "the log server is down") for each in fleet[:300]]
    fleet[300:550] = [with_factor(each, SPRING, 0.1) for each in fleet[300:550]]
    found = found_in(fleet)
    assert len(found.comparison.off) == 250
    assert len(flagged(found)) == 400
    outliers = section(report_content(found), "Outliers").tables[0]
    assert len(outliers.rows) == 200
    assert "50 more" in outliers.caption


def test_rows_that_are_all_well_make_a_page_without_failures():
    content = report_content(found_in(list(sound(10))))
    assert content.verdict.level == "ok"
    assert content.sections[0].lead.startswith("No row is off the fleet: a chance of 1 %")


@pytest.mark.parametrize("changed", [{"id": "r9"}, {"grades": {"elastic": (1, "It predicts.")}}])
def test_a_page_that_says_the_same_is_not_written_again(tmp_path, changed):
    path = tmp_path / "report.html"
    assert write_report(path, found_in(ROWS)) == "made"
    assert write_report(path, found_in(ROWS)) == "fresh"
    assert write_report(path, found_in([replace(ROWS[0], **changed), *ROWS[1:]])) == "made"


def test_the_page_of_a_failure_says_what_is_known_of_it_and_is_small():
    row = replace(failed("r3", "a channel is dead"), warnings=("the log is short",), inputs={"robot": FileKey("abc")})
    html = render(failure_content(row, {"campaigns": {"log": {"periods": 3, "payload_kg": None}}}))
    for text in ("logs/r3.csv", "a channel is dead", "log again", "the log is short", "abc", "campaigns.log.periods"):
        assert text in html
    assert "payload_kg" not in html
    assert len(html) < 100_000
