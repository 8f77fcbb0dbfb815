"""The robots of the study: seeds that no two share, sizes within their bounds, defects that stay the same."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from robid.settings.yaml import load_yaml
from robid.studies.settings.study import load_with_study
from robid.studies.settings.trust import Defects, TrustStudy, drawn_physics, individuals

ROOT = Path(__file__).parents[4]
BEARING = {"joint": "turn", "place": "bearing", "axis": [1, 0, 0], "stiffness_nm_rad": 1e5, "damping_nms_rad": 10}
SPRINGS = [{**BEARING, "name": f"s{number}"} for number in range(4)]


def study(**changed):
    stated = {
        "kind": "trust",
        "fit": "elastic",
        "sets": {"a": {"robots": 3, "referenced": 1, "imperfections": {"hysteresis_nm": 5}}, "b": {"robots": 2}},
        "linear": {"drawn": 2, "file": 1},
        "causes": {"payload": {"named": ["payload"], "imperfections": {"unmodelled_payload_kg": 3}}},
        "cause_robots": 2,
        "seeds": {"judge": {"first": 1001}, "choose": {"first": 301, "robots": 1}},
    }
    return TrustStudy.model_validate({**stated, **changed})


def test_each_robot_has_a_seed_of_its_own():
    found = individuals(study())
    assert [one.seed for one in found] == list(range(1001, 1011))
    assert [one.key for one in found][3:8] == ["b_1004", "b_1005", "payload_1006", "payload_1007", "linear_1008"]
    assert [one.referenced for one in found if one.group == "a"] == [True, False, False]
    first = individuals(study(use="choose"))
    assert [one.key for one in first] == ["a_301", "b_302", "payload_303", "linear_304", "linear_file_305"]


def test_stated_causes_have_stated_sizes():
    payload = next(one for one in individuals(study()) if one.group == "payload")
    assert payload.physics == {"imperfections": {"unmodelled_payload_kg": 3.0}}


def test_sizes_are_drawn_within_their_factor_and_orders_are_not():
    stated = {"hysteresis_nm": 50, "backlash_rad": 3e-5, "second_ripple_order": 2, "friction": "tanh", "ripple": True}
    defects = Defects(imperfections=stated, springs=SPRINGS, springs_each=2, size_factor=1.5, robots=1)
    drawn = [drawn_physics(defects, seed) for seed in range(200)]
    assert drawn[0] == drawn_physics(defects, 0) != drawn[1]
    for key in ("hysteresis_nm", "backlash_rad"):
        logs = np.log([one["imperfections"][key] / stated[key] for one in drawn])
        assert np.abs(logs).max() <= np.log(1.5)
        assert logs.std() == pytest.approx(np.log(1.5) / np.sqrt(3), rel=0.15)
    for one in drawn:
        assert [one["imperfections"][key] for key in ("second_ripple_order", "friction", "ripple")] == [2, "tanh", True]
        names = [spring["name"] for spring in one["truth"]["springs"]]
        assert len(set(names)) == 2
        for spring in one["truth"]["springs"]:
            assert spring["stiffness_nm_rad"] / spring["damping_nms_rad"] == pytest.approx(1e4)
    assert {spring["name"] for one in drawn for spring in one["truth"]["springs"]} == {"s0", "s1", "s2", "s3"}


def test_the_study_of_the_rule_is_as_large_as_it_says():
    stated = load_with_study(ROOT / "configs" / "studies" / "trust.yaml").experiment.study
    found = individuals(stated)
    sizes = {group: sum(one.group == group for one in found) for group in ("a", "b", "light", "linear", "linear_file")}
    assert sizes == {"a": 24, "b": 24, "light": 16, "linear": 40, "linear_file": 10}
    assert sum(one.kind == "cause" for one in found) == 15 * 5
    single = [one for one in found if one.kind == "single"]
    counted = Counter((one.group == "c_sound", one.robot) for one in single)
    assert counted == {(False, "heavy"): 30, (False, "light"): 10, (True, "heavy"): 45, (True, "light"): 15}
    noises = Counter(one.physics["imperfections"]["encoder_noise_rad"] for one in single)
    assert len(noises) == 3
    assert min(noises.values()) >= 30
    hinges = [one for one in single if one.group == "c_hinge"]
    met = {
        (hinge.physics["imperfections"]["torque_noise_nm"], hinge.physics["truth"]["springs"][0]["stiffness_nm_rad"])
        for hinge in hinges
    }
    assert len(met) == len(hinges) == 9
    assert min(one.seed for one in found) >= 9001  # lower ones have been looked at
    assert {one.seed for one in individuals(stated.model_copy(update={"use": "choose"}))} <= set(range(301, 331))
    referenced = [one for one in found if one.referenced and one.robot == "heavy"]
    assert len(referenced) == 24


def single(**changed):
    stated = {
        "noises": {"heavy": [{"torque_noise_nm": 0.1}, {"torque_noise_nm": 0.2}], "light": [{"torque_noise_nm": 0.3}]},
        "defects": {
            "zero": {
                "named": ["zero"],
                "heavy": 4,
                "light": 2,
                "size_factor": 3.0,
                "variants": {
                    "heavy": [{"truth": {"zero_deg": {"turn": 1.0}}}, {"imperfections": {"one_sided": 0.1}}],
                    "light": [{"truth": {"springs": [{**BEARING, "name": "far"}], "friction_relative": 0.1}}],
                },
            }
        },
        "sound": {"heavy": 2},
    }
    return study(single={**stated, **changed})


def test_single_defects_take_turns_in_noise_and_variant_with_sizes_of_their_own():
    found = [one for one in individuals(single()) if one.kind == "single"]
    assert [(one.key, one.robot) for one in found[:3]] == [
        ("c_zero_1011", "heavy"),
        ("c_zero_1012", "heavy"),
        ("c_zero_1013", "light"),
    ]
    assert [one.robot for one in found] == ["heavy", "heavy", "light"] * 2 + ["heavy"] * 2
    noises = [one.physics["imperfections"]["torque_noise_nm"] for one in found]
    assert noises == [
        0.1,
        0.2,
        0.3,
        0.2,
        0.1,
        0.3,
        0.1,
        0.2,
    ]
    zeros = [one.physics["truth"]["zero_deg"]["turn"] for one in (found[0], found[1], found[4])]
    assert len({*zeros}) == 3
    assert np.abs(np.log(zeros)).max() <= np.log(3.0)
    assert "truth" not in found[3].physics
    assert 0.1 / 3 <= found[3].physics["imperfections"]["one_sided"] <= 0.3
    spring = found[2].physics["truth"]["springs"][0]
    assert spring["stiffness_nm_rad"] / spring["damping_nms_rad"] == pytest.approx(1e4)
    assert spring["stiffness_nm_rad"] != 1e5
    assert found[2].physics["truth"]["friction_relative"] == 0.1
    assert all("truth" not in one.physics for one in found[6:])


def test_a_part_of_the_study_has_no_robots_of_the_others():
    text = load_yaml(ROOT / "configs" / "studies" / "trust.yaml").data["study"]
    whole = individuals(TrustStudy.model_validate(text))
    parts = [("a",), ("b", "light"), ("causes",), ("linear",), ("single",)]
    found = [individuals(TrustStudy.model_validate({**text, "only": list(part)})) for part in parts]
    assert [(one.group, one.physics) for one in whole[:24]] == [(one.group, one.physics) for one in found[0]]
    assert [(one.group, one.kind, one.robot) for one in whole] == [
        (one.group, one.kind, one.robot) for part in found for one in part
    ]
    assert {min(one.seed for one in part) for part in found} == {text["seeds"]["judge"]["first"]}
    with pytest.raises(ValidationError, match="lighter"):
        TrustStudy.model_validate({**text, "only": ["lighter"]})
