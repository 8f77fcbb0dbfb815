"""Faults of the study of fleets: drawn as the settings say, and really in signals and files."""

from collections import Counter
from dataclasses import replace
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from scipy.io import loadmat

from robid.models.known import load_experiment
from robid.studies.fleet.logs import Fault, faulty_bytes, faulty_log, log_bytes, plan_robots, softened
from robid.studies.settings.study import KINDS, FleetFaults, FleetStudy

JOINTS = ("turn", "lift")
SIGNALS = Fault("", "", 1, "angle", 0.3, 7, 5)


def study(**faults):
    return FleetStudy(kind="fleet", campaign="c", experiment="e", faults=FleetFaults(**faults))


@pytest.fixture
def log():
    generator = np.random.default_rng(1)

    def channel():
        return generator.integers(-(10**6), 10**6, 3000).astype(np.int32)

    names = [f"{of}_{joint}" for of in ("torque", "angle") for joint in JOINTS]
    return {place: {name: channel() for name in names} for place in ("c1_r1_e1", "c1_r1_e2", "c2_r1_e1")}


def changed(log, found):
    """Channels that differ, by experiment."""
    return {
        (place, name)
        for place, one in log.items()
        for name, values in one.items()
        if not np.array_equal(values, found[place][name])
    }


def test_thirty_robots_have_a_fault_five_of_each_kind_and_always_the_same():
    robots = plan_robots(study(), 2)
    assert len({robot.name for robot in robots}) == len({robot.seed for robot in robots}) == 1000
    assert Counter(robot.kind for robot in robots) == {"": 970, **dict.fromkeys(KINDS, 5)}
    assert robots == plan_robots(study(), 2)
    assert robots != plan_robots(study(seed=2), 2)
    faults = [robot.fault for robot in robots if robot.fault is not None]
    assert {fault.joint for fault in faults} == {0, 1}
    assert all(3 <= fault.samples <= 200 for fault in faults)
    forms = Counter((fault.kind, fault.variant) for fault in faults)
    assert {forms["sign", "torque"], forms["sign", "angle"]} == {2, 3}
    assert {forms["file", "truncated"], forms["file", "overwritten"]} == {2, 3}


def test_a_wrong_sign_turns_one_channel_of_all_experiments(log):
    found = faulty_log(log, replace(SIGNALS, kind="sign"), JOINTS)
    assert changed(log, found) == {(place, "angle_lift") for place in log}
    assert all(np.array_equal(found[place]["angle_lift"], -log[place]["angle_lift"]) for place in log)


@pytest.mark.parametrize(("variant", "least", "most"), [("constant", 0, 0), ("noise", 1.5, 2.5)])
def test_a_dead_channel_says_nothing_of_the_robot(log, variant, least, most):
    found = faulty_log(log, replace(SIGNALS, kind="dead", variant=variant, channel="torque", joint=0), JOINTS)
    assert changed(log, found) == {(place, "torque_turn") for place in log}
    dead = np.concatenate([one["torque_turn"] for one in found.values()])
    assert least <= dead.std() <= most
    assert abs(dead - log["c1_r1_e1"]["torque_turn"][0]).max() < 20


def test_a_gap_takes_the_same_samples_from_all_channels_of_one_experiment(log):
    found = faulty_log(log, replace(SIGNALS, kind="gap"), JOINTS)
    hit = changed(log, found)
    [place] = {place for place, _ in hit}
    assert len(hit) == len(log[place])
    at = int(0.3 * 2993)
    for name, values in log[place].items():
        assert np.array_equal(found[place][name], np.concatenate([values[:at], values[at + 7 :]]))


@pytest.mark.parametrize("kind", ["spring", "payload", "file"])
def test_other_kinds_leave_the_signals_alone(log, kind):
    assert not changed(log, faulty_log(log, replace(SIGNALS, kind=kind), JOINTS))


def test_a_file_is_cut_off_or_overwritten():
    content = bytes(range(256)) * 40
    cut = faulty_bytes(content, replace(SIGNALS, kind="file", variant="truncated"))
    assert cut == content[: int(0.3 * len(content))]
    over = np.frombuffer(faulty_bytes(content, replace(SIGNALS, kind="file", variant="overwritten")), np.uint8)
    where = np.flatnonzero(over != np.frombuffer(content, np.uint8))
    assert (len(over), len(where), np.ptp(where)) == (len(content), 512, 511)
    assert faulty_bytes(content, replace(SIGNALS, kind="gap")) == content


def test_a_log_is_a_file_that_others_read_and_the_same_every_time(log):
    content = log_bytes(log)
    assert content == log_bytes(log)
    read = loadmat(BytesIO(content), simplify_cells=True)
    for place, one in log.items():
        assert all(np.array_equal(read[place][name], values) for name, values in one.items())


def test_a_softened_spring_is_that_of_one_joint_alone():
    robot = load_experiment(Path(__file__).parents[3] / "stages/small.yaml").robot.to_robot()
    soft = {spring.name: spring.stiffness for spring in softened(robot, 1, 0.7).springs}
    assert soft == {
        spring.name: spring.stiffness * (0.7 if spring.name == "gear_lift" else 1) for spring in robot.springs
    }
