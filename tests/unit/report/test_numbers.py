"""Numbers as an engineer would write them by hand."""

# ruff: noqa: RUF001

from __future__ import annotations

import math

import pytest

from robid.report.numbers import duration, engineering, percent, pretty_unit, scale_for, significant
from robid.report.parameters import ParameterRow, half_width_text


@pytest.mark.parametrize(
    ("value", "unit", "half_width", "written"),
    [
        (4577800.0, "N m/rad", None, "4.578 MN m/rad"),
        (4577800.0, "N m/rad", 45000.0, "4.578 MN m/rad"),
        (4577800.0, "N m/rad", 4500.0, "4.5778 MN m/rad"),
        (2000.0, "N m s/rad", 900.0, "2.00 kN m s/rad"),
        (1.0e-3, "s", None, "1.000 ms"),
        (9.23e-3, "kg m^2", None, "9.230 ×10⁻³ kg m²"),
        (999.96, "N m", None, "1.000 kN m"),
        (-0.25, "N m", None, "−250.0 mN m"),
        (0.0, "s", None, "0 s"),
        (None, "s", None, "–"),
        (3e-9, "N m", math.inf, "3.00 nN m"),
    ],
)
def test_engineering_format(value, unit, half_width, written):
    assert engineering(value, unit, half_width) == written


def test_one_scale_serves_the_estimate_and_what_stands_beside_it():
    scale = scale_for(1.45e6, "N m/rad", 0.02e6)
    assert [scale.text(v) for v in (1.45e6, 0.774e6, 900.0, math.inf, -math.inf, math.nan, None, 3e14)] == [
        "1.45", "0.77", "0.00090", "∞", "−∞", "–", "–", "3.0×10⁸",
    ]  # fmt: skip


@pytest.mark.parametrize("exponent", range(-14, 15))
@pytest.mark.parametrize("mantissa", [1.0, 3.14159, 9.99999])
def test_the_scale_keeps_the_value(exponent, mantissa):
    value = mantissa * 10.0**exponent
    scale = scale_for(value, "N m")
    text = scale.text(value)
    if "×" not in text:
        assert float(text) * 10.0**scale.exponent == pytest.approx(value, rel=0.051 if exponent < -12 else 6e-4)


@pytest.mark.parametrize(
    ("fraction", "written"),
    [
        (0.0123, "1.2 %"),
        (0.00123, "0.12 %"),
        (0.4567, "46 %"),
        (-0.09996, "−10 %"),
        (0.0, "0 %"),
        (math.inf, "> 10 000 %"),
        (None, "–"),
        (math.nan, "–"),
    ],
)
def test_percent(fraction, written):
    assert percent(fraction) == written


def test_percent_can_carry_its_sign():
    assert percent(0.0123, signed=True) == "+1.2 %"


@pytest.mark.parametrize(
    ("value", "digits", "written"),
    [
        (53.974, 4, "53.97"),
        (0.00124, 3, "0.00124"),
        (2e7, 3, "2.00×10⁷"),
        (-1.5e-6, 2, "−1.5×10⁻⁶"),
        (0.0, 3, "0"),
        (0.99996, 3, "1.00"),
        (None, 3, "–"),
        (math.inf, 3, "∞"),
    ],
)
def test_significant(value, digits, written):
    assert significant(value, digits) == written


@pytest.mark.parametrize(
    ("seconds", "written"),
    [
        (0.62, "620 ms"),
        (12.34, "12.3 s"),
        (59.97, "1 min 00 s"),
        (260, "4 min 20 s"),
        (7260, "2 h 01 min"),
        (None, "–"),
    ],
)
def test_duration(seconds, written):
    assert duration(seconds) == written


def test_powers_of_a_unit_become_superscripts():
    assert pretty_unit("rad/(s^2 N m)") == "rad/(s² N m)"
    assert pretty_unit("s^-1") == "s⁻¹"


@pytest.mark.parametrize(
    ("value", "lower", "upper", "written"),
    [
        (329e-9, -7.9e-6, 8.56e-6, "8.23 µs"),  # 25 times the value: a share of it says nothing
        (1e-3, 0.9e-3, 1.1e-3, "10 %"),
        (0.0, -2e-3, 2e-3, "2.00 ms"),
    ],
)
def test_an_interval_wider_than_its_value_is_written_in_its_unit(value, lower, upper, written):
    row = ParameterRow("delay", "delay", "s", 1e-3, value, lower, upper, 0.1)
    assert half_width_text(row) == written
