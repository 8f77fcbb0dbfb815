"""What commands print in a terminal: lines no longer than it is wide, and no number cut."""

import re
import shutil

import numpy as np
import pytest

from terminals import ask_in_terminal, left_out, numbers, widest

WIDTHS = (80, 100, 120)
FRF = "runs/small/estimation/frf.h5"
LOG = "bench.csv"

COMMANDS = {
    "status": ("status", "small.yaml"),
    "a record": ("inspect", "runs/small/estimation/record.h5"),
    "a model": ("inspect", "runs/small/fits/elastic/model.h5"),
    "a design": ("design-configs", "small.yaml", "--force"),
    "an excitation": ("design-excitation", "small.yaml", "--campaign", "validation", "--force"),
    "a comparison": ("compare", "small.yaml:estimation", FRF),
    "a trial": ("fit", "small.yaml", "--try", "load_damping", "--try", "gear_turn.hysteresis"),
    "a log": ("inspect", LOG),
}


@pytest.fixture
def told(done):
    """Runs a command in a terminal, in a folder with a finished run and a log."""
    time = np.arange(2000) * 1e-3
    names = ("t [s]", "manipulator_left_axis_7_motor_current [A]", "manipulator_left_axis_7_position [rad]")
    columns = time, 3 * np.sin(40 * time), 0.2 * np.sin(40 * time - 2.0)
    rows = [",".join(names), *(",".join(f"{value:.9g}" for value in row) for row in zip(*columns, strict=True))]
    (done.folder / LOG).write_text("\n".join(rows), encoding="utf-8")
    return lambda width, name, **environment: ask_in_terminal(width, *COMMANDS[name], **environment)


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_fits_its_terminal_with_whole_numbers(told, name):
    whole = told(400, name)
    assert not left_out(whole.out)[0]
    for width in WIDTHS[: 1 if name == "a trial" else None]:
        answer = told(width, name)
        assert answer.code == whole.code == 0, answer.err
        table = answer.out.partition("\nproposal, ")[0]  # the lines of a file stay as they are
        assert widest(table) <= width
        assert widest(answer.err) <= width
        assert timeless(answer.out) <= timeless(whole.out)
        gone, _, needed = left_out(answer.out)
        assert not gone or needed > width


def timeless(text):
    """The numbers but those that say how long something took."""
    return numbers(re.sub(r"\([^()]*\b(s|ms|min [0-9]+ s)\)", "", " ".join(text.split())))


@pytest.mark.parametrize("environment", [{"NO_COLOR": "1"}, {"TERM": "dumb"}, {}])
@pytest.mark.parametrize("name", ["status", "a model", "a comparison", "a log"])
def test_nothing_breaks_in_a_narrow_or_a_simple_terminal(told, name, environment):
    answer = told(40, name, **environment)
    assert answer.code == 0, answer.err
    assert numbers(answer.out) <= numbers(told(400, name).out)


def test_a_run_says_which_of_how_many_it_makes_on_a_line_that_fits(shop, finished_runs):
    shutil.copytree(finished_runs, shop.folder / "runs")
    shutil.rmtree(shop.runs / "fits")
    (shop.runs / "validation" / "frf.h5").unlink()
    answer = ask_in_terminal(80, "run", "small.yaml")
    assert answer.code == 0, answer.err
    assert widest(answer.err) <= 80
    nodes = shop.states()
    for place, output in enumerate(nodes, 1):
        line = rf"{place} of {len(nodes)}  {re.escape(output)}  .*\d:\d\d"
        assert bool(re.search(line, answer.err)) is output.startswith(("fits", "validation/frf")), output


@pytest.mark.parametrize("environment", [{"NO_COLOR": "1"}, {"TERM": "dumb"}])
def test_a_run_ends_well_in_a_simple_terminal(shop, finished_runs, environment):
    shutil.copytree(finished_runs, shop.folder / "runs")
    (shop.runs / "report.html").unlink()
    answer = ask_in_terminal(40, "run", "small.yaml", **environment)
    assert answer.code == 0, answer.err
    assert "report.html  made" in answer.err


def test_an_error_wraps_in_a_terminal_and_is_a_line_elsewhere(shop):
    shop.change("periods: 2", "perids: 2")
    answer, piped = ask_in_terminal(60, "status", "small.yaml"), shop.robid("status", "small.yaml")
    assert answer.code == piped.code == 2
    assert widest(answer.err) <= 60
    assert len(answer.err.splitlines()) > len(piped.err.splitlines())
    assert answer.flat.startswith(piped.flat)
    assert all("S380" in line for line in piped.err.splitlines() if "perids" in line)
