"""The table at the end of a run."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO

from rich.console import Console

from robid.report.content import ElementErrors
from robid.report.numbers import MISSING
from robid.report.tables import element_sentence, parameter_line
from robid.report.terminal import fit_tables, parameter_table


def printed(table, width):
    stream = StringIO()
    Console(file=stream, width=width).print(table)
    return stream.getvalue()


def test_every_parameter_with_its_interval(arm_content):
    fit = arm_content.fits[0]
    text = printed(parameter_table(fit), 110)
    lines = [line.split() for line in text.splitlines()]
    for row in fit.parameters:
        if row.kind == "friction":
            assert row.name not in text
            continue
        line = parameter_line(row)
        assert [line.name, line.estimate, line.lower, "…", line.upper] in [words[:5] for words in lines]
    assert "Dampers, bearing_3y: not identifiable: predicted deviation 55 %, above 20 %" in text
    assert "3 more, of friction and ripple, are in the report" in text
    assert sum("outside" in line for line in text.splitlines()) == sum(
        row.covered is False for row in fit.parameters if row.identifiable and row.kind != "friction"
    )


def test_bootstrap_and_what_is_not_determined_are_told_below(arm_content):
    fit = arm_content.fits[0]
    middle = [(row.lower + row.upper) / 2 for row in fit.parameters]
    rows = [
        replace(row, bootstrap=(mean - 1.5 * (mean - row.lower), mean + 1.5 * (row.upper - mean)))
        for row, mean in zip(fit.parameters, middle, strict=True)
    ]
    told = "gear_4.damping is known only to a factor of 3"
    text = printed(parameter_table(replace(fit, parameters=tuple(rows), undetermined=(told,))), 200)
    assert "bootstrap over realizations gives intervals 1.5 times as wide (median; 1.5 to 1.5)" in text
    assert f"{told}." in text
    assert "bootstrap" not in printed(parameter_table(fit), 200)


def test_residuals_beyond_their_covariance_are_told(arm_content):
    fit = arm_content.fits[0]
    assert element_sentence(fit) == ""
    told = element_sentence(replace(fit, element_errors=ElementErrors(0.3, 0.41, 0.012)))
    assert told.startswith("Beyond their covariance are 30 % of the elements, where the model is off by 1.2 % (median)")
    assert "41 % are correlated over frequency" in told


def test_eighty_columns_are_enough_without_truth(bench_content):
    text = printed(parameter_table(bench_content.fits[0]), 80)
    assert "truth" not in text
    assert "545.0 … 547.8" in text
    assert max(map(len, text.splitlines())) <= 80


def test_unknown_torque_constant_makes_ratios(bench_content):
    fit = bench_content.fits[0]
    assert "K_t" not in printed(parameter_table(fit), 100)
    ampere = replace(fit, frf=replace(fit.frf, torque_unit="A"))
    text = printed(parameter_table(ampere), 100)
    assert "Springs, k/K_t" in text
    assert "Motor inertias, J1/K_t" in text
    assert "K_t is unknown: A stands for N m" in text


def test_small_drives_show_the_models_own_modes(arm_content, bench_content):
    shown = [printed(table, 100) for table in fit_tables(bench_content.fits[0])]
    assert len(shown) == 2
    words = next(line.split() for line in shown[1].splitlines() if "antiresonance" in line)
    assert words == ["motor", "antiresonance", "53.95", "53.90", "…", "54.00", "53.97", MISSING]
    assert "1 more that the model does not have are in the report" in shown[1]
    assert len(list(fit_tables(arm_content.fits[0]))) == 1
