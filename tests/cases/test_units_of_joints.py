"""Units that no joint of the kind has: refused before anything is read, and right once they are corrected."""

import re


def test_a_force_of_a_revolute_joint_is_refused_and_a_torque_is_taken(case):
    found = case("revolute_in_newton")
    answer = found.robid("status", "e_force.yaml")
    assert answer.code == 2, answer.err
    assert "inputs[1].unit" in answer.flat
    assert "`t1` is in N, but `j1` is revolute" in answer.flat
    wanted = re.search(r"its torque is in ([^,]+),", answer.flat)[1]
    assert found.robid("run", "e_force.yaml").code == 2
    text = (found.folder / "e_force.yaml").read_text()
    (found.folder / "e_force.yaml").write_text(text.replace("unit: N\n", f"unit: {wanted}\n"))
    assert found.robid("status", "e_force.yaml").code == 0
