"""A pole that records cannot tell from zero is an integrator, with a gain per second."""

from dataclasses import replace

import numpy as np
import pytest

from external_loops import channels
from external_shots import PERIOD_S, shot, sweep, transfer
from robid.models.external.fit.fitting import fit_external
from robid.models.external.fit.options import CouplingOptions, ExternalOptions
from robid.models.external.fit.parameters import block_parameters, gain_unit, integrators_of
from robid.models.external.judge.plausible import assess_external
from robid.models.external.page.charts import step_figure, trace_figures
from robid.models.external.page.data import own_section
from robid.models.external.page.report import sections
from robid.models.parameters import parameter_rows
from robid.report.numbers import scale_for
from robid.report.parameters import Estimates, parameter_line
from robid.signals.quantities import Channel
from tolerances import FINITE_DIFFERENCE

GAIN, LAG = 0.6, 15.0
N_SAMPLE = 2500  # 30 s
PORTS = (Channel("cart", "speed_reference", "m/s", "tool"),), channels(("cart",))


def fitted(rate, *, noise=1e-4, order=2, seed=0):
    numerator, denominator = ([GAIN * LAG], np.polymul([1, rate], [1, LAG])) if order == 2 else ([GAIN], [1, rate])
    command = sweep(5.2, N_SAMPLE)
    one = shot(transfer(numerator, denominator), command, noise=noise, seed=seed, start="free", offset=True)
    options = ExternalOptions(poles=order, zeros=0, delay_samples=0, speed_references="kept")
    return fit_external([one], *PORTS, "zoh", options), options


@pytest.fixture(scope="module")
def cart():
    return fitted(0.0)[0]


@pytest.mark.parametrize("rate", [0.0, 1e-9, 0.005])
@pytest.mark.parametrize("order", [1, 2])
def test_an_integrator_is_called_that_with_its_gain_per_second(rate, order):
    estimate = fitted(rate, order=order)[0].estimate
    assert estimate.kinds.count("integrator") == 1
    assert "gain" not in estimate.kinds
    index = estimate.kinds.index("gain_per_second")
    assert estimate.units[index] == "1"  # m/s per m/s
    own = estimate.kinds.index("integrator")
    assert estimate.lower[own] < min(rate, 1e-3) < estimate.upper[own]
    assert estimate.identified.all()
    # What its rate takes away within a record is a few per cent.
    assert estimate.value[index] == pytest.approx(GAIN, rel=0.01 + rate)
    assert estimate.relative_half_width[index] < 0.05
    assert not [sentence for sentence in estimate.undetermined if "pole" in sentence]


def test_a_pole_that_settles_within_a_record_is_none():
    estimate = fitted(0.3)[0].estimate
    assert "integrator" not in estimate.kinds
    assert estimate.value[estimate.names.index("cart.gain")] == pytest.approx(GAIN / 0.3, rel=0.02)


def test_a_pole_that_may_be_zero_counts_where_records_are_too_short_for_it():
    rate, longest_s = 0.1, 20.0  # twice as fast as a record is long
    model = transfer([GAIN], [1, rate])
    for std, count in ((0.01, 0), (0.2, 1)):
        assert integrators_of(model, np.array([[0.0], [std]]), longest_s, 0.95).count == count
    assert integrators_of(model, np.array([[0.0], [0.2]]), 10 * longest_s, 0.95).count == 0


def test_the_gain_per_second_follows_the_coefficients():
    model = transfer([GAIN * LAG], np.polymul([1, 1e-3], [1, LAG]))
    integrators = integrators_of(model, np.zeros((3, 3)), 30.0, 0.95)
    coefficients = np.concatenate([model.numerator.ravel(), model.denominator[1:]])

    def values(at, root):
        moved = replace(model, numerator=at[:1].reshape(1, 1, 1), denominator=np.concatenate([[1.0], at[1:]]))
        return block_parameters("X", ["X"], ["1"], moved, root, integrators)

    rows = values(coefficients, np.eye(3))
    assert [row.kind for row in rows] == ["integrator", "pole", "gain_per_second"]
    for index, value in enumerate(coefficients):
        step = 1e-6 * value
        ends = [values(coefficients + sign * step * np.eye(3)[index], np.eye(3)) for sign in (1, -1)]
        slope = [(one.value - other.value) / (2 * step) for one, other in zip(*ends, strict=True)]
        np.testing.assert_allclose([row.moves[index] for row in rows], slope, rtol=FINITE_DIFFERENCE, atol=1e-8)


@pytest.mark.parametrize(
    ("units", "integrators", "unit"),
    [
        (("m", "m/s"), 0, "m/(m/s)"), (("m", "m/s"), 1, "1"), (("m", "m"), 0, "1"), (("m", "m"), 1, "1/s"),
        (("rad", "N m"), 1, "rad/s/N m"), (("m", "m/s^2"), 2, "1"),
    ],
)  # fmt: skip
def test_units_of_gains(units, integrators, unit):
    assert gain_unit(*units, integrators) == unit


def test_no_number_of_an_integrator_is_read_as_a_rate(cart):
    lines = [parameter_line(row) for row in parameter_rows(cart.estimate, {})]
    (own,) = [line for line in lines if line.name == "cart.pole1"]
    assert own.half_width == "–"  # noqa: RUF001
    assert own.unit == "mrad/s"
    assert "integrator" in own.note
    assert scale_for(6.62e-12, "rad/s", 3e-4).unit == scale_for(3e-4, "rad/s").unit


def test_the_page_writes_it_without_its_rate_and_as_one_that_never_rests(cart):
    shown = sections(cart, Estimates(parameter_rows(cart.estimate, {})), own_section(cart), CouplingOptions())
    (row,) = shown[0].tables[0].texts
    assert row[3].startswith("9.") and row[3].endswith(" s)")  # noqa: PT018
    steps = next(table for section in shown for table in section.tables if table.title == "Steps")
    assert not steps.rows
    assert cart.steps.value.max() < 10  # times the command, in a few of the lag's time constants
    assert not step_figure(cart.steps, 0, float("nan"), 0.95).lines[1:]


def test_axes_follow_the_data_and_not_bounds_that_would_hide_them():
    time = np.arange(100.0)
    measured = 0.041 * np.sin(time)
    for half, hides in ((np.full(100, 10.0), True), (np.full(100, 1e-3), False)):
        trace = replace(trace_of(time, measured), half=half)
        shown, difference = trace_figures(trace, "m")
        assert (shown.y_range is not None) == hides
        if hides:
            low, high = shown.y_range
            assert low < -41 and high > 41  # noqa: PT018
            assert high - low < 4 * 82
            assert np.ptp(difference.y_range) < 4 * 2


def trace_of(time, measured):
    from robid.models.external.page.charts import Trace

    return Trace("motion", time, measured, measured + 1e-3 * np.cos(time))


def test_a_position_that_integrates_its_own_command_is_refused():
    model = transfer([GAIN], [1, 1e-6])
    one = shot(model, sweep(5.2, N_SAMPLE), noise=1e-4, start="free", offset=True)
    options = ExternalOptions(poles=1, zeros=0, delay_samples=0)
    names = channels(("X",), "position_command"), channels(("X",))
    found = fit_external([one], *names, "zoh", options)
    assert found.estimate.units[found.estimate.kinds.index("gain_per_second")] == "1/s"
    assert assess_external(found, options).value == 0
    assert pytest.approx(30) == PERIOD_S * N_SAMPLE
