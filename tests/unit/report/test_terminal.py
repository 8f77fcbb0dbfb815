"""The table at the end of a run."""

from __future__ import annotations

from io import StringIO

from rich.console import Console

from robid.report.tables import parameter_line
from robid.report.terminal import parameter_table


def printed(table, width):
    stream = StringIO()
    Console(file=stream, width=width).print(table)
    return stream.getvalue()


def test_every_parameter_with_its_interval(arm_content):
    fit = arm_content.fits[0]
    text = printed(parameter_table(fit.parameters, identifiable_relative_std=0.2), 110)
    lines = [line.split() for line in text.splitlines()]
    for row in fit.parameters:
        line = parameter_line(row)
        assert [line.name, line.estimate, line.lower, "…", line.upper] in [words[:5] for words in lines]
    assert "Dampers, bearing_3y: not identifiable: predicted deviation 55 %, above 20 %" in text
    assert sum("outside" in line for line in text.splitlines()) == sum(
        row.covered is False for row in fit.parameters if row.identifiable
    )


def test_eighty_columns_are_enough_without_truth(bench_content):
    text = printed(parameter_table(bench_content.fits[0].parameters), 80)
    assert "truth" not in text
    assert "545.0 … 547.8" in text
    assert max(map(len, text.splitlines())) <= 80
