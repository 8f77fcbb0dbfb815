"""Stiffness that depends on a joint's position, shafts and travels in settings files."""

import copy
from pathlib import Path

import numpy as np
import pytest
from ruamel.yaml import YAML

from robid.errors import SettingsError
from robid.models.known import load_experiment
from robid.settings.load import load_robot
from robid.simulate.options import Truth
from robid.simulate.truth import true_robot

CONFIGS = Path(__file__).parents[3] / "configs"
ROBOT = YAML(typ="safe").load((CONFIGS / "robots/ballscrew.yaml").read_text())
EXPERIMENT = YAML(typ="safe").load((CONFIGS / "ballscrew.yaml").read_text())


def write(folder, change, data=ROBOT, name="robot.yaml"):
    data = copy.deepcopy(data)
    change(data)
    YAML().dump(data, folder / name)
    return folder / name


def test_the_example_is_what_its_comments_say():
    robot = load_robot(CONFIGS / "robots/ballscrew.yaml").to_robot()
    gear, coupling, screw = robot.springs
    assert [spring.place for spring in robot.springs] == ["transmission", "shaft", "shaft"]
    length = 0.55 + np.array([-0.35, 0.4])
    for spring, wanted in ((gear, 1 / (1 / 5e7 + length / 4.22e7)), (screw, 508 / length)):
        slope = np.polynomial.Polynomial(spring.stiffness_over.values)(length - 0.55)
        np.testing.assert_allclose(spring.stiffness / slope, wanted, rtol=1e-3)
    assert coupling.stiffness_over is None
    assert robot.joints[0].motor.gear_ratio * 0.05 == pytest.approx(2 * np.pi)


def test_a_table_is_in_the_joints_unit(tmp_path):
    def change(data):
        data["joints"][0]["gear"]["stiffness_over"] = {
            "joint": "slide",
            "positions_m": [-0.5, 0.0, 0.45],
            "factors": [1.5, 1, 0.8],
        }

    law = load_robot(write(tmp_path, change)).to_robot().springs[0].stiffness_over
    assert law.form == "table"
    assert law.positions.tolist() == [-0.5, 0.0, 0.45]
    assert law.values.tolist() == [1.5, 1.0, 0.8]


def test_the_truths_factors_scale_the_law():
    nominal = load_robot(CONFIGS / "robots/ballscrew.yaml").to_robot()
    true = true_robot(nominal, Truth(spring_factor=2.0))
    assert (np.array([s.stiffness for s in true.springs]) != [s.stiffness for s in nominal.springs]).all()
    assert [s.stiffness_over for s in true.springs] == [s.stiffness_over for s in nominal.springs]


def over(**law):
    def change(data):
        data["joints"][0]["gear"]["stiffness_over"] = {"joint": "slide", **law}

    return change


def shaft(**values):
    def change(data):
        data["springs"][0].update(values)
        for key in [key for key, value in values.items() if value is None]:
            del data["springs"][0][key]

    return change


def both(data):
    shaft(assumed=[])(data)
    data["joints"][0]["gear"]["cubic_n_m3"] = 1e12


WRONG = {
    "an unknown joint": (over(joint="slid", compliance=[1.0]), "there is no joint `slid`; did you mean `slide`"),
    "no form": (over(), "S237 needs one of `factors` with their positions, `stiffness` and `compliance` (found none)"),
    "two forms": (over(stiffness=[1.0], compliance=[1.0]), "found stiffness and compliance"),
    "D157": (over(positions_deg=[-30.0, 30.0], factors=[1.0, 2.0]), "write `positions_m`"),
    "no positions": (over(factors=[1.0, 2.0]), "S239"),
    "no factors": (over(positions_m=[-1.0, 1.0]), "S240"),
    "not as many": (over(positions_m=[-1.0, 0.0, 1.0], factors=[1.0, 2.0]), "has 2 values for 3 positions"),
    "not ascending": (over(positions_m=[1.0, -1.0], factors=[1.0, 2.0]), "S242"),
    "too short": (over(positions_m=[-0.4, 0.45], factors=[1.0, 2.0]), "goes from -0.4 to 0.45 m, but `slide` from"),
    "a spring that vanishes": (over(stiffness=[1.0, -3.0]), "is -0.35 at 0.45 m"),
    "a compliance that vanishes": (over(compliance=[1.0, 3.0]), "is -0.35 at -0.45 m"),
    "an axis": (shaft(axis=[0, 0, 1]), "a shaft turns as its motor does: leave `axis` out"),
    "S316": (shaft(inertia_kgm2=None, assumed=[]), "S245"),
    "an inertia": (shaft(place="bearing", axis=[1, 0, 0]), "S246"),
    "cubic": (both, "`gear_slide` is cubic"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_cannot_be_is_refused_where_it_stands(tmp_path, case):
    change, message = WRONG[case]
    with pytest.raises(SettingsError) as error:
        load_robot(write(tmp_path, change))
    assert message in str(error.value)


def test_a_shaft_before_a_rigid_joint_is_refused(tmp_path):
    def change(data):
        data["joints"][0]["rigid"] = True
        del data["joints"][0]["gear"]

    with pytest.raises(SettingsError) as error:
        load_robot(write(tmp_path, change))
    assert "joint `slide` is rigid: a shaft lies before a transmission" in str(error.value)


def travelling(**values):
    def change(data):
        data["robot"] = str(CONFIGS / "robots/ballscrew.yaml")
        data["campaigns"]["global"]["excitation"]["travel"].update(values)

    return change


WRONG_TRAVEL = {
    "unknown": (travelling(joint="side"), "there is no joint `side`"),
    "unit": (travelling(amplitude_deg=3.0), "has the wrong unit for `slide`: write `amplitude_m`"),
    "line": (travelling(line=5000), "lower travel.line"),
}


@pytest.mark.parametrize("case", WRONG_TRAVEL)
def test_a_travel_that_cannot_be_is_refused(tmp_path, case):
    change, message = WRONG_TRAVEL[case]
    with pytest.raises(SettingsError) as error:
        load_experiment(write(tmp_path, change, EXPERIMENT, "experiment.yaml"))
    assert message in str(error.value)


def test_no_fit_reads_responses_of_what_travels(tmp_path):
    def change(data):
        travelling()(data)
        data["fits"]["lpv"] |= {"from": "global", "choose_on": [0]}

    with pytest.raises(SettingsError) as error:
        load_experiment(write(tmp_path, change, EXPERIMENT, "experiment.yaml"))
    assert "campaign `global` travels, so it has no frequency response to read" in str(error.value)
