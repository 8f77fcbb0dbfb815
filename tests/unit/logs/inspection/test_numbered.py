"""Recordings side by side in one log, told apart by a number in their names."""

from pathlib import Path

import numpy as np
import pytest

from robid.logs.inspection.contents import Column, part_numbered


def parted(*names: str):
    numbered, columns = part_numbered([Column(name, np.zeros(9)) for name in names])
    return numbered, [one.name for one in columns]


def test_the_first_of_several_experiments_is_looked_at_and_all_are_named():
    numbered, names = parted("exp1.tau(:,1)", "exp1.q", "exp2.tau(:,1)", "exp2.q", "t")
    assert names == ["exp1.tau(:,1)", "exp1.q", "t"]
    assert numbered.count == 2
    assert numbered.place_among(2) == (
        "experiment",
        "2 recordings side by side, `exp1` to `exp2`, experiments by their name",
    )
    assert numbered.write("exp1.tau(:,1)", "experiment") == "exp{experiment}.tau(:,1)"
    assert numbered.write("t", "experiment") == "t"


@pytest.mark.parametrize("stem", ["joint", "axis", "motor", "q", "Y", "X"])
def test_numbers_of_joints_are_none_of_recordings(stem):
    names = [f"{stem}{number}.{signal}" for number in (1, 2) for signal in ("tau", "q")]
    assert parted(*names) == (None, names)


@pytest.mark.parametrize(
    ("stem", "count", "n_input", "place", "doubt"),
    [
        ("exp", 3, 2, "realization", "2 inputs take no more experiments"),
        ("exp", 3, 1, "realization", "1 input takes no more experiments"),
        ("realization_", 2, 2, "realization", "by their name"),
        ("run", 2, 2, "experiment", "may be realizations"),
        ("run", 3, 2, "realization", "may be experiments"),
        ("trial", 2, 1, "realization", "may be experiments"),
        ("config", 2, 1, "configuration", "2 configurations"),
    ],
)
def test_what_a_name_does_not_tell_is_said(stem, count, n_input, place, doubt):
    numbered, _ = parted(*(f"{stem}{index + 1}.{signal}" for index in range(count) for signal in ("tau", "q")))
    found, check = numbered.place_among(n_input)
    assert found == place
    assert doubt in check


@pytest.mark.parametrize(
    ("names", "reason"),
    [
        (("exp2.tau", "exp3.tau"), "do not count from 1"),
        (("exp1.tau", "exp2.torque"), "have other variables"),
    ],
)
def test_what_no_mapping_reads_is_left_to_the_first(names, reason):
    numbered, kept = parted(*names)
    assert kept == [names[0]]
    assert numbered.count == 1
    assert reason in numbered.place_among(2)[1]


def test_leading_zeros_are_kept():
    numbered, _ = parted(*(f"run{index:02d}/tau" for index in range(1, 11)))
    assert numbered.count == 10
    assert numbered.write("run01/tau", "realization") == "run{realization:02d}/tau"


def test_the_same_names_in_several_files_are_other_signals():
    columns = [Column(f"exp{index}.tau", np.zeros(9), file=file) for index in (1, 2) for file in (None, Path("b.mat"))]
    numbered, kept = part_numbered(columns)
    assert numbered.count == 2
    assert kept == columns[:2]
