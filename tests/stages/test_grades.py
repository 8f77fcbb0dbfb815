"""A verdict can fail: mistakes that were believed are graded, named and told in every place where a grade is shown."""

import json

import pytest


def _summary(shop):
    return json.loads((shop.runs / "summary.json").read_text())


def test_a_sound_model_of_two_places_is_trusted_everywhere_once_two_more_are_measured(done):
    assert _summary(done)["fits.elastic.grade"] == 1
    assert "measure 2 more configurations" in done.robid("validate", "small.yaml", "--json").json["grade_sentence"]
    done.change("damping: 0}, count: 2}", "damping: 0}, count: 4}")
    assert done.robid("run", "small.yaml").code == 0
    assert _summary(done)["fits.elastic.grade"] == 2
    assert 'class="verdict ok"' in (done.runs / "report.html").read_text()
    told = done.robid("validate", "small.yaml", "--strict", "--json")
    assert told.code == 0
    assert told.json["grade"] == 2


def test_a_reversed_torque_is_not_believed(shop):
    shop.change("seed: 1}\n", "seed: 1, reversed_torque: [lift]}\n")
    answer = shop.robid("run", "small.yaml")
    assert answer.code == 5
    assert "Do not use" in answer.out
    assert "identified" not in answer.out.splitlines()[-2]
    assert "Look first for a torque with the wrong sign" in answer.flat
    assert _summary(shop)["fits.elastic.grade"] == 0
    assert 'class="verdict bad"' in (shop.runs / "report.html").read_text()
    assert shop.robid("run", "small.yaml").code == 5, "what is fresh keeps its grade"
    assert "Do not use" in shop.robid("status", "small.yaml").out
    told = shop.robid("status", "small.yaml", "--json").json["nodes"]
    assert [node["grade"] for node in told if node["output"].endswith("validation.h5")] == [0]


def test_data_of_the_validation_that_contradict_the_robot_file_are_named(shop):
    wrong = "seed: 2, truth: {spring_factor: 1.3, friction_relative: 0.1, seed: 1, reversed_torque: [lift]}}}"
    shop.change("{<<: *simulate, seed: 2}}", f"{{<<: *simulate, {wrong}")
    answer = shop.robid("run", "small.yaml")
    assert answer.code == 5
    assert "Do not use: in campaign validation, lift: its mean torque" in answer.out
    assert "Look first for a torque with the wrong sign" in answer.flat
    told = shop.robid("validate", "small.yaml", "--json")
    assert told.code == 5
    assert "in campaign validation, lift" in told.json["grade_sentence"]


def test_a_fit_that_misses_its_own_data_is_not_to_be_used(shop):
    shop.change(", validate_on: validation", ", fixed: [gear_turn.stiffness, gear_lift.stiffness]")
    answer = shop.robid("run", "small.yaml")
    assert answer.code == 5
    assert _summary(shop)["fits.elastic.grade"] == 0
    assert "of the fit's own data costs" in answer.out
    assert "parameters were fitted" in answer.out
    assert shop.robid("fit", "small.yaml").code == 5
    assert 'class="verdict bad"' in (shop.runs / "report.html").read_text()


def test_a_payload_that_is_off_predicts_at_best_and_strict_refuses_it(shop):
    shop.change("friction: lugre", "friction: lugre, unmodelled_payload_kg: 0.6")
    answer = shop.robid("run", "small.yaml", "--strict")
    assert answer.code == 5
    assert _summary(shop)["fits.elastic.grade"] < 2


def test_without_a_validation_a_fit_predicts_at_best(shop):
    shop.change(", validate_on: validation", "")
    assert shop.robid("run", "small.yaml").code == 0
    assert _summary(shop)["fits.elastic.grade"] == 1
    assert 'class="verdict warn"' in (shop.runs / "report.html").read_text()
    assert shop.robid("fit", "small.yaml").code == 0
    strict = shop.robid("fit", "small.yaml", "--strict")
    assert strict.code == 5
    assert "not validated on data that the fit never saw" in strict.flat


@pytest.mark.parametrize("option", ["fit", "validate", "run"])
def test_strict_is_part_of_no_hash(done, option):
    before = done.contents()
    answer = done.robid(option, "small.yaml", "--strict")
    assert answer.code == (0 if option == "fit" else 5)  # two places predict at best
    assert done.contents() == before
