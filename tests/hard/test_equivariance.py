"""The same experiment in other units, channels, times, worlds and signs: the same answer, transformed likewise.

Each test also compares with the answer that is not transformed, from which it must differ.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.io import savemat
from scipy.spatial.transform import Rotation

import robid
from default_campaign import CONFIGURATION, ROBOT
from degenerate_problems import _axes, _local, _loop
from exact_systems import exact_frf, springs_everywhere, two_joint_robot, two_mass_robot, with_spring_factors
from linear_loop import LINES, N_SAMPLE, STEP_S
from other_coordinates import in_turned_world, signs_of, with_axis_reversed
from rigid_logs import PERIOD_S, fourier_motion
from robid.logs.importing import import_log
from robid.logs.mapping import LogMapping
from robid.robot.regressor.model import build_rigid_model
from robid.signals.log_channels import InputChannel, OutputChannel
from robid.signals.log_options import TimeChannel
from tolerances import IDENTITY
from two_mass_log import DAMPING, LOAD, MOTOR, STIFFNESS, bench_log
from two_mass_log import LINES as BENCH_LINES
from two_mass_log import PERIOD_S as BENCH_S
from two_mass_log import STEP_S as BENCH_STEP_S

pytestmark = pytest.mark.hard

BAND = np.geomspace(3, 80, 15)
# What descents agree in that take other steps of rounding.
SAME_FIT = 1e-5
PLACES = {
    "two joints": (two_joint_robot(), np.array([[0.3, -0.8], [-0.5, 1.1]])),
    "springs everywhere": (springs_everywhere(), np.array([[0.3, -0.8], [-0.5, 1.1]])),
    "KR300": (ROBOT, np.array([CONFIGURATION, CONFIGURATION + np.array([0.3, 0.2, -0.4, 0.8, -1.2, 0.5])])),
}
ESTIMATORS = ("logarithmic", "arithmetic", "h1", "robust_local", "local", "local_periodic")
TURN = Rotation.from_euler("xyz", [0.7, -1.1, 2.3]).as_matrix()


def differ(one, other, by=0.01):
    """Whether two arrays differ by more than rounding, relative to their size."""
    return float(np.abs(one - other).max()) > by * float(np.abs(one).max())


PREDICTS = ("value", "effective_lower", "effective_upper")
EVERY = (*PREDICTS, "lower", "upper")


def assert_same_fit(one, other, fields=EVERY):
    """Values, intervals and covariance of the parameters agree, whatever their order."""
    own, found = one.parameters, other.parameters
    assert set(own) == set(found)
    for name in own:
        for field in fields:
            assert getattr(found[name], field) == pytest.approx(getattr(own[name], field), rel=SAME_FIT), (name, field)
    if fields is EVERY:
        order = [list(found).index(name) for name in own]
        size = np.sqrt(np.diag(own.covariance))
        scaled = (found.covariance[np.ix_(order, order)] - own.covariance) / np.outer(size, size)
        assert np.abs(scaled).max() < 100 * SAME_FIT
    assert one.found.estimate.status == other.found.estimate.status


def response_of(robot, places):
    return robid.RobotModel(robot, 1e-3, 1e-3).response(places, BAND)


def elastic_fit(robot, measured, **options):
    options = {"free": ("stiffness", "damping"), "correct_torques": False, "delay_s": 1e-3, **options}
    return robid.fit_model("elastic", robid.RobotModel(robot, 1e-3, 1e-3), measured, **options)


def measured_of(robot, places, seed=1):
    """Responses of a robot whose springs differ from its file's, with noise."""
    truth = with_spring_factors(robot, np.linspace(0.8, 1.3, len(robot.springs)), 1.2)
    return exact_frf(truth, places, BAND, delay_s=1e-3, relative_noise=0.01, seed=seed)


# The world
@pytest.mark.parametrize("name", PLACES)
def test_a_robot_in_a_turned_world_responds_alike(name):
    robot, places = PLACES[name]
    plain, turned = (response_of(each, places) for each in (robot, in_turned_world(robot, TURN)))
    np.testing.assert_allclose(turned, plain, rtol=1e-6, atol=1e-9 * np.abs(plain).max())
    # Without its gravity or its first frame it is another robot.
    half = replace(in_turned_world(robot, TURN), gravity_m_s2=robot.gravity_m_s2)
    assert differ(plain, response_of(half, places), 1e-5)


@pytest.mark.parametrize("name", PLACES)
def test_an_elastic_fit_in_a_turned_world_is_the_same(name):
    robot, places = PLACES[name]
    measured = measured_of(robot, places)
    # Intervals of the parts themselves contain what the base may lack, springs about the axes of the world: these turn.
    assert_same_fit(elastic_fit(robot, measured), elastic_fit(in_turned_world(robot, TURN), measured), PREDICTS)


# The sign of a joint
@pytest.mark.parametrize("name", PLACES)
def test_the_sign_of_a_joint_is_that_of_its_row_and_column(name):
    robot, places = PLACES[name]
    for index in range(len(robot.joints)):
        signs, other = signs_of(robot, index), with_axis_reversed(robot, index)
        plain, turned = response_of(robot, places), response_of(other, places * signs)
        np.testing.assert_allclose(
            turned, plain * np.outer(signs, signs), rtol=1e-6, atol=1e-9 * np.abs(plain).max(), err_msg=str(index)
        )
        assert differ(plain, response_of(other, places), 1e-5)  # nor is it the one at the old angles


@pytest.mark.parametrize(
    ("name", "index"), [("two joints", 0), ("two joints", 1), ("springs everywhere", 1), ("KR300", 2)]
)
def test_an_elastic_fit_does_not_depend_on_the_sign_of_a_joint(name, index):
    robot, places = PLACES[name]
    measured, signs = measured_of(robot, places), signs_of(robot, index)
    both = np.outer(signs, signs)
    turned = replace(
        measured,
        configurations=places * signs,
        response=measured.response * both,
        total_covariance=measured.total_covariance * both,
    )
    fit = elastic_fit(robot, measured)
    assert_same_fit(fit, elastic_fit(with_axis_reversed(robot, index), turned))
    if name == "two joints":
        wrong = elastic_fit(with_axis_reversed(robot, index), measured)
        assert differ(fit.found.estimate.value, wrong.found.estimate.value)


# Rigid
def rigid_log(robot, seed=2):
    """Torques and angles of motors along a motion, with noise."""
    model, generator = build_rigid_model(robot), np.random.default_rng(seed)
    position, velocity, acceleration = fourier_motion(robot, 2000, seed) @ robot.motor_per_arm.T
    torque = model.torques(model.nominal, position, velocity, acceleration)
    return torque + 0.01 * torque.std(axis=0) * generator.standard_normal(torque.shape), position


def rigid_fit(robot, torque, position, period_s=PERIOD_S):
    made = robid.RobotModel(robot, period_s)
    record = robid.make_record(torque, position, period_s, names=made.joints, held=False)
    return robid.fit_model("rigid", made, record, filters={"position_cut_hz": 20.0}, physical=False)


def of_links(fit):
    """Values and deviations of base parameters, by name."""
    estimate = fit.found.estimate
    return dict(
        zip(estimate.names, zip(estimate.value, np.sqrt(np.diag(estimate.covariance)), strict=True), strict=True)
    )


def assert_same_parameters(one, other, sign=lambda _name: 1.0):
    """Values are the same but for signs, within a small part of their deviation, and deviations are the same."""
    assert set(one) == set(other)
    for name, (value, deviation) in one.items():
        assert other[name][0] == pytest.approx(sign(name) * value, abs=1e-3 * deviation), name
        assert other[name][1] == pytest.approx(deviation, rel=1e-3), name


@pytest.mark.parametrize("name", ["two joints", "KR300"])
def test_a_rigid_fit_in_a_turned_world_is_the_same(name):
    robot = PLACES[name][0]
    torque, position = rigid_log(robot)
    plain, turned = (of_links(rigid_fit(each, torque, position)) for each in (robot, in_turned_world(robot, TURN)))
    assert_same_parameters(plain, turned)
    half = of_links(rigid_fit(replace(robot, gravity_m_s2=TURN @ robot.gravity_m_s2), torque, position))
    with pytest.raises(AssertionError):
        assert_same_parameters(plain, half)


ODD = ("XY", "XZ", "MY", "MZ")
"""Parameters of a body that half a turn about x changes the sign of."""


@pytest.mark.parametrize(("name", "index"), [("two joints", 0), ("two joints", 1), ("KR300", 3)])
def test_rigid_parameters_follow_the_sign_of_a_joint(name, index):
    robot = PLACES[name][0]
    torque, position = rigid_log(robot)
    signs, own = signs_of(robot, index), robot.joints[index].name
    # The payload's frame is that of the last joint.
    bodies = {own} | ({"payload"} if index == len(robot.joints) - 1 else set())

    def sign(parameter):
        body, _, kind = parameter.rpartition(".")
        odd = kind in ODD or kind in ("offset", "torque_offset")
        return -1.0 if body in bodies and odd else 1.0

    plain = of_links(rigid_fit(robot, torque, position))
    turned = of_links(rigid_fit(with_axis_reversed(robot, index), torque * signs, position * signs))
    assert_same_parameters(plain, turned, sign)
    assert any(sign(parameter) < 0 for parameter in plain)
    with pytest.raises(AssertionError):
        assert_same_parameters(plain, turned)


def test_a_rigid_fit_to_torques_of_another_unit_has_parameters_in_it():
    robot = two_joint_robot()
    torque, position = rigid_log(robot)
    plain, centi = of_links(rigid_fit(robot, torque, position)), of_links(rigid_fit(robot, 100 * torque, position))
    assert_same_parameters({name: (100 * value, 100 * std) for name, (value, std) in plain.items()}, centi)


# Channels and times of responses
def loop_frf(u, y, estimator, names=("first", "second")):
    record = robid.make_record(u[None], y[None], STEP_S, frequency_hz=LINES / (N_SAMPLE * STEP_S), names=names)
    return robid.estimate_frf(record, estimator=estimator)


def assert_same_frf(one, other, order=slice(None)):
    """Responses, variances and covariances agree with inputs and outputs in another order."""
    response, variance = one.response[:, :, order][..., order], one.element_variance()[:, :, order][..., order]
    np.testing.assert_allclose(other.response, response, rtol=1e-7, atol=1e-9 * np.abs(response).max())
    np.testing.assert_allclose(other.element_variance(), variance, rtol=1e-5)
    covariance = one.covariance[:, :, order][..., order]
    np.testing.assert_allclose(other.covariance, covariance, rtol=1e-5, atol=1e-7 * np.abs(covariance).max())
    np.testing.assert_allclose(other.coherence, one.coherence[..., order], rtol=1e-7)
    assert other.degrees_of_freedom == pytest.approx(one.degrees_of_freedom, rel=1e-9)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_motors_in_another_order_permute_the_response(estimator):
    u, y, _ = _loop(1e-3)
    plain, other = loop_frf(u, y, estimator), loop_frf(u[..., ::-1], y[..., ::-1], estimator, ("second", "first"))
    assert_same_frf(plain, other, [1, 0])
    assert differ(plain.response, other.response)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_a_record_that_begins_later_in_its_period_has_the_same_response(estimator):
    u, y, _ = _loop(1e-3)
    late, whole = 37, (*u.shape[:2], -1, 2)

    def cut(signal, begin):  # two of three periods
        samples = signal.reshape(whole)[:, :, begin : begin + 2 * N_SAMPLE]
        return samples.reshape(*u.shape[:2], 2, N_SAMPLE, 2)

    plain, other = (loop_frf(cut(u, begin), cut(y, begin), estimator) for begin in (0, late))
    # Noise is another one: what drifts leaks from the ends, which lie elsewhere.
    allowed = 4 * np.sqrt(plain.element_variance())
    assert (np.abs(other.response - plain.response) < allowed).all()
    # Outputs alone later are another response.
    assert differ(plain.response, loop_frf(cut(u, 0), cut(y, late), estimator).response, 0.1)


def test_an_exact_period_that_begins_later_has_the_same_response():
    """Without noise nothing but rounding is left."""
    generator, gain = np.random.default_rng(3), np.array([[2.0, 1.0], [0.5, -1.0]])
    wave = generator.standard_normal((1, 2, 2, 1, N_SAMPLE, 2))
    u = np.tile(wave, (1, 1, 1, 2, 1, 1))
    y = np.roll(u, 5, axis=4) @ gain.T
    lines = LINES / (N_SAMPLE * STEP_S)

    def found(k, outputs_too=True):
        moved = np.roll(y, k, axis=4) if outputs_too else y
        record = robid.make_record(np.roll(u, k, axis=4), moved, STEP_S, frequency_hz=lines)
        return robid.estimate_frf(record, outputs="measured").response

    delay = np.exp(-2j * np.pi * 5 * LINES / N_SAMPLE)[:, None, None]
    for k in (0, 1, 100):
        np.testing.assert_allclose(found(k)[0], delay * gain, rtol=1e-9)
    early = found(5, outputs_too=False)[0]
    np.testing.assert_allclose(early, np.broadcast_to(gain, early.shape), atol=1e-9)


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_units_of_torque_and_angle_scale_the_response_alone(estimator):
    u, y, _ = _loop(1e-3)
    plain, other = loop_frf(u, y, estimator), loop_frf(100 * u, np.rad2deg(y), estimator)
    factor = np.rad2deg(1.0) / 100
    np.testing.assert_allclose(other.response, factor * plain.response, rtol=1e-7)
    np.testing.assert_allclose(other.element_variance(), factor**2 * plain.element_variance(), rtol=1e-5)
    np.testing.assert_allclose(other.coherence, plain.coherence, rtol=1e-7)


# Units of logs
def bench_record(folder, log, torque, angle, time):
    savemat(folder / "log.mat", log)
    mapping = LogMapping(
        file=folder / "log.mat",
        sampling_period_s=BENCH_STEP_S,
        drop_periods=1,
        time=TimeChannel("time", time),
        inputs=(InputChannel("drive", "current", **torque),),
        outputs=(OutputChannel("drive", "motor", **angle),),
    )
    return import_log(
        mapping,
        samples_per_period=round(BENCH_S / BENCH_STEP_S),
        periods=4,
        excited_lines=BENCH_LINES,
        configurations=np.zeros((1, 1)),
    )


def test_columns_in_other_units_are_the_same_record_and_fit(tmp_path):
    log = bench_log()  # the motor's angle in radians, time in ms
    plain = {"torque": {"unit": "N m"}, "angle": {"unit": "rad"}, "time": "ms"}
    first = bench_record(tmp_path, log, **plain)
    others = {
        "N cm": (log | {"current": 100 * log["current"]}, plain | {"torque": {"unit": "N m", "scale": 0.01}}),
        "mN m": (log | {"current": 1000 * log["current"]}, plain | {"torque": {"unit": "mN m"}}),
        "deg": (log | {"motor": np.rad2deg(log["motor"])}, plain | {"angle": {"unit": "deg"}}),
        "turn": (log | {"motor": log["motor"] / (2 * np.pi)}, plain | {"angle": {"unit": "turn"}}),
        "s": (log | {"time": log["time"] / 1000}, plain | {"time": "s"}),
        "the other way": (log | {"motor": -log["motor"]}, plain | {"angle": {"unit": "rad", "sign": -1}}),
    }
    robot = robid.RobotModel(two_mass_robot(MOTOR, LOAD, 0.8 * STIFFNESS, 2 * DAMPING), BENCH_STEP_S)

    def fitted(record):
        return robid.fit_model("elastic", robot, robid.estimate_frf(record), free=("stiffness", "damping"))

    fit = fitted(first)
    assert fit.parameters["coupling.stiffness"].value == pytest.approx(STIFFNESS, rel=0.01)
    for name, (columns, mapping) in others.items():
        record = bench_record(tmp_path, columns, **mapping)
        np.testing.assert_allclose(record.inputs, first.inputs, rtol=IDENTITY, err_msg=name)
        np.testing.assert_allclose(record.outputs, first.outputs, atol=IDENTITY * np.abs(first.outputs).max())
        assert_same_fit(fit, fitted(record))
    wrong = bench_record(tmp_path, others["N cm"][0], **plain)
    assert differ(wrong.inputs, first.inputs)


# The order of what an elastic fit reads
def test_springs_and_outputs_in_another_order_are_the_same_parameters():
    robot, places = PLACES["two joints"]
    measured = measured_of(robot, places)
    shuffled = replace(robot, springs=robot.springs[::-1])
    fit, other = elastic_fit(robot, measured), elastic_fit(shuffled, measured)
    assert list(fit.parameters) != list(other.parameters)
    assert_same_fit(fit, other)
    rows = [1, 0]
    turned = replace(
        measured,
        response=measured.response[:, :, rows],
        total_covariance=measured.total_covariance[:, :, rows][..., rows],
        element_scale=measured.element_scale[:, rows],
        output_channels=tuple(measured.output_channels[row] for row in rows),
    )
    assert_same_fit(fit, elastic_fit(robot, turned))
    wrong = elastic_fit(robot, replace(turned, output_channels=measured.output_channels))
    assert differ(fit.found.estimate.value, wrong.found.estimate.value)


def test_the_order_of_configurations_and_their_copies_do_not_move_an_elastic_fit():
    robot, places = PLACES["two joints"]
    measured = measured_of(robot, places)
    assert_same_fit(elastic_fit(robot, measured), elastic_fit(robot, measured.select([1, 0])))


# External
def external_fit(u, y, names, period_s=0.012, **options):
    quantity = {"input_quantity": "position", "output_quantity": "position", "linear": True}
    record = robid.make_record(u, y, period_s, names=names, **quantity)
    return robid.fit_model("external", record, poles=2, zeros=1, delay_samples=0, **options)


def transfers(fit):
    """Response of each channel by its name, and its relative deviation."""
    found, names = fit.found.solution.responses, fit.found.solution.transfers.names
    rows = zip(names, found.response.T, found.relative_std.T, strict=True)
    return {name: (response, deviation) for name, response, deviation in rows}


@pytest.mark.parametrize("change", ["order", "mm", "sign", "unit of the command"])
def test_transfer_functions_follow_their_channels(change):
    u, y = _axes(1e-4)
    plain, names, factor = transfers(external_fit(u, y, ["x", "z"])), ["x", "z"], {"x": 1.0, "z": 1.0}
    if change == "order":
        # The experiments, one for each axis, may come in any order too.
        u, y, names = u[:, :, ::-1, ..., ::-1], y[:, :, ::-1, ..., ::-1], ["z", "x"]
    elif change == "mm":
        u, y = 1e3 * u, 1e3 * y
    elif change == "sign":
        y, factor = y * [1, -1], {"x": 1.0, "z": -1.0}
    else:
        u, factor = u * [1e3, 1.0], {"x": 1e-3, "z": 1.0}
    other = transfers(external_fit(u, y, names))
    assert set(other) == set(plain)
    for name, (response, deviation) in plain.items():
        (own,) = [value for key, value in factor.items() if key == name]
        np.testing.assert_allclose(other[name][0], own * response, rtol=1e-4)
        np.testing.assert_allclose(other[name][1], deviation, rtol=1e-2, atol=1e-12)
    assert differ(plain["x"][0], plain["z"][0])


def test_poles_are_in_the_unit_of_time():
    u, y = _axes(1e-4)
    slow, fast = (external_fit(u, y, ["x", "z"], period) for period in (0.012, 0.012e-3))
    own, other = (fit.found.solution.transfers.denominator for fit in (slow, fast))
    powers = 1e3 ** np.arange(own.shape[1])
    np.testing.assert_allclose(other, own * powers, rtol=1e-3)


# Over positions
def lpv_fit(frf, **options):
    options = {"choose_on": [1, 4], "scheduling": [0], "basis": {"degree": 2}, "path": {"count": 3}, **options}
    return robid.fit_model("lpv", frf, **options).found.solution


@pytest.mark.parametrize("change", ["order", "units", "sign", "positions"])
def test_a_model_over_positions_follows_its_channels(change):
    frf = _local(-40.0, np.linspace(-1, 1, 9)[:, None], step=4)
    rows, factor, other = slice(None), np.ones(2), frf
    points = np.array([[-0.3], [0.45]])
    if change == "order":
        rows = [1, 0]
        other = replace(frf, output_channels=frf.output_channels[::-1])
    elif change == "units":
        factor = np.array([1e3, np.rad2deg(1.0)])
    elif change == "sign":
        factor = np.array([-1.0, 1.0])
    else:
        other = replace(frf, configurations=frf.configurations * np.rad2deg(1.0))
    other = replace(
        other,
        response=(frf.response * factor[:, None])[:, :, rows],
        total_covariance=(frf.total_covariance * np.outer(factor, factor))[:, :, rows][..., rows],
    )
    plain = lpv_fit(frf).response(points, frf.frequency_hz).response
    places = points * (np.rad2deg(1.0) if change == "positions" else 1.0)
    moved = lpv_fit(other).response(places, frf.frequency_hz).response
    wanted = (plain * factor[:, None])[:, :, rows]
    np.testing.assert_allclose(moved, wanted, atol=1e-3 * np.abs(wanted).max())
    assert change == "positions" or differ(plain, moved)


# Designs
def test_a_design_does_not_depend_on_world_signs_or_the_order_of_candidates():
    robot = two_joint_robot()
    candidates = np.random.default_rng(1).uniform(-1.5, 1.5, (30, 2))

    def chosen(robot, places):
        found = robid.choose_configurations(robid.RobotModel(robot, 1e-3, 1e-3), places, BAND, 4)
        return found, {tuple(np.round(row, 9)) for row in places[found.chosen].tolist()}

    plain, places = chosen(robot, candidates)
    turned, same = chosen(in_turned_world(robot, TURN), candidates)
    assert same == places
    assert turned.efficiency == pytest.approx(plain.efficiency, rel=1e-6)
    signs = signs_of(robot, 1)
    reversed_, mirrored = chosen(with_axis_reversed(robot, 1), candidates * signs)
    assert {tuple(np.array(row) * signs) for row in mirrored} == places
    assert reversed_.efficiency == pytest.approx(plain.efficiency, rel=1e-6)
    order = np.random.default_rng(2).permutation(len(candidates))
    assert chosen(robot, candidates[order])[1] == places
    assert chosen(robot, candidates * signs)[1] != {tuple(np.array(row) * signs) for row in places}
