"""The table at the end of a run."""

from __future__ import annotations

from dataclasses import replace

from robid.report.parameter_section import parameter_table
from robid.report.parameters import parameter_line
from terminals import screen, widest


def test_every_parameter_with_its_interval(arm):
    estimates = arm.fit.estimates
    text = screen(parameter_table(estimates), 110)
    lines = [line.split() for line in text.splitlines()]
    for row in estimates.rows:
        if row.kind == "friction":
            assert row.name not in text
            continue
        line = parameter_line(row)
        assert [line.name, line.estimate, line.lower, "…", line.upper] in [words[:5] for words in lines]
    assert "Dampers, bearing_3y: not identifiable: predicted deviation 55 %, above 20 %" in text
    assert "3 more, of friction and ripple, are in the report" in text
    assert sum("outside" in line for line in text.splitlines()) == sum(
        row.covered is False for row in estimates.rows if row.identifiable and row.kind != "friction"
    )


def test_bootstrap_and_what_is_not_determined_are_told_below(arm):
    estimates = arm.fit.estimates
    middle = [(row.lower + row.upper) / 2 for row in estimates.rows]
    rows = [
        replace(row, bootstrap=(mean - 1.5 * (mean - row.lower), mean + 1.5 * (row.upper - mean)))
        for row, mean in zip(estimates.rows, middle, strict=True)
    ]
    told = "gear_4.damping is known only to a factor of 3"
    text = screen(parameter_table(replace(estimates, rows=tuple(rows), undetermined=(told,))), 200)
    assert "bootstrap over realizations gives intervals 1.5 times as wide (median; 1.5 to 1.5)" in text
    assert f"{told}." in text
    assert "bootstrap" not in screen(parameter_table(estimates), 200)


def test_eighty_columns_are_enough_without_truth(bench):
    text = screen(parameter_table(bench.fit.estimates), 80)
    assert "truth" not in text
    assert "545.0 … 547.8" in text
    assert widest(text) <= 80


def test_unknown_torque_constant_makes_ratios(bench):
    estimates = bench.fit.estimates
    assert "K_t" not in screen(parameter_table(estimates), 100)
    ampere = replace(estimates, torque_unit="A")
    text = screen(parameter_table(ampere), 100)
    assert "Springs, k/K_t" in text
    assert "Motor inertias, J1/K_t" in text
    assert "K_t is unknown: A stands for N m" in text
