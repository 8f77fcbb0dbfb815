"""`robid reprocess` on logs of arms with two encoders: a gear whose transmission error has grown is named, no other."""

import json

import numpy as np

from two_encoders import Gear, motion

WORN = "r5"
EXPERIMENT = """\
schema_version: 2
name: gears
robot: arm.yaml
campaigns:
  log:
    source:
      acquire:
        file: ${row.log}
        one_shot: true
        sampling_period_s: 0.004
        inputs:
          - {name: turn, quantity: torque, unit: N m, variable: torque_turn}
          - {name: lift, quantity: torque, unit: N m, variable: torque_lift}
        outputs:
          - {name: turn, quantity: angle, unit: rad, variable: motor_turn}
          - {name: lift, quantity: angle, unit: rad, variable: motor_lift}
          - {name: turn.arm, quantity: angle, unit: rad, variable: arm_turn}
          - {name: lift.arm, quantity: angle, unit: rad, variable: arm_lift}
fits:
  gears: {family: transmission, from: log, rated_torque_nm: {turn: 300, lift: 400}}
"""
COLUMNS = ("torque_turn", "torque_lift", "motor_turn", "motor_lift", "arm_turn", "arm_lift")


def gear_of(number):
    rng = np.random.default_rng(number)
    error = 3e-5 * np.exp(0.1 * rng.standard_normal())
    stiffness = 1e5 * np.exp(0.03 * rng.standard_normal())
    return Gear(stiffness=stiffness, slip=4.0, reach=3e-4, error=3 * error if f"r{number}" == WORN else error)


def write_logs(folder):
    (folder / "logs").mkdir()
    rows = ["id,log"]
    for number in range(1, 10):
        moved = motion(gear_of(number), number, duration_s=16.0)
        values = np.concatenate([moved.torque, moved.motor, moved.arm], axis=1)
        name = f"logs/r{number}.csv"
        np.savetxt(folder / name, values, fmt="%.12g", delimiter=",", header=",".join(COLUMNS), comments="")
        rows.append(f"r{number},{name}")
    (folder / "robots.csv").write_text("\n".join(rows) + "\n")


def test_the_gear_that_has_worn_is_named_and_no_other(shop):
    write_logs(shop.folder)
    (shop.folder / "gears.yaml").write_text(EXPERIMENT)
    answer = shop.robid("reprocess", "robots.csv", "gears.yaml", "--workers", "2")
    assert answer.code == 0, answer.err
    found = json.loads((shop.folder / "runs/gears/fleet.json").read_text())["outliers"]
    assert {each["row"] for each in found} == {WORN}
    assert {each["name"] for each in found} == {"turn.motor_turn_1", "lift.motor_turn_1"}
    for each in found:
        assert each["low"] < gear_of(5).error < each["high"]
