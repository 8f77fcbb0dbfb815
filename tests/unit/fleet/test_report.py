"""The page of a fleet: failures by cause, parameters over robots."""

from dataclasses import replace

import pytest

from robid.fleet.ledger import Ledger, RowError
from robid.fleet.report import causes, report_content, write_report
from robid.report.section import Choice

ENTRY = {
    "fit": "elastic", "parameter": "gear_a1.stiffness", "kind": "stiffness", "unit": "N m/rad", "nominal": 1e6,
    "estimate": 1e6, "physical": 1e6, "physical_low": 0.98e6, "physical_high": 1.02e6, "confidence": 0.95,
}  # fmt: skip
DONE = Ledger(
    id="r1", settings_hash="s", settings={}, inputs={}, outputs={}, status="done", error=None, warnings=(),
    grades={"elastic": (2, "Trust.")}, results=(ENTRY,), kept=False, seconds=1.0, finished_utc="",
)  # fmt: skip


def failed(name, message, kind="data"):
    error = RowError(kind, f"{name}.csv", message, "log again")
    return replace(DONE, id=name, status="failed", error=error, grades={}, results=())


LEDGERS = [
    DONE,
    replace(DONE, id="r2", results=({**ENTRY, "physical": 0.7e6, "physical_low": 0.68e6, "physical_high": 0.72e6},)),
    failed("r3", "a channel is dead"),
    failed("r4", "samples are lost"),
    failed("r5", "samples are lost"),
    replace(DONE, id="r6", grades={"elastic": (0, "Do not use: the signs are wrong.")}, results=()),
]


def test_failures_are_grouped_by_cause_the_most_frequent_first():
    assert [(message, ids) for _, message, _, ids in causes(LEDGERS)] == [
        ("samples are lost", ["r4", "r5"]),
        ("a channel is dead", ["r3"]),
    ]


def test_the_page_says_what_failed_and_shows_every_robot_with_its_interval():
    content = report_content("arms", LEDGERS)
    assert content.verdict.text == "3 of 6 rows done; 3 failed; 1 graded do not use."
    failures, parameters, grades = content.sections
    assert failures.tables[0].texts[0][:3] == ("data", "2", "samples are lost")
    [row] = parameters.tables[0].texts
    assert row[0] == "gear_a1.stiffness"
    assert row[3:] == ("2", "1000", "850", "700", "1000", "2.4 %")
    choice = next(part for part in parameters.parts if isinstance(part, Choice))
    figure = choice.options[0][1][0]
    points, intervals = figure.curves
    assert points.y == (1e6, 0.7e6)
    assert points.texts == ("r1: 1.00, 0.98 to 1.02 MN m/rad", "r2: 700, 680 to 720 kN m/rad")
    assert intervals.x == (0, 0, 0, 1, 1, 1)
    assert intervals.y[:2] + intervals.y[3:5] == (0.98e6, 1.02e6, 0.68e6, 0.72e6)
    assert figure.lines[0].at == 1e6
    assert [row[0] for row in grades.tables[0].texts] == ["do not use", "trust"]


def test_rows_that_are_all_well_make_a_page_without_failures():
    content = report_content("arms", [DONE])
    assert (content.verdict.level, len(content.sections)) == ("ok", 2)


@pytest.mark.parametrize("changed", [{"id": "r9"}, {"grades": {"elastic": (1, "It predicts.")}}])
def test_a_page_that_says_the_same_is_not_written_again(tmp_path, changed):
    path = tmp_path / "report.html"
    assert write_report(path, "arms", LEDGERS) == "made"
    assert write_report(path, "arms", LEDGERS) == "fresh"
    assert write_report(path, "arms", [replace(DONE, **changed)]) == "made"
