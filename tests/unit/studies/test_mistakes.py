from dataclasses import replace
from math import inf, nan
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from robid.results.finding import Finding
from robid.settings.load import load_robot
from robid.signals.quantities import motor_channels
from robid.signals.record import Record
from robid.studies.mistakes.cases import (
    Against,
    Case,
    against_truth,
    mistaken_record,
    mistaken_robot,
    mistaken_truth,
    refused_causes,
)
from robid.studies.mistakes.report import CaseRow, summarise
from robid.studies.settings.defects import Mistake
from tolerances import IDENTITY

ROBOT = load_robot(Path(__file__).parents[2] / "stages" / "arm.yaml")
PLACES = np.array([[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]])


@pytest.fixture
def record():
    """Two motors, whose torques and angles are sines of lines 3 and 5 with two periods of 50 samples."""
    phase = 2 * np.pi * np.arange(100).reshape(2, 50) / 50
    signal = np.stack([np.sin(3 * phase), np.cos(5 * phase)], axis=-1)[None, None, None]
    return Record(
        sampling_period_s=1e-3,
        configurations=PLACES[:1],
        inputs=signal,
        outputs=0.1 * signal,
        reference=None,
        excited_lines=np.array([3, 5]),
        detection_lines=np.zeros(0, int),
        input_channels=motor_channels(("turn", "lift"), "torque"),
        output_channels=motor_channels(("turn", "lift"), "angle"),
        output_offset=np.array([[10.0, 20.0]]),
    )


def read(record, index=0, campaign="estimation", **mistake):
    return mistaken_record(record, Mistake(**mistake), PLACES, index, campaign)


def test_nothing_wrong_changes_nothing(record):
    same = read(record)
    assert np.array_equal(same.inputs, record.inputs)
    assert np.array_equal(same.outputs, record.outputs)
    assert np.array_equal(same.output_offset, record.output_offset)
    assert mistaken_robot(ROBOT, Mistake()) == ROBOT


def test_factors_reach_their_channel_alone(record):
    wrong = read(record, torque_factor={"lift": -1}, angle_factor={"turn": -1})
    assert np.array_equal(wrong.inputs, record.inputs * [1, -1])
    assert np.array_equal(wrong.outputs, record.outputs * [-1, 1])
    assert np.array_equal(wrong.output_offset, record.output_offset * [-1, 1])


def test_the_truth_is_told_relative_to_the_file_that_is_read():
    truth = {"turn.level": -0.1, "turn.shape": 0.2, "gear_turn.stiffness": 3.0}
    told = mistaken_truth(truth, Mistake(friction_factor=1.15))
    stated, true = ROBOT.joints[0].motor.friction.coulomb_nm, 0.9 * ROBOT.joints[0].motor.friction.coulomb_nm
    wrong = mistaken_robot(ROBOT, Mistake(friction_factor=1.15)).joints[0].motor.friction.coulomb_nm
    assert stated > 0
    assert wrong * (1 + told.pop("turn.level")) == pytest.approx(true, rel=IDENTITY)
    assert told == {"turn.shape": 0.2, "gear_turn.stiffness": 3.0}
    assert mistaken_truth(truth, Mistake()) == pytest.approx(truth)


@pytest.mark.parametrize(("index", "told"), [(0, 2), (1, 1), (2, 0)])
def test_swapped_configurations_are_those_of_the_estimation(record, index, told):
    assert np.array_equal(read(record, index, swapped=(0, 2)).configurations, PLACES[told : told + 1])
    assert np.array_equal(read(record, index, "validation", swapped=(0, 2)).configurations, record.configurations)


def test_late_angles_turn_every_line_by_its_delay(record):
    late = read(record, delay_samples=7)
    lines, channel = np.array([3, 5]), np.arange(2)
    for period in range(2):
        before, after = (np.fft.rfft(each.outputs[0, 0, 0, period], axis=0)[lines, channel] for each in (record, late))
        assert after / before == pytest.approx(np.exp(-2j * np.pi * lines * 7 / 50), rel=1e-9)
    assert np.array_equal(late.inputs, record.inputs)


def test_a_robot_file_loses_springs_and_gets_other_ratios():
    springs = tuple(spring.name for spring in ROBOT.all_springs)
    wrong = mistaken_robot(
        ROBOT, Mistake(gear_ratio_factor={"lift": 1.1}, without_springs=("gear_turn",), friction_factor=1.5)
    )
    assert [spring.name for spring in wrong.all_springs] == [name for name in springs if name != "gear_turn"]
    ratios = [[joint.motor.gear_ratio for joint in robot.joints] for robot in (ROBOT, wrong)]
    assert ratios[1] == pytest.approx(np.multiply(ratios[0], [1, 1.1]), rel=IDENTITY)
    for key, factor in (("coulomb_nm", 1.5), ("static_nm", 1.5), ("viscous_nms_rad", 1.0)):
        laws = [[getattr(joint.motor.friction, key) for joint in robot.joints] for robot in (ROBOT, wrong)]
        assert laws[1] == pytest.approx(np.multiply(laws[0], factor), rel=IDENTITY)


def test_only_what_is_simulated_asks_for_another_record():
    assert not Mistake(torque_factor={"a": -1}, swapped=(0, 1), delay_samples=3, without_springs=("b",)).physics
    assert Mistake(imperfections={"hysteresis_nm": 5}).physics == {"imperfections": {"hysteresis_nm": 5}}
    assert Mistake(excitation_factor=0.5).physics == {"excitation_factor": 0.5}


def test_cases_that_read_a_record_alike_share_a_response():
    def case(**mistake):
        return Case("one", Mistake(**mistake), SimpleNamespace(name="heavy"), 3)

    sound, fewer, weighed = case(), case(without_springs=("gear_turn",)), case(imperfections={"hysteresis_nm": 5})
    assert (fewer.simulation, fewer.response) == (sound.simulation, sound.response)
    assert (weighed.simulation == sound.simulation, weighed.response == sound.response) == (False, True)
    for read in ({"torque_factor": {"turn": -1}}, {"friction_factor": 1.1}, {"gear_ratio_factor": {"turn": 1.1}}):
        assert case(**read).simulation == sound.simulation
        assert case(**read).response != sound.response


GOOD = Against(spring_error=0.01, half_widths=2.0, coverage=0.95, holds=True)


@pytest.mark.parametrize(
    ("changes", "grade"),
    [
        ({}, 2),
        ({"coverage": 0.9, "half_widths": 3.0}, 2),
        ({"coverage": 0.89}, 1),
        ({"half_widths": 3.1}, 1),
        ({"spring_error": 0.19, "half_widths": 50.0, "coverage": 0.1}, 1),
        ({"spring_error": 0.21}, 0),
        ({"holds": False}, 0),
        ({"spring_error": nan, "half_widths": nan, "coverage": nan}, 2),
    ],
)
def test_the_right_grade_follows_from_the_truth(changes, grade):
    assert replace(GOOD, **changes).grade == grade


def fitted(**changes):
    stated = {
        "names": ("a.stiffness", "b.stiffness", "c.stiffness", "a.damping"),
        "kinds": ("stiffness", "stiffness", "stiffness", "damping"),
        "identified": np.array([1, 1, 0, 1], bool),
        "value": np.array([110.0, 200.0, 900.0, 7.0]),
        "lower": np.array([110 / 1.02, 190.0, 1.0, 6.0]),
        "upper": np.array([110 * 1.02, 210.0, 1e6, 8.0]),
    }
    return SimpleNamespace(estimate=SimpleNamespace(**{**stated, **changes}))


def test_springs_are_held_against_the_truth_where_they_are_identified():
    truth = {"a.stiffness": 100.0, "b.stiffness": 200.0, "c.stiffness": 100.0, "a.damping": 1.0}
    found = against_truth(fitted(), SimpleNamespace(outcome=SimpleNamespace(ok=True)), truth)
    assert found.spring_error == pytest.approx(0.1)
    assert found.half_widths == pytest.approx(np.log(1.1) / np.log(1.02))
    assert found.coverage == pytest.approx(1 / 3)
    assert found.holds
    unknown = against_truth(fitted(), SimpleNamespace(outcome=SimpleNamespace(ok=False)), {})
    assert np.isnan([unknown.spring_error, unknown.half_widths, unknown.coverage]).all()
    assert unknown.grade == 0


def test_causes_of_a_refusal_are_read_in_their_order():
    first, second = (Finding(cause, "it is odd", decisive=True, strength=2) for cause in ("delay", "angle_sign"))
    assert refused_causes(None, None, f"{first.sentence}; {second.sentence}") == ("delay", "angle_sign")
    assert refused_causes(None, None, "the log is empty") == ()


def row(name, right, given, cause="", causes=(), robot="heavy", **further):
    known = {"spring_error": 0.1, "half_widths": 2.0, "misfit": 1.0, "coverage": 1.0, "refusal": ""}
    return CaseRow(name, robot, cause, causes, right, given, **{**known, **further})


def test_shares_count_what_they_say():
    rows = [
        row("sound", 2, 2),
        row("sound", 2, 1),
        row("sound", 2, 2, robot="light"),
        row("sound", 1, 1, robot="light"),
        row("sign", 0, 0, "torque_sign", ("torque_sign", "delay")),
        row("sign", 0, 1, "torque_sign", ("delay", "torque_sign"), spring_error=0.3),
        row("sign", 1, 0, "torque_sign", (), spring_error=nan, half_widths=nan, refusal="it is odd"),
        row("harmless", 2, 2, "friction"),
        row("nobody", 1, 2, spring_error=inf),
    ]
    found = summarise(rows)
    assert found["false_alarms"] == 2 / 4
    assert found["false_alarms.light"] == 1 / 2
    assert found["sound.deserve_trust"] == 3 / 4
    assert found["graded"] == 3 / 5
    assert found["named"] == 1 / 3
    assert found["sign.graded"] == 2 / 3
    assert found["sign.named"] == 1 / 3
    assert found["sign.grade_mean"] == 1 / 3
    assert found["sign.worst_spring_error"] == 0.3
    assert found["sign.refused"] == 1 / 3
    assert "harmless.named" not in found
    assert "nobody.named" not in found
    assert "nobody.worst_spring_error" not in found
