"""The pendant shows an axis as the sum of two: the mistake is named, and what is to be written repairs it."""

import re

import pytest


@pytest.mark.parametrize("name", ["e", "e_c"])
def test_an_angle_that_is_a_sum_is_named_and_the_remedy_repairs(case, name):
    found = case("fanuc_sum")
    answer = found.robid("run", f"{name}.yaml")
    assert answer.code == 5
    told = " ".join(answer.out.split())
    assert "Look first for a gear that turns with other joints" in told
    weight = re.search(r"`<J3> - (\S+)\*<J2>`", told)[1]
    assert float(weight) == pytest.approx(130 / 150, rel=1e-4)
    path, robot = found.folder / f"{name}.yaml", found.folder / "robot_c.yaml"
    path.write_text(path.read_text().replace("variable: q3}", f"variable: q3 - {weight}*q2}}"))
    robot.write_text(re.sub(r"couplings: \{[^}]*\}, ", "", robot.read_text()))
    answer = found.robid("run", f"{name}.yaml")
    assert answer.code == 0, answer.err
