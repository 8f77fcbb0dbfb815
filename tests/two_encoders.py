"""Motions of a two-joint arm with encoders on both sides, computed sample by sample by laws of its own."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.optimize import brentq

import robid
from robid.models.transmission.fit.motions import Motion
from robid.robot.regressor.drives import RigidOptions
from robid.robot.regressor.model import build_rigid_model

ARM = Path(__file__).parent / "stages" / "arm.yaml"


@dataclass(frozen=True)
class Gear:
    stiffness: float = 1.0e5
    stiffening: float = 0.0
    steps: tuple[tuple[float, float], ...] = ()  # Torques from which it is so many times as stiff as without load
    slip: float = 0.0
    reach: float = 1e-4
    lag_s: float = 2.3e-3
    error: float = 3e-5  # of one period per motor turn
    noise: float = 1e-6
    eccentricity: float = 2e-5
    play: float = 0.0  # of the link encoder


def robot():
    return robid.load_robot(ARM).description


def bend(gear: Gear, torque):
    """Deflections along torques, with Dahl's hysteresis integrated in its rate form by small steps."""
    found, memory, last = np.empty(len(torque)), 0.0, torque[0] / gear.stiffness

    # Piecewise linear: its corners, as deflection and torque.
    torques, times = [0.0, *(each[0] for each in gear.steps)], [1.0, *(each[1] for each in gear.steps)]
    corners = np.concatenate([[0], np.cumsum(np.diff(torques) / (gear.stiffness * np.array(times[:-1])))])

    def spring(x):
        if not gear.steps:
            return gear.stiffness * (x + gear.stiffening * x**3)
        at = np.searchsorted(corners, abs(x), side="right") - 1
        return np.sign(x) * (torques[at] + times[at] * gear.stiffness * (abs(x) - corners[at]))

    def excess(x, load):
        sense = np.sign(x - last)
        ahead = sense * gear.slip + (memory - sense * gear.slip) * np.exp(-abs(x - last) / gear.reach)
        return spring(x) + ahead - load

    for row, load in enumerate(torque):
        wide = 10 * max(abs(torque).max(), gear.slip) / gear.stiffness
        now = brentq(excess, -wide, wide, args=(load,), xtol=1e-15, rtol=1e-14)
        sense = np.sign(now - last)
        memory = sense * gear.slip + (memory - sense * gear.slip) * np.exp(-abs(now - last) / gear.reach)
        found[row], last = now, now
    return found


def motion(gear: Gear, seed: int, period_s: float = 0.004, duration_s: float = 24.0, size=(1.0, 1.0)) -> Motion:
    """One motion: arms move as told, motors as the gears bend; torques are exact but for noise and friction."""
    rng, arm = np.random.default_rng(seed), robot()
    time_s = np.arange(0, duration_s, period_s)

    def course(at):
        q, v, a = (np.zeros((len(at), 2)) for _ in range(3))
        for joint, spread in enumerate(size):
            for w, phase, amplitude in waves[joint]:
                q[:, joint] += spread * amplitude * np.sin(w * at + phase)
                v[:, joint] += spread * amplitude * w * np.cos(w * at + phase)
                a[:, joint] -= spread * amplitude * w**2 * np.sin(w * at + phase)
        return q, v, a

    waves = [
        [(2 * np.pi * rng.uniform(0.1, 0.9), rng.uniform(0, 6), rng.uniform(0.1, 0.3)) for _ in range(5)]
        for _ in range(2)
    ]
    q, v, a = course(time_s)
    model = build_rigid_model(arm, RigidOptions(friction="none", offsets=False, motor_inertias=False))
    turned = [each @ arm.motor_per_arm.T for each in (q, v, a)]
    behind = model.torques(model.nominal, *turned) @ arm.motor_per_arm
    deflection = np.stack([bend(gear, behind[:, joint]) for joint in range(2)], axis=1)
    ratio = arm.gear_ratio
    theta = (q + deflection) * ratio
    for _ in range(20):  # the transmission error depends on the motor's angle
        theta = (q + deflection - gear.error * np.sin(theta + np.arange(2))) * ratio
    speed = np.gradient(theta, period_s, axis=0)
    inertia = arm.motor_inertia_kgm2 * np.gradient(speed, period_s, axis=0)
    torque = behind / ratio + inertia + 0.2 * np.tanh(speed) + 0.002 * speed
    late = course(time_s - gear.lag_s)[0]
    shown = late + gear.eccentricity * np.sin(late + 0.4)
    if gear.play:
        shown = _behind(shown, 0.5 * gear.play)
    shown += gear.noise * rng.standard_normal(shown.shape)
    torque += 0.02 * rng.standard_normal(torque.shape)
    return Motion(f"motion {seed}", period_s, theta, shown, torque, (0, 1))


def _behind(course, half):
    found = course.copy()
    for row in range(1, len(course)):
        found[row] = np.clip(found[row - 1], course[row] - half, course[row] + half)
    return found
