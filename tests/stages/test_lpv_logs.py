"""Position-dependent fits of logs: of a machine of which nothing is known, and of a robot's joint."""

import numpy as np
import pytest
from scipy.signal import lfilter

from robid.models.lpv.family import evaluate

RATE_HZ, N_SAMPLE, PERIODS = 200.0, 200, 4
PLACES = {"near": 0.0, "middle": 0.2, "far": 0.5, "between": 0.35, "unseen": 0.1}
CHANNELS = """        inputs: [{name: feed, variable: command, unit: mm, quantity: position_command, side: tool}]
        outputs:
          - {name: table, variable: table, unit: mm, side: tool}
          - {name: slide, variable: slide, unit: mm, side: tool}
"""
EXCITATION = "{period_s: 1, low_hz: 1, high_hz: 60, count: 60, spacing: linear, grid: full, detection_share: 0}"
FIT = (
    "  machine: {family: lpv, from: [near, middle, far, between], choose_on: between, validate_on: unseen,"
    " scheduling: [slide], outputs: [table], order: 2, basis: {degree: 2}, path: {count: 3, smallest: 10}}\n"
)


def filter_at(place):
    """A resonance of 20 to 30 Hz with a delay, in discrete time."""
    angle = 2 * np.pi * (20 + 20 * place) / RATE_HZ
    denominator = np.array([1.0, -2 * 0.9 * np.cos(angle), 0.81])
    return np.array([0.0, denominator.sum()]), denominator


def write_log(path, place, seed):
    generator = np.random.default_rng(seed)
    lines, time = np.arange(1, 61), np.arange((PERIODS + 3) * N_SAMPLE) / RATE_HZ
    phases = generator.uniform(0, 2 * np.pi, len(lines))
    command = np.cos(2 * np.pi * np.outer(time, lines) + phases).sum(axis=1)
    table = lfilter(*filter_at(place), command) + 1e-2 * generator.standard_normal(len(time))
    slide = 1e3 * place + 0.01 * generator.standard_normal(len(time))
    kept = np.column_stack([command, table, slide])[3 * N_SAMPLE :]
    np.savetxt(path, kept, delimiter=",", header="command,table,slide", comments="")


def campaign(name, source, rest=""):
    return (
        f"  {name}:\n    excitation: {EXCITATION}\n    realizations: 3\n    periods: {PERIODS}\n{rest}    source:\n"
        f"      acquire:\n        file: {source}\n        format: csv\n        sampling_period_s: 0.005\n{CHANNELS}"
    )


@pytest.fixture
def machine(shop):
    """An experiment without a robot: one campaign a position, whose place is the mean of an output."""
    (shop.folder / "arm.yaml").unlink()
    for number, (name, place) in enumerate(PLACES.items()):
        for realization in range(3):
            write_log(shop.folder / f"{name}_{realization + 1}.csv", place, 10 * number + realization)
    campaigns = "".join(campaign(name, f'"{name}_{{realization}}.csv"') for name in PLACES)
    text = f"schema_version: 1\nname: small\ncampaigns:\n{campaigns}fits:\n{FIT}execution: {{backend: serial}}\n"
    (shop.folder / "small.yaml").write_text(text)
    return shop


def exact(points, frequency_hz):
    z = np.exp(2j * np.pi * frequency_hz / RATE_HZ)
    found = []
    for place in points:
        top, bottom = filter_at(place)
        found.append((top[1] / z) / (bottom[0] + bottom[1] / z + bottom[2] / z**2))
    return np.array(found)


def test_logs_of_a_machine_are_scheduled_by_the_mean_of_an_output(machine):
    answer = machine.robid("run", "small.yaml", "--strict")
    assert answer.code == 0, answer.err
    model = evaluate(machine.runs / "fits" / "machine" / "model.h5")
    np.testing.assert_allclose([model.basis.lower, model.basis.upper], [[0.0], [0.5]], atol=1e-4)
    points, lines = np.array([0.05, 0.2, 0.45]), np.arange(1.0, 61.0)
    found = model.frozen_response(points[:, None], lines)[..., 0, 0]
    wanted = exact(points, lines)
    assert np.linalg.norm(found - wanted) < 0.02 * np.linalg.norm(wanted)


def test_the_scheduling_of_logs_must_be_recorded(machine):
    machine.change("scheduling: [slide]", "scheduling: [axis_2]")
    machine.refuse(2, "fits.machine.scheduling", "there is no joint or output `axis_2`")


ROBOT_FIT = (
    "  lift: {family: lpv, from: poses, choose_on: [3], validate_on: unseen, scheduling: [lift], order: 2,"
    " basis: {degree: 2}, path: {count: 3, smallest: 10}}\n"
)
JOINT = """        inputs: [{name: lift, variable: command, unit: N m}]
        outputs: [{name: lift, variable: table, unit: rad/s^2}]
"""


def test_logs_of_a_robot_are_scheduled_by_the_joint_of_their_configurations(shop):
    text = (shop.folder / "arm.yaml").read_text()
    first, second = text.index("  - name: turn"), text.index("  - name: lift")
    lines = (text[:first] + text[second:]).splitlines(keepends=True)
    (shop.folder / "arm.yaml").write_text("".join(line for line in lines if "gear_turn" not in line))
    poses = {"poses": (0.0, 0.2, 0.5, 0.35), "unseen": (0.1,)}
    campaigns = ""
    for name, places in poses.items():
        for index, realization in np.ndindex(len(places), 3):
            path = shop.folder / f"{name}_{index + 1}_{realization + 1}.csv"
            write_log(path, places[index], 10 * index + realization)
        angles = ", ".join(f"[{100 * place:g}]" for place in places)
        rest = f"    configurations: {{list_deg: [{angles}]}}\n    estimate: {{compensation: none}}\n"
        campaigns += campaign(name, f'"{name}_{{configuration}}_{{realization}}.csv"', rest).replace(CHANNELS, JOINT)
    (shop.folder / "small.yaml").write_text(
        f"schema_version: 1\nname: small\nrobot: arm.yaml\ncampaigns:\n{campaigns}fits:\n{ROBOT_FIT}"
        "execution: {backend: serial}\n"
    )
    answer = shop.robid("run", "small.yaml", "--strict")
    assert answer.code == 0, answer.err
    model = evaluate(shop.runs / "fits" / "lift" / "model.h5")
    assert model.basis.upper.item() == pytest.approx(np.radians(50))
    points, lines = np.array([0.05, 0.2, 0.45]), np.arange(1.0, 61.0)
    found = model.frozen_response(np.radians(100 * points)[:, None], lines)[..., 0, 0]
    wanted = exact(points, lines)
    assert np.linalg.norm(found - wanted) < 0.02 * np.linalg.norm(wanted)
