"""A log of an arm with a gas cylinder: a spring in its place is named, and the cylinder itself gives the truth."""

import pytest
from ruamel.yaml import YAML

# The log's cylinder pulls with 10 kN at a length of 0.3 m, by (1 - x / 1.5 m)^-1.3.
CYLINDER = {"area_m2": 1e-3, "rest_pressure_pa": 5e6, "rest_volume_m3": 1.5e-3, "exponent": 1.3}
TRUE = {
    ("a1.ZZ", "inertia"): 899.3,
    ("a2.MX", "first_moment"): 470.0,
    ("a2", "counterbalance_pressure"): 10e6,
}


def state_gas(folder):
    """States the cylinder in place of the spring."""
    yaml, path = YAML(), folder / "robot.yaml"
    content = yaml.load(path.read_text())
    balance = content["joints"][1]["counterbalance"]
    for key in ("stiffness_n_m", "preload_n"):
        del balance[key]
    balance.update(CYLINDER)
    yaml.dump(content, path)


def fitted(found, name):
    """Grade of a fit, the causes that it names, and its parameters by name."""
    answer = found.robid("run", f"{name}.yaml", "--json")
    assert answer.code == 0, answer.err
    rows = {(row["name"], row["kind"]): row for row in answer.json["parameters"]["arm"]}
    fit = next(node for node in answer.json["nodes"] if node["grade_sentence"])
    return fit["grade_sentence"], rows


@pytest.mark.parametrize("log", ["gas", "spring"])
def test_the_wrong_law_is_named_and_the_right_one_is_not(case, log):
    found = case("gas_balancer")
    as_spring, _ = fitted(found, f"e_{log}")
    assert ("F041" in as_spring) == (log == "gas")
    state_gas(found.folder)
    as_gas, rows = fitted(found, f"e_{log}")
    assert ("F041" in as_gas or "of the counterbalance of a2" in as_gas) == (log == "spring")
    if log == "gas":
        for name, value in TRUE.items():
            lower, upper = (rows[name][key] for key in ("lower", "upper"))
            assert lower < value < upper, (name, lower, upper)
            assert rows[name]["estimate"] == pytest.approx(value, rel=0.01)
