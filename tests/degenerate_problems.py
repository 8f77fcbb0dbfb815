"""Problems by seed for every solver: near-singular, stiff, badly scaled, degenerate. Each is a name and a call."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

import robid
from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from external_shots import CHANNELS, answer, sweep, transfer
from external_shots import PERIOD_S as EXTERNAL_S
from linear_loop import LINES, N_SAMPLE, STEP_S, Loop, draw_reference
from lpv_systems import FREQUENCY, local_responses
from rigid_logs import PERIOD_S as RIGID_S
from rigid_logs import fourier_motion
from rigid_robots import planar_arm
from robid.frf.frf import Frf
from robid.robot.regressor.model import build_rigid_model
from robid.signals.quantities import motor_channels

PLACES = np.array([[0.3, -0.8], [-0.5, 1.1], [0.9, 0.4]])
BAND_HZ = np.geomspace(3, 80, 12)


def _pick(generator, changes):
    """One or two of some changes, or none."""
    count = int(generator.choice([0, 1, 1, 2]))
    return [str(name) for name in generator.choice(list(changes), count, replace=False)]


def _changed(value, names, changes, generator):
    for name in names:
        value = changes[name](value, generator)
    return value


def _power(generator, low, high):
    return float(10.0 ** generator.uniform(low, high))


# Robots: stiffness over 1e-2 to 1e12, no damping, inertias over 1e-9 to 1e9 of each other.
def _joints(robot, **changes):
    """The robot with something of every joint changed."""
    made = [replace(joint, **{name: make(joint) for name, make in changes.items()}) for joint in robot.joints]
    return replace(robot, joints=tuple(made))


def _rotors(robot, factor):
    return _joints(robot, motor=lambda joint: replace(joint.motor, inertia_kgm2=factor * joint.motor.inertia_kgm2))


def _link(joint, factor):
    body = joint.link
    return replace(body, mass_kg=factor * body.mass_kg, inertia_kgm2=factor * body.inertia_kgm2)


ROBOTS = {
    "stiffness": lambda robot, g: with_spring_factors(robot, 10.0 ** g.uniform(-6, 8, len(robot.springs))),
    "undamped": lambda robot, _g: with_spring_factors(robot, 1.0, 0.0),
    "damping": lambda robot, g: with_spring_factors(robot, 1.0, 10.0 ** g.uniform(-9, 9, len(robot.springs))),
    "rotors": lambda robot, g: _rotors(robot, _power(g, -9, 9)),
    "links": lambda robot, g: _joints(robot, link=lambda joint: _link(joint, _power(g, -9, 9))),
    "weightless": lambda robot, _g: replace(robot, gravity_m_s2=np.zeros(3)),
}


# Responses
def _columns_alike(frf, g):
    response = frf.response.copy()
    response[..., 1] = response[..., 0] * (1 + g.choice([0.0, 1e-13, 1e-6]))
    return replace(frf, response=response)


def _without(frf, where):
    response = frf.response.copy()
    response[where] = 0
    return replace(frf, response=response)


def _scaled(frf, factor):
    covariance = None if frf.total_covariance is None else frf.total_covariance * factor**2
    return replace(frf, response=frf.response * factor, total_covariance=covariance)


def _of_rank_one(frf, _g):
    first, row = frf.response[..., :1], frf.response[..., :1, :]
    with np.errstate(all="ignore"):  # of what is no number already
        return replace(frf, response=first @ row / np.where(first[..., :1, :] == 0, 1, first[..., :1, :]))


def _covariance(frf, make):
    return frf if frf.total_covariance is None else replace(frf, total_covariance=make(frf.total_covariance))


RESPONSES = {
    "columns alike": _columns_alike,
    "zero column": lambda frf, g: _without(frf, (..., int(g.integers(frf.response.shape[-1])))),
    "zero row": lambda frf, g: _without(frf, (..., int(g.integers(frf.response.shape[-2])), slice(None))),
    "zero place": lambda frf, g: _without(frf, int(g.integers(len(frf.response)))),
    "zero": lambda frf, _g: _without(frf, ...),
    "constant": lambda frf, _g: replace(frf, response=np.ones_like(frf.response)),
    "rank one": _of_rank_one,
    "copies": lambda frf, _g: frf.select([0] * len(frf.response)),
    "scale": lambda frf, g: _scaled(frf, _power(g, -9, 9)),
    "noise zero": lambda frf, _g: _covariance(frf, np.zeros_like),
    "noise tiny": lambda frf, g: _covariance(frf, lambda c: c * _power(g, -20, -9)),
    "noise huge": lambda frf, g: _covariance(frf, lambda c: c * _power(g, 2, 12)),
    "noise of one output": lambda frf, _g: _covariance(frf, lambda c: c * (np.arange(c.shape[-1]) == 0)),
    "noise of rank one": lambda frf, _g: _covariance(frf, lambda c: np.abs(c).max() * np.ones_like(c)),
    "noise unknown": lambda frf, _g: replace(frf, total_covariance=None, total_degrees_of_freedom=0.0),
    "few realizations": lambda frf, g: replace(frf, total_degrees_of_freedom=float(g.choice([0.5, 1.0, 3.0]))),
    "not a number": lambda frf, g: replace(
        frf, response=np.where(g.random(frf.response.shape) < 0.1, np.nan, frf.response)
    ),
}
BANDS = {
    "usual": BAND_HZ,
    "one line": BAND_HZ[5:6],
    "two lines": BAND_HZ[5:7],
    "slow": np.geomspace(1e-3, 1e-2, 12),
    "fast": np.geomspace(1e3, 1e4, 12),
    "to the end": np.linspace(400, 499.9, 12),
}


def elastic(seed):
    """A fit of springs and dampers of two joints."""
    g = np.random.default_rng([1, seed])
    data, file = _pick(g, RESPONSES), _pick(g, ROBOTS)[:1]
    band = str(g.choice(list(BANDS), p=[0.5, 0.1, 0.1, 0.1, 0.1, 0.1]))
    options = {
        "estimator": str(g.choice(["lls", "nls", "llsm"])),
        "weights": {"kind": str(g.choice(["user", "optimal", "optimal_full", "inflated", "estimated"]))},
        "free": [("stiffness", "damping"), ("stiffness",), ("stiffness", "damping", "viscous", "motor_inertia")][
            seed % 3
        ],
        "strategy": str(g.choice(["staged", "plain"])),
        "correct_torques": False,
    }

    def call():
        truth = with_spring_factors(two_joint_robot(), 1.2, 0.8)
        period = 1e-3 if band != "fast" else 1e-5
        measured = exact_frf(truth, PLACES, BANDS[band], sampling_period_s=period, relative_noise=0.02, seed=seed)
        robot = _changed(two_joint_robot(), file, ROBOTS, g)
        return robid.fit_model(
            "elastic", robid.RobotModel(robot, period), _changed(measured, data, RESPONSES, g), **options
        )

    return f"{data} {file} {band} {options}", call


# Records of two motors on one load
@cache
def _loop(noise):
    generator = np.random.default_rng(3)
    _, reference = draw_reference(generator, (4,), 1.0)
    torque, angle = Loop(noise, 1e-3 * noise).simulate(reference, generator, periods=3)
    return torque, angle, reference


SIGNALS = {
    "silent input": lambda u, y, _g: (u * [1, 0], y),
    "nearly silent input": lambda u, y, g: (u * [1, _power(g, -15, -6)], y),
    "inputs alike": lambda u, y, g: (u @ np.array([[1, 1], [0, g.choice([0.0, 1e-13, 1e-8])]]), y),
    "output zero": lambda u, y, _g: (u, y * [1, 0]),
    "outputs zero": lambda u, y, _g: (u, 0 * y),
    "inputs zero": lambda u, y, _g: (0 * u, y),
    "outputs constant": lambda u, y, _g: (u, 0 * y + 3.0),
    "inputs constant": lambda u, y, _g: (0 * u + 2.0, y),
    "realizations alike": lambda u, y, _g: (u[[0] * len(u)], y[[0] * len(y)]),
    "periods alike": lambda u, y, _g: (u[:, :, [0] * u.shape[2]], y[:, :, [0] * u.shape[2]]),
    "experiments alike": lambda u, y, _g: (u[:, [0] * u.shape[1]], y[:, [0] * u.shape[1]]),
    "one realization": lambda u, y, _g: (u[:1], y[:1]),
    "one period": lambda u, y, _g: (u[:, :, :1], y[:, :, :1]),
    "one experiment": lambda u, y, _g: (u[:, :1], y[:, :1]),
    "torque scale": lambda u, y, g: (u * _power(g, -9, 9), y),
    "angle scale": lambda u, y, g: (u, y * _power(g, -9, 9)),
    "offset": lambda u, y, g: (u, y + _power(g, 0, 9)),
    "ramp": lambda u, y, g: (u, y + _power(g, -3, 3) * np.linspace(0, 1, y.shape[-2])[:, None]),
    "saturated": lambda u, y, _g: (np.clip(u, -0.1 * u.std(), 0.1 * u.std()), y),
    "quantised": lambda u, y, g: (u, np.round(y, int(g.integers(0, 4)))),
    "output is input": lambda u, _y, _g: (u, u),
    "few samples": lambda u, y, g: (lambda n: (u[..., :n, :], y[..., :n, :]))(int(g.integers(2, 40))),
}
ESTIMATORS = ("logarithmic", "arithmetic", "joint", "h1", "indirect", "robust_local", "local", "local_periodic")


def response(seed):
    """An estimate of a frequency response."""
    g = np.random.default_rng([2, seed])
    data, estimator = _pick(g, SIGNALS), ESTIMATORS[seed % len(ESTIMATORS)]
    lines = {
        "all": LINES,
        "one": LINES[3:4],
        "two": LINES[3:5],
        "silent too": np.r_[LINES, 60],
        "silent": np.arange(60, 80),
    }
    chosen = str(g.choice(list(lines), p=[0.6, 0.1, 0.1, 0.1, 0.1]))
    step = STEP_S * float(g.choice([1.0, 1.0, 1e-6, 1e6]))
    noise, pooled = float(g.choice([0.0, 1e-3])), int(g.choice([1, 3, 101]))

    def call():
        u, y, reference = _loop(noise)
        for name in data:
            u, y = SIGNALS[name](u, y, g)
        n_sample = u.shape[-2]
        known = lines[chosen] if n_sample == N_SAMPLE else np.arange(1, max(2, (n_sample - 1) // 2))
        record = robid.make_record(u[None], y[None], step, frequency_hz=known / (n_sample * step))
        if record.inputs.shape[1:3] == reference.shape[:2] and n_sample == N_SAMPLE:
            channels = motor_channels(("motor_1", "motor_2"), "speed_reference")
            record = replace(record, reference=reference[None], reference_channels=channels)
        return robid.estimate_frf(record, estimator=estimator, pooled_lines=pooled)

    return f"{data} {estimator} {chosen} {step:g} {noise:g} {pooled}", call


# Logs of a rigid arm
@cache
def _rigid_log(noise, share):
    robot, generator = planar_arm(3), np.random.default_rng(4)
    model = build_rigid_model(robot)
    position, velocity, acceleration = fourier_motion(robot, 1500, 4, share) @ robot.motor_per_arm.T
    torque = model.torques(model.nominal, position, velocity, acceleration)
    return torque + noise * torque.std(axis=0) * generator.standard_normal(torque.shape), position


MOTIONS = {
    "torque zero": lambda u, y, g: (u * (np.arange(3) != g.integers(3)), y),
    "torques zero": lambda u, y, _g: (0 * u, y),
    "torques constant": lambda u, y, _g: (0 * u + 3.0, y),
    "axis at rest": lambda u, y, g: (u, np.where(np.arange(3) == g.integers(3), 0.3, y)),
    "at rest": lambda u, y, _g: (u, 0 * y + 0.3),
    "axes alike": lambda u, y, _g: (u, y[:, [0, 0, 0]]),
    "torques alike": lambda u, y, _g: (u[:, [0, 0, 0]], y),
    "torque scale": lambda u, y, g: (u * _power(g, -9, 9), y),
    "angle scale": lambda u, y, g: (u, y * _power(g, -9, 9)),
    "straight": lambda u, y, _g: (u, np.linspace(0, 1, len(y))[:, None] * np.ones(3)),
    "steps": lambda u, y, _g: (np.sign(u), np.sign(y)),
    "quantised": lambda u, y, g: (u, np.round(y, int(g.integers(0, 4)))),
    "clipped": lambda u, y, g: (np.clip(u, -_power(g, -6, 0), 1.0), y),
    "few samples": lambda u, y, g: (lambda n: (u[:n], y[:n]))(int(g.integers(2, 300))),
    "noise": lambda u, y, g: (g.standard_normal(u.shape), g.standard_normal(y.shape)),
}


def rigid(seed):
    """A fit of masses, inertias and friction."""
    g = np.random.default_rng([3, seed])
    data, file = _pick(g, MOTIONS), [name for name in _pick(g, ROBOTS)[:1] if name in ("rotors", "links", "weightless")]
    noise, share = float(g.choice([0.0, 0.01, 1e4])), float(g.choice([0.6, 0.6, 1e-6]))
    options = {"estimator": str(g.choice(["ordinary", "weighted", "huber"])), "physical": bool(g.random() < 0.7)}
    options["filters"] = [{}, {"position_cut_hz": _power(g, -2, 3)}][int(g.random() < 0.3)]
    period, held_out = RIGID_S * float(g.choice([1.0, 1.0, 1e-6, 1e6])), str(g.choice(["", "", "same kind", "zero"]))

    def call():
        u, y = _rigid_log(noise, share)
        for name in data:
            u, y = MOTIONS[name](u, y, g)
        robot = robid.RobotModel(_changed(planar_arm(3), file, ROBOTS, g), period)
        records = [
            robid.make_record(*pair, period, names=robot.joints, held=False) for pair in ((u, y), (0 * u, 0 * y))
        ]
        if held_out:
            records[1] = (
                records[1]
                if held_out == "zero"
                else robid.make_record(*_rigid_log(0.02, 0.5), period, names=robot.joints, held=False)
            )
            options["validate_on"] = records[1]
        return robid.fit_model("rigid", robot, records[0], **options)

    return f"{data} {file} {noise:g} {share:g} {options} {period:g} {held_out}", call


# Commands and motions of two axes
@cache
def _axes(noise, n_sample=600):
    generator, pairs = np.random.default_rng(5), []
    for name, level in (("Y", 1.0), ("Z", 0.7)):
        model, command = transfer(*CHANNELS[name]), level * sweep(5.0, n_sample)
        pairs.append((command, answer(model, command) + noise * generator.standard_normal(n_sample)))
    u, y = np.zeros((2, 1, 1, 2, 1, n_sample, 2))
    for axis, (command, motion) in enumerate(pairs):
        u[0, 0, axis, 0, :, axis], y[0, 0, axis, 0, :, axis] = command, motion
    return u, y


COMMANDS = {
    "one axis": lambda u, y, _g: (u[:, :, :1, ..., :1], y[:, :, :1, ..., :1]),
    "commands zero": lambda u, y, _g: (0 * u, y),
    "command zero": lambda u, y, _g: (u * (np.arange(u.shape[-1]) == 0), y),
    "motions zero": lambda u, y, _g: (u, 0 * y),
    "motion zero": lambda u, y, _g: (u, y * (np.arange(y.shape[-1]) > 0)),
    "commands constant": lambda u, y, _g: (0 * u + 1.0, y),
    "motions constant": lambda u, y, _g: (u, 0 * y + 1.0),
    "commands alike": lambda u, y, _g: (u[..., [0] * u.shape[-1]], y),
    "motion is command": lambda u, _y, g: (u, float(g.choice([-1.0, 1.0, 2.0])) * u),
    "command scale": lambda u, y, g: (u * _power(g, -9, 9), y),
    "motion scale": lambda u, y, g: (u, y * _power(g, -9, 9)),
    "offset": lambda u, y, g: (u, y + _power(g, 0, 9)),
    "step": lambda u, y, _g: (1.0 * (np.arange(u.shape[4]) > 5)[:, None] + 0 * u, y),
    "ramp": lambda u, y, _g: (np.linspace(0, 1, u.shape[4])[:, None] + 0 * u, y),
    "tone": lambda u, y, _g: (np.sin(0.1 * np.arange(u.shape[4]))[:, None] + 0 * u, y),
    "unstable": lambda u, _y, _g: (u, np.cumsum(np.cumsum(u, axis=4), axis=4)),
    "grows": lambda u, y, _g: (u, np.exp(0.05 * np.arange(u.shape[4]))[:, None] + 0 * y),
    "late": lambda u, y, g: (u, np.roll(y, int(g.integers(1, 300)), axis=4)),
    "few samples": lambda u, y, g: (lambda n: (u[..., :n, :], y[..., :n, :]))(int(g.integers(2, 100))),
    "noise": lambda u, y, g: (g.standard_normal(u.shape), g.standard_normal(y.shape)),
}


def external(seed):
    """A fit of transfer functions from commands to motions."""
    g = np.random.default_rng([4, seed])
    data, noise = _pick(g, COMMANDS), float(g.choice([0.0, 1e-4, 0.3]))
    options = {
        "matrix": str(g.choice(["diagonal", "diagonal", "full"])),
        "max_poles": 3,
        "max_delay_samples": 2,
        "rule": str(g.choice(["evidence", "sufficient"])),
        "start": str(g.choice(["auto", "rest", "free", "periodic"])),
        "static_gain": str(g.choice(["free", "one"])),
        "offset": str(g.choice(["auto", "none", "estimated"])),
        "stable": bool(g.random() < 0.7),
    }
    options |= [{}, {"poles": int(g.integers(1, 7)), "zeros": 0}][int(g.random() < 0.3)]
    period = EXTERNAL_S * float(g.choice([1.0, 1.0, 1e-6, 1e6]))

    def call():
        u, y = _axes(noise)
        for name in data:
            u, y = COMMANDS[name](u, y, g)
        names = ["first", "second"][: u.shape[-1]]
        quantity = {"input_quantity": "position", "output_quantity": "position", "linear": True}
        return robid.fit_model("external", robid.make_record(u, y, period, names=names, **quantity), **options)

    return f"{data} {noise:g} {options} {period:g}", call


# Responses along a position
def _local(noise_db, points, step=8, period_s=1.0):
    """Two outputs of one input at positions, as an estimate."""
    made = local_responses(points, np.random.default_rng(6), noise_db=noise_db, frequency=FREQUENCY[::step])
    n_pos, n_freq, n_out, n_in = made.response.shape
    return Frf(
        frequency_hz=made.frequency_hz / period_s,
        lines=np.arange(1, n_freq + 1),
        configurations=points,
        response=made.response,
        input_factor=np.broadcast_to(np.eye(n_in, dtype=complex), (n_pos, n_freq, n_in, n_in)),
        element_scale=np.ones((n_pos, n_out, n_in)),
        total_covariance=made.variance[..., 0, None] * np.eye(n_out, dtype=complex),
        noise_covariance=None,
        total_degrees_of_freedom=1e6,
        noise_degrees_of_freedom=0.0,
        sensitivity=np.zeros((n_pos, 0, n_freq, n_out, n_in), complex),
        coefficient_names=(),
        coefficient_relative_std=np.zeros(0),
        removed_torque_rms=np.zeros((n_pos, n_in)),
        sampling_period_s=period_s,
        input_channels=motor_channels(("drive",), "torque"),
        output_channels=motor_channels(("drive", "table"), "angle"),
    )


_ALONG = np.linspace(-1, 1, 7)[:, None]
POINTS = {
    "usual": _ALONG,
    "one place": 0 * _ALONG,
    "twins": np.array([-1.0, -1, 0, 0, 0, 1, 1])[:, None],
    "close": 1e-9 * _ALONG,
    "far": 1e9 * _ALONG,
    "few": _ALONG[[0, 3, 6]],
}


def lpv(seed):
    """A fit of one state-space model over positions."""
    g = np.random.default_rng([5, seed])
    changes = {
        name: change for name, change in RESPONSES.items() if name not in ("columns alike", "rank one", "zero column")
    }
    data, points = _pick(g, changes), str(g.choice(list(POINTS), p=[0.5, 0.1, 0.1, 0.1, 0.1, 0.1]))
    noise_db, step = float(g.choice([-400.0, -40.0, 40.0])), int(g.choice([8, 8, 100]))
    period = float(g.choice([1.0, 1.0, 1e-6, 1e6]))
    options = {"order": int(g.choice([1, 3, 5])), "weighted": bool(g.random() < 0.7), "path": {"count": 2}}
    options["basis"] = [{"degree": 2}, {"kind": "splines", "degree": 1, "pieces": 2}, {"degree": 9}][int(g.integers(3))]

    def call():
        frf = _local(noise_db, np.clip(POINTS[points], -1, 1), step, period)
        frf = replace(frf, configurations=POINTS[points])
        return robid.fit_model("lpv", _changed(frf, data, changes, g), choose_on=[1], scheduling=[0], **options)

    return f"{data} {points} {noise_db:g} {step} {period:g} {options}", call


def design(seed):
    """A choice of configurations."""
    g = np.random.default_rng([6, seed])
    file, band = _pick(g, ROBOTS), str(g.choice([*BANDS, "none"]))
    places = {
        "usual": lambda: g.uniform(-1.5, 1.5, (20, 2)),
        "one": lambda: g.uniform(-1.5, 1.5, (1, 2)),
        "copies": lambda: np.full((20, 2), 0.4),
        "nearly copies": lambda: 0.4 + 1e-13 * g.standard_normal((20, 2)),
        "none": lambda: np.zeros((0, 2)),
        "far": lambda: 1e9 * g.standard_normal((20, 2)),
        "not a number": lambda: np.full((20, 2), np.nan),
    }
    place = str(g.choice(list(places), p=[0.4, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1]))
    error = float(g.choice([0.03, 0.03, 0.0, 1e-9, 1e9, 1e-3, 1e3]))
    count, criterion = int(g.choice([1, 4, 30])), str(g.choice(["d", "a", "e"]))
    fixed = ("bearing_1.stiffness", "bearing_1.damping") if g.random() < 0.2 else ()

    def call():
        robot = robid.RobotModel(_changed(two_joint_robot(), file, ROBOTS, g), 1e-3, 1e-3)
        lines = np.zeros(0) if band == "none" else BANDS[band]
        return robid.choose_configurations(
            robot, places[place](), lines, count, relative_error=error, criterion=criterion, fixed=fixed
        )

    return f"{file} {band} {place} {error:g} {count} {criterion} {fixed}", call


PROBLEMS = {
    "elastic": elastic,
    "response": response,
    "rigid": rigid,
    "external": external,
    "lpv": lpv,
    "design": design,
}
