"""Every kind of excitation: its block, its lines, its slow motion, and the response that it gives."""

from dataclasses import fields, replace

import numpy as np
import pytest

from exact_systems import two_joint_robot, two_mass_robot
from robid.design.excitation.excitation import design_signal
from robid.design.excitation.lines import LINE_SHARE, check_signal, choose_lines, signal_lines
from robid.design.excitation.loop import nominal_loop
from robid.design.excitation.options import ChirpOptions, FourierOptions, MultisineOptions, SteppedSineOptions
from robid.design.excitation.prediction import predict
from robid.errors import SettingsError
from robid.frf.estimate import estimate_frf
from robid.frf.options import EstimateOptions
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from robid.simulate.experiment import SimulatedExperiment, simulate
from robid.simulate.options import Controller, Imperfections, SimulateOptions
from tolerances import IDENTITY

STEP_S = 1e-3
PLAIN = EstimateOptions(compensation="none")
BAND = {"period_s": 2.0, "low_hz": 4.0, "high_hz": 60.0, "rms": 3.0}
KINDS = {
    "multisine": MultisineOptions(**BAND, count=12, phase_iterations=0),
    "chirp": ChirpOptions(**BAND),
    "stepped_sine": SteppedSineOptions(**{**BAND, "low_hz": 12.0}, count=12),
    "fourier": FourierOptions(**BAND, count=12, at_rest=True),
}
BASE = KINDS["multisine"]


def options_of(kind, **changes):
    return replace(KINDS[kind], **changes)


def simulated(robot, options, configuration, *, realizations=1, **flaws):
    excitation = design_signal(options, len(robot.joints), realizations, STEP_S)
    experiment = SimulatedExperiment(
        robot=robot,
        controller=Controller(),
        options=SimulateOptions(transient_periods=3, imperfections=Imperfections(**flaws)),
        reference=excitation.reference,
        inject=excitation.kind,
        excited_lines=excitation.excited_lines,
        detection_lines=excitation.detection_lines,
        periods=1,
    )
    return simulate(experiment, np.asarray(configuration, float), 0)


def exact(robot, configuration, frequency_hz):
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, np.asarray(configuration, float)[None]))
    return response(linear, nominal_parameters(robot, linear, STEP_S), frequency_hz, STEP_S).sampled[0]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("grid", ["odd", "full"])
def test_a_block_is_orthogonal_at_every_excited_line(kind, grid):
    excitation = design_signal(options_of(kind, grid=grid, rms=(3.0, 5.0, 0.5)), 3, 2, STEP_S)
    np.testing.assert_allclose(
        np.sqrt(np.mean(excitation.reference**2, axis=2)), np.broadcast_to([3.0, 5.0, 0.5], (2, 3, 3)), rtol=1e-9
    )
    spectrum = np.fft.rfft(excitation.reference, axis=2)[:, :, excitation.excited_lines] * 2 / 2000
    np.testing.assert_allclose(spectrum, excitation.spectrum, atol=1e-9)
    gram = np.einsum("reki,rekj->rkij", spectrum.conj(), spectrum)
    size = np.einsum("rkii->rki", gram).real
    normal = gram / np.sqrt(size[..., :, None] * size[..., None, :])
    np.testing.assert_allclose(normal, np.broadcast_to(np.eye(3), normal.shape), atol=1e-9)
    assert np.abs(spectrum[0] - spectrum[1]).max() > 0.1
    if grid == "odd":
        even = np.fft.rfft(excitation.reference, axis=2)[:, :, ::2]
        assert np.abs(even).max() < 1e-9 * np.abs(spectrum).max() * 2000


@pytest.mark.parametrize("kind", ["chirp", "stepped_sine"])
def test_excited_lines_are_those_of_the_band_that_carry_energy(kind):
    options = options_of(kind, grid="full")
    excitation = design_signal(options, 1, 1, STEP_S)
    size = np.abs(np.fft.rfft(excitation.reference[0, 0, :, 0]))
    frequency = np.arange(len(size)) / 2.0
    band = (frequency >= options.low_hz) & (frequency <= options.high_hz)
    wanted = np.flatnonzero(band & (size >= LINE_SHARE * size[band].max()))
    np.testing.assert_array_equal(excitation.excited_lines, wanted)
    assert np.sum(size[wanted] ** 2) > 0.8 * np.sum(size**2)
    np.testing.assert_array_equal(signal_lines(options, STEP_S)[0], wanted)


@pytest.mark.parametrize(("inject", "derivatives"), [("speed_reference", 2), ("position_reference", 3), ("torque", 2)])
def test_a_fourier_series_begins_at_rest_where_asked(inject, derivatives):
    excitation = design_signal(options_of("fourier", inject=inject), 2, 2, STEP_S)
    lines = excitation.excited_lines
    for order in range(derivatives):
        terms = (2j * np.pi * lines[:, None] / 2.0) ** order * excitation.spectrum
        assert np.abs(terms.sum(axis=2).real).max() < 1e-9 * np.abs(terms).max()
    if inject == "speed_reference":
        angle = excitation.spectrum / (2j * np.pi * lines[:, None] / 2.0)
        assert np.abs(angle.sum(axis=2).real).max() < 1e-9 * np.abs(angle).max()
    free = design_signal(options_of("fourier", inject=inject, at_rest=False), 2, 2, STEP_S)
    assert np.abs(free.reference[:, :, 0]).max() > 0.1


@pytest.mark.parametrize("slow", [0.0, 4.0])
@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_gives_the_response_of_a_linear_drive(kind, slow):
    robot = two_mass_robot(motor_inertia=2e-3, load_inertia=2e-3, stiffness=40.0, damping=0.05, viscous=0.02)
    record = simulated(robot, options_of(kind, slow_motion_rad_s=slow), [0.0])
    found = estimate_frf(record, PLAIN).response[0]
    wanted = exact(robot, [0.0], record.frequency_hz)
    assert np.median(np.abs(found / wanted - 1)) < 1e-4
    assert np.abs(found / wanted - 1).max() < 5e-3


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_gives_the_response_of_a_small_motion_of_two_joints(kind):
    record = simulated(two_joint_robot(), options_of(kind, rms=0.05), [0.3, -0.8])
    found = estimate_frf(record, PLAIN).response[0]
    wanted = exact(two_joint_robot(), [0.3, -0.8], record.frequency_hz)
    error = np.abs(found - wanted) / np.abs(wanted).max(axis=(1, 2), keepdims=True)
    assert np.median(error) < 1e-3


def test_a_slow_motion_is_added_and_planned():
    options = replace(BASE, slow_motion_rad_s=20.0)
    excitation, plain = design_signal(options, 1, 2, STEP_S), design_signal(BASE, 1, 2, STEP_S)
    np.testing.assert_array_equal(excitation.excited_lines, plain.excited_lines)
    spectrum = np.fft.rfft(excitation.reference - plain.reference, axis=2) * 2 / 2000
    np.testing.assert_allclose(np.abs(spectrum[:, :, 2]), 20.0, rtol=IDENTITY)
    assert np.abs(np.delete(spectrum, 2, axis=2)).max() < 1e-9
    robot = two_mass_robot(viscous=0.02)
    robot = replace(robot, joints=(replace(robot.joints[0], motor=replace(robot.joints[0].motor, gear_ratio=1e3)),))

    def plan_of(planned):
        loop = nominal_loop(robot, Controller(), np.zeros((1, 1)), planned.frequency_hz)
        return predict(planned, loop, options).plan

    slow = plan_of(excitation).speed_peak - plan_of(plain).speed_peak
    assert 15 < slow.min() <= slow.max() < 25
    angle = 20.0 / (2 * np.pi * 1.0) / 1e3
    assert plan_of(excitation).excursion_peak.max() > 0.8 * angle


@pytest.mark.parametrize("kind", KINDS)
def test_limits_are_used_by_all_that_is_played(kind):
    options = options_of(kind, slow_motion_rad_s=20.0, limit_share=0.7, rms=(3.0, 4.0))
    excitation = design_signal(options, 2, 1, STEP_S)
    loop = nominal_loop(two_joint_robot(), Controller(), np.array([[0.3, -0.8]]), excitation.frequency_hz)
    planned = predict(excitation, loop, options)
    plan = planned.plan
    shares = (plan.speed_peak / plan.speed_limit, plan.torque_peak / plan.torque_limit)
    assert max(*(share.max() for share in shares), (plan.excursion_peak / plan.excursion_limit).max()) == pytest.approx(
        0.7, rel=1e-6
    )
    factor = planned.rms / excitation.rms
    np.testing.assert_allclose(planned.reference, factor[0] * excitation.reference, rtol=IDENTITY)
    assert plan.snr_db.shape == (1, len(excitation.excited_lines), 2, 2)


def test_a_slow_motion_of_angles_has_the_same_speed():
    options = replace(BASE, inject="position_reference", rms=0.1, slow_motion_rad_s=20.0, slow_motion_line=4)
    plain = replace(options, slow_motion_rad_s=0.0)
    added = design_signal(options, 1, 1, STEP_S).reference - design_signal(plain, 1, 1, STEP_S).reference
    assert np.abs(np.gradient(added[0, 0, :, 0], STEP_S)).max() == pytest.approx(20.0, rel=1e-4)


@pytest.mark.parametrize("line", [2, 4, 6])
@pytest.mark.parametrize("kind", ["multisine", "chirp", "fourier"])
def test_multiples_of_the_slow_line_are_not_excited(kind, line):
    options = options_of(kind, grid="full", slow_motion_rad_s=5.0, slow_motion_line=line)
    if kind != "chirp":
        options = replace(options, count=40, detection_share=0.2)
    excitation = design_signal(options, 1, 1, STEP_S)
    used = np.concatenate([excitation.excited_lines, excitation.detection_lines])
    assert np.all(used % line)
    if kind == "multisine":
        assert len(excitation.excited_lines) == 40
        without = np.concatenate(choose_lines(replace(options, slow_motion_rad_s=0.0), STEP_S))
        assert not np.all(without % line)


@pytest.mark.parametrize("grid", ["odd", "full"])
def test_ripple_and_friction_of_the_slow_motion_stay_off_the_excited_lines(grid):
    """The slow motion alone, on a drive with ripple and LuGre friction: what it stirs up has lines of its own."""
    robot = two_mass_robot(motor_inertia=2e-3, load_inertia=2e-3, stiffness=40.0, damping=0.05, viscous=0.02)
    motor = robot.joints[0].motor
    friction = replace(motor.friction, coulomb_nm=0.3, static_nm=0.36, stribeck_rad_s=1.0, presliding_rad=0.05)
    motor = replace(motor, friction=friction, ripple_nm=0.2, ripple_order=6)
    robot = replace(robot, joints=(replace(robot.joints[0], motor=motor),))
    options = replace(BASE, grid=grid, slow_motion_rad_s=20.0, count=20)
    excitation = design_signal(options, 1, 1, STEP_S)
    plain = design_signal(replace(options, rms=1e-9), 1, 1, STEP_S)
    experiment = SimulatedExperiment(
        robot=robot,
        controller=Controller(),
        options=SimulateOptions(transient_periods=4, imperfections=Imperfections(friction="lugre", ripple=True)),
        reference=plain.reference,
        inject="speed_reference",
        excited_lines=excitation.excited_lines,
        detection_lines=excitation.detection_lines,
        periods=1,
    )
    torque = simulate(experiment, np.zeros(1), 0).inputs[0, 0, 0, 0, :, 0]
    size = np.abs(np.fft.rfft(torque)) * 2 / len(torque)
    stirred = size[8:121:2]
    assert np.sort(stirred)[-5] > 1e-2
    quiet = size[np.concatenate([excitation.excited_lines, excitation.detection_lines])]
    assert quiet.max() < 1e-4 * stirred.max()


@pytest.mark.parametrize(
    ("kind", "changes", "words"),
    [
        ("multisine", {"slow_motion_rad_s": 5.0, "slow_motion_line": 3}, "line 3 is odd"),
        ("multisine", {"slow_motion_rad_s": 5.0, "slow_motion_line": 8}, "4 Hz is not below low_hz 4"),
        ("multisine", {"slow_motion_rad_s": 5.0, "inject": "torque"}, "needs a reference of speed or position"),
        ("chirp", {"low_hz": 70.0}, "not below high_hz"),
        ("chirp", {"high_hz": 600.0}, "Nyquist frequency 500 Hz"),
        ("chirp", {"period_s": 2.001}, "2001 samples has no half"),
        ("stepped_sine", {"low_hz": 4.0, "count": 60}, "lengthen period_s"),
        ("fourier", {"at_rest": True, "count": 3}, "use at least 4 lines"),
        ("fourier", {"at_rest": False, "count": 300}, "do not fit"),
    ],
)
def test_what_cannot_be_made_is_said(kind, changes, words):
    with pytest.raises(SettingsError, match=words) as caught:
        check_signal(options_of(kind, **changes), STEP_S)
    assert caught.value.where == "excitation"
    assert caught.value.remedy


CHANGED = {"period_s": 6.0, "low_hz": 13.0, "high_hz": 50.0, "grid": "full", "slow_motion_rad_s": 1.0}
CHANGED |= {"count": 4, "spacing": "linear", "detection_share": 0.3, "seed": 2, "chirp_peak": 0.9, "rms": 1.0}


@pytest.mark.parametrize("kind", KINDS)
def test_only_the_fields_that_decide_lines_move_them(kind):
    options = options_of(kind, **({"period_s": 4.0, "count": 5} if kind == "stepped_sine" else {}))
    for name in {field.name for field in fields(options)} & set(CHANGED):
        base = replace(options, grid="full") if name == "slow_motion_rad_s" else options
        before = np.concatenate(signal_lines(base, STEP_S))
        after = np.concatenate(signal_lines(replace(base, **{name: CHANGED[name]}), STEP_S))
        assert np.array_equal(before, after) == (name not in options.decides_lines), name
