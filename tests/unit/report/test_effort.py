"""What the starts of a fit cost, in figures and words."""

from robid.report.costs import StartRow, effort, effort_text


def test_effort_is_median_most_and_share_at_the_limit():
    ends = [(40, "converged"), (60, "converged"), (300, "iteration_limit"), (50, "converged")]
    rows = tuple(StartRow(index, 1.0, 5, status, 0, count) for index, (count, status) in enumerate(ends))
    found = effort(rows)
    assert (found.median, found.most, found.cap_share) == (55, 300, 0.25)
    assert effort_text(rows) == (
        "They computed the cost 55 times (median), at most 300 times; 25 % ended at the iteration limit."
    )


def test_models_of_older_files_say_nothing():
    rows = (StartRow(0, 1.0, 5, "converged", 0),)
    assert effort(rows) is None
    assert effort_text(rows) == ""
