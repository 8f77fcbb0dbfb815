"""Mistakes that a rigid fit names: units, gears, poor motions, motions seen before; and none where all is well."""

from dataclasses import replace

import numpy as np
import pytest

from rigid_logs import PERIOD_S, fourier_motion, shot_along, with_masses
from rigid_robots import random_chain, with_gears
from robid.errors import DataError
from robid.models.rigid.fit.consistency import against_nominal
from robid.models.rigid.fit.fitting import fit_rigid
from robid.models.rigid.fit.options import PreprocessingOptions, RigidFitOptions
from robid.models.rigid.fit.shots import repeats, travel_of
from robid.models.rigid.judge.plausible import assess_rigid
from robid.models.rigid.judge.scales import motions_of, rigid_scale_findings, sum_findings
from robid.models.rigid.judge.validating import validate_rigid
from robid.results.scale import Scale
from robid.robot.regressor.model import build_rigid_model
from robid.signals.quantities import motor_channels
from robid.signals.record import Record

OPTIONS = RigidFitOptions(filters=PreprocessingOptions(position_cut_hz=10.0), physical=False)
N_SAMPLE = 5000
_OF_SIZE = ("masses", "gear_ratio", "zero", "torque_sign")


@pytest.fixture(scope="module")
def robot():
    return replace(random_chain(4, 3, slides=0.0), gravity_m_s2=np.array([0.0, 0.0, -9.81]))


@pytest.fixture(scope="module")
def shot(robot):
    return shot_along(robot, fourier_motion(robot, N_SAMPLE))


def _with_gear(robot, joint, factor):
    joints = list(robot.joints)
    motor = joints[joint].motor
    joints[joint] = replace(joints[joint], motor=replace(motor, gear_ratio=factor * motor.gear_ratio))
    return replace(robot, joints=tuple(joints))


def _finding(robot, shots, options=OPTIONS):
    return assess_rigid(robot, fit_rigid(robot, shots, options), options).findings


def _record(robot, shot):
    """The record that a shot was cut from."""
    names = [joint.name for joint in robot.joints]
    return Record(
        inputs=shot.torque[None, None, None, None],
        outputs=shot.position[None, None, None, None],
        output_offset=np.zeros((1, len(names))),
        configurations=None,
        sampling_period_s=shot.sampling_period_s,
        excited_lines=np.zeros(0, int),
        input_channels=motor_channels(names, "torque"),
        output_channels=motor_channels(names, "angle"),
    )


def _units(robot, shot):
    return rigid_scale_findings(robot, [shot], motions_of(_record(robot, shot), robot), OPTIONS)


def _sizes(robot, shots):
    return [finding for finding in _finding(robot, shots) if finding.cause in _OF_SIZE]


@pytest.mark.parametrize("factors", [(1, 1, 1), (1.3, 0.7, 1.3), (0.7, 0.7, 0.7), (1.3, 1.3, 0.7)])
def test_a_sound_log_raises_no_doubt_although_masses_of_the_robot_file_are_off(robot, shot, factors):
    assert _finding(with_masses(robot, factors), [shot]) == ()


@pytest.mark.parametrize("factors", [(1, 1, 1), (2, 0.5, 2), (0.4, 0.4, 0.4), (2.5, 2.5, 0.5)])
def test_a_sound_log_accuses_no_units_although_the_robot_file_is_rough(robot, shot, factors):
    assert _units(with_masses(robot, factors), shot) == ()


@pytest.mark.parametrize(
    ("change", "scale"),
    [
        ({"position": 180 / np.pi}, Scale("motor_angle", "180/pi")),
        ({"position": np.pi / 180}, Scale("motor_angle", "180/pi", inverse=True)),
        ({"position": np.array([1, 180 / np.pi, 1])}, Scale("motor_angle", "180/pi", joints=("joint_1",))),
        ({"torque": 1e3}, Scale("torque", "1000")),
        ({"torque": 1e-3}, Scale("torque", "1000", inverse=True)),
        ({"sampling_period_s": 1e3}, Scale("time", "1000")),
        ({"sampling_period_s": 1e-3}, Scale("time", "1000", inverse=True)),
    ],
)
def test_units_that_are_off_are_named_and_nothing_is_to_be_used(robot, shot, change, scale):
    (key, factor), *_ = change.items()
    finding, *more = _units(robot, replace(shot, **{key: factor * getattr(shot, key)}))
    assert (finding.cause, finding.decisive, finding.scales[0], more) == ("units", True, scale, [])


@pytest.mark.parametrize("factors", [(1, 1, 1), (2, 0.5, 2), (0.5, 0.5, 0.5)])
@pytest.mark.parametrize("named", ["motor", "arm"])
def test_torques_and_angles_of_the_other_side_of_all_gears_are_named_together(robot, factors, named):
    geared = robot
    for joint, ratio in enumerate((100, 80, 50)):
        geared = _with_gear(geared, joint, ratio)
    rough, shot = with_masses(geared, factors), shot_along(geared, fourier_motion(geared, N_SAMPLE))

    def told(shot):
        channels = tuple(
            replace(one, name=f"{one.name}.arm", side="arm") for one in _record(rough, shot).output_channels
        )
        record = _record(rough, shot)
        record = replace(record, output_channels=channels) if named == "arm" else record
        return rigid_scale_findings(rough, [shot], motions_of(record, rough), OPTIONS)

    # A joint's torque is the ratio times its motor's; named after the arm, what was the motor's is brought there again.
    ratio = geared.gear_ratio ** (1 if named == "motor" else -1)
    assert told(shot) == ()
    (finding,) = told(replace(shot, torque=shot.torque * ratio, position=shot.position / ratio))
    small = named == "arm"
    assert finding.scales[:2] == (
        Scale("torque", "gear_ratio", small),
        Scale(f"{named}_angle", "gear_ratio", not small),
    )


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_degrees_of_a_motor_that_turns_other_joints_too_are_its_own(robot, joint):
    coupled = with_gears(robot)
    coupled = replace(coupled, joints=tuple(replace(each, lower=-3.0, upper=3.0) for each in coupled.joints))
    motion = np.where(np.arange(3) == joint, 180 / np.pi, 1.0)
    shot = shot_along(coupled, fourier_motion(coupled, N_SAMPLE))
    assert _units(coupled, shot) == ()
    finding, *_ = _units(coupled, replace(shot, position=shot.position * motion))
    assert finding.scales[0] == Scale("motor_angle", "180/pi", joints=(f"joint_{joint}",))


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_an_angle_with_the_wrong_sign_accuses_no_units(robot, shot, joint):
    assert _units(robot, replace(shot, position=shot.position * np.where(np.arange(3) == joint, -1.0, 1.0))) == ()


@pytest.mark.parametrize(
    ("joint", "factor", "decisive"),
    [(0, 10, True), (1, 10, True), (0, 0.1, True), (2, 0.1, True), (0, -1, False), (0, 2, False), (1, 0.5, False)],
)
def test_a_gear_ratio_that_is_off_is_named(robot, shot, joint, factor, decisive):
    found = _sizes(_with_gear(robot, joint, factor), [shot])
    assert found
    assert found[0].decisive == decisive


def test_currents_say_nothing_of_sizes(robot, shot):
    current = replace(shot, torque=1e3 * shot.torque, torque_unit="A")
    assert _sizes(robot, [current]) == []
    assert _units(robot, current) == ()


def test_a_motion_that_excites_too_little_names_what_suffers(robot):
    poor = shot_along(robot, fourier_motion(robot, N_SAMPLE, share=0.01))
    solution = fit_rigid(robot, [poor], OPTIONS)
    finding = next(one for one in assess_rigid(robot, solution, OPTIONS).findings if one.cause == "excitation")
    known = dict(zip(solution.estimate.names, solution.estimate.identified.tolist(), strict=True))
    assert finding.decisive
    assert not known["joint_0.ZZ"]
    assert "joint_0.ZZ" in finding.message
    assert any("joint_0.ZZ" in told for told in solution.estimate.undetermined)
    # Torques on another motion show that it is right.
    motion = fourier_motion(robot, N_SAMPLE, seed=8)
    held = validate_rigid(robot, solution, [shot_along(robot, motion)], OPTIONS)
    assert held.relative_error.max() > 0.15
    assert held.outcome.grade.value == 0


def test_motors_that_stand_still_and_torques_that_never_change_are_refused(robot, shot):
    still = replace(shot, position=shot.position * [1, 0, 1])
    with pytest.raises(DataError, match="joint_1 never moves"):
        fit_rigid(robot, [still], OPTIONS)
    fit_rigid(robot, [still, shot], OPTIONS)  # the remedy: it moves in another shot
    with pytest.raises(DataError, match="D188 the torques of joint_2 never change although"):
        fit_rigid(robot, [replace(shot, torque=shot.torque * [1, 1, 0])], OPTIONS)


@pytest.mark.parametrize("n_sample", [60, 404, 700, 1200])
def test_a_record_shorter_than_its_filters_needs_a_higher_cut_off(robot, n_sample):
    short = shot_along(robot, fourier_motion(robot, n_sample))
    with pytest.raises(DataError, match="too few for 28 parameters") as caught:
        fit_rigid(robot, [short], OPTIONS)
    assert "a higher `filters.position_cut_hz`" in caught.value.remedy
    if n_sample > 1000:
        higher = replace(OPTIONS, filters=PreprocessingOptions(position_cut_hz=40.0))
        assert fit_rigid(robot, [short], higher).estimate.status == "converged"


def test_a_cut_off_is_chosen_among_those_that_leave_rows(robot):
    free = replace(OPTIONS, filters=PreprocessingOptions())
    with pytest.raises(DataError, match="D183"):
        fit_rigid(robot, [shot_along(robot, fourier_motion(robot, 60))], free)
    found = fit_rigid(robot, [shot_along(robot, fourier_motion(robot, 1500))], free)
    assert found.filtered.cut_hz > 2


def test_real_bodies_are_found_for_a_record_with_fewer_independent_moments_than_parameters(robot):
    short = shot_along(robot, fourier_motion(robot, 2500), noise=0.3)
    solution = fit_rigid(robot, [short], replace(OPTIONS, physical=True))
    assert solution.estimate.degrees_of_freedom[0] < len(solution.estimate.names)
    assert solution.standard is not None
    assert solution.standard.status == "moved"
    assert np.all(np.isfinite(solution.standard.moved))


def test_torques_of_links_are_compared_as_the_regressor_has_them(robot, shot):
    from robid.models.rigid.fit.regression import reduce_rows
    from robid.models.rigid.fit.rows import Rows
    from robid.robot.regressor.base import find_base_parameters

    robot = with_masses(robot, (2.0, 2.0, 2.0))  # of links and rotors, the links are as in the shot times two
    model = build_rigid_model(robot)
    base = find_base_parameters(model)
    reduced = model.only(base.columns.tolist())
    position = shot.position[::20]
    generator = np.random.default_rng(0)
    velocity, acceleration = generator.standard_normal((2, *position.shape)) * 50
    columns = reduced.columns(position, velocity, acceleration)
    solution = fit_rigid(robot, [shot], OPTIONS)
    rotors = base.combination @ np.where(np.array(model.kinds) == "motor_inertia", model.nominal, 0.0)
    estimate = replace(solution.estimate, value=base.values(model.nominal) * 3 - 2 * rotors)
    torque = columns @ estimate.value
    found = against_nominal(model, base, estimate, reduce_rows((Rows(columns, torque, np.ones(torque.shape, bool)),)))
    np.testing.assert_allclose(found.ratio, 3, rtol=1e-8)
    np.testing.assert_allclose(found.likeness, 1, rtol=1e-8)
    assert np.all((found.share > 0) & (found.share < 1.5))


def test_a_motion_is_known_again_however_late_and_no_other_is(robot, shot):
    travel = travel_of(robot, [shot_along(robot, fourier_motion(robot, N_SAMPLE, seed=3)), shot])
    assert repeats(travel, robot, shot)
    assert repeats(travel, robot, replace(shot, position=shot.position[700:]))
    assert repeats(travel, robot, replace(shot, position=shot.position[:1500]))
    waited = np.concatenate([np.repeat(shot.position[:1], 900, axis=0), shot.position[:-900]])
    assert repeats(travel, robot, replace(shot, position=waited))
    assert not repeats(travel, robot, shot_along(robot, fourier_motion(robot, N_SAMPLE, seed=5)))
    assert not repeats(travel, robot, replace(shot, position=np.repeat(shot.position[:1], N_SAMPLE, axis=0)))


def test_a_validation_that_repeats_the_fits_motion_cannot_generalise(robot, shot):
    solution = fit_rigid(robot, [shot], OPTIONS)
    again = shot_along(robot, fourier_motion(robot, N_SAMPLE), seed=1)
    same = validate_rigid(robot, solution, [again], OPTIONS)
    assert same.same_motion
    assert "the motion of its fit" in same.outcome.verdict
    assert any("says nothing of other motions" in finding.message for finding in same.outcome.grade.findings)
    other = validate_rigid(robot, solution, [shot_along(robot, fourier_motion(robot, N_SAMPLE, seed=8))], OPTIONS)
    assert not other.same_motion
    assert other.outcome.ok
    assert other.outcome.grade.findings == ()
    with pytest.raises(DataError, match="leave no rows"):
        validate_rigid(
            robot, solution, [replace(shot, position=shot.position[:500], torque=shot.torque[:500])], OPTIONS
        )
    assert solution.travel.time_s[-1] + PERIOD_S == PERIOD_S * N_SAMPLE


@pytest.mark.parametrize("joint", [0, 2])
def test_a_torque_with_the_wrong_sign_is_to_blame_first(robot, shot, joint):
    sign = np.where(np.arange(3) == joint, -1.0, 1.0)
    first = _finding(robot, [replace(shot, torque=sign * shot.torque)])[0]
    assert (first.cause, first.decisive) == ("torque_sign", True)


def test_simulated_positions_are_held_against_the_measured_ones(robot, shot):
    solution = fit_rigid(robot, [shot], OPTIONS)
    off = np.array([0.0, 0.01, 0.2])
    swing = shot.position - shot.position.mean(axis=0)
    found = validate_rigid(
        robot, solution, [shot], OPTIONS, simulate=lambda _model, _values: [shot.position + off * swing]
    )
    np.testing.assert_allclose(found.forward_error, off, rtol=1e-9, atol=1e-12)
    assert validate_rigid(robot, solution, [shot], OPTIONS).forward_error is None


def test_a_validation_without_rows_of_a_motor_tells_nothing_of_it(robot, shot):
    solution = fit_rigid(robot, [shot], OPTIONS)
    other = shot_along(robot, fourier_motion(robot, N_SAMPLE, seed=8))
    slow = np.where(np.arange(3) == 1, 0.0, 1.0) * (other.position - other.position[0]) + other.position[0]
    dropping = replace(OPTIONS, filters=replace(OPTIONS.filters, drop_below_rad_s=1e-3))
    found = validate_rigid(robot, solution, [replace(other, position=slow)], dropping)
    assert np.isnan(found.relative_error[1])
    assert found.outcome.grade.value < 2
    assert any("too few to tell" in finding.message for finding in found.outcome.grade.findings)
    with pytest.raises(DataError, match="D191") as caught:
        validate_rigid(robot, solution, [replace(other, position=0 * other.position)], dropping)
    assert "drop_below_rad_s" in caught.value.remedy


def test_records_of_other_rates_or_units_are_refused(robot, shot):
    solution = fit_rigid(robot, [shot], OPTIONS)
    for change, told in (({"sampling_period_s": 2 * PERIOD_S}, "sampled"), ({"torque_unit": "A"}, "in A")):
        other = replace(shot, **change)
        with pytest.raises(DataError, match=told):
            validate_rigid(robot, solution, [other], OPTIONS)
        with pytest.raises(DataError, match=told):
            fit_rigid(robot, [shot, other], OPTIONS)


def test_rows_that_are_all_dropped_are_refused_with_what_drops_them(robot, shot):
    dropping = replace(OPTIONS, filters=replace(OPTIONS.filters, drop_below_rad_s=1e6))
    with pytest.raises(DataError, match="D185") as caught:
        fit_rigid(robot, [shot], dropping)
    assert "drop_below_rad_s" in caught.value.remedy


def test_instruments_that_cannot_be_had_are_no_other_estimator(robot, shot):
    with pytest.raises(DataError, match="D182"):
        fit_rigid(robot, [shot], replace(OPTIONS, estimator="instruments"))


@pytest.mark.parametrize(("joint", "other", "sign"), [(2, 1, 1), (1, 2, -1)])
def test_an_angle_that_counts_another_joints_too_is_named(robot, shot, joint, other, sign):
    ratio = robot.gear_ratio
    position = shot.position.copy()
    position[:, joint] += sign * ratio[joint] / ratio[other] * position[:, other]
    finding, *more = sum_findings(robot, [replace(shot, position=position)], OPTIONS)
    assert (finding.cause, finding.decisive, more) == ("gear_coupling", True, [])
    assert f"<joint_{joint}> " in finding.message
    assert f"{abs(ratio[joint] / ratio[other]):.6g}*<joint_{other}>" in finding.message


def test_a_coupling_that_only_the_logged_angle_has_is_named(robot, shot):
    turns = 0.01
    joints = list(robot.joints)
    joints[2] = replace(joints[2], couplings={"joint_1": turns})
    position = shot.position.copy()
    position[:, 2] -= turns * robot.gear_ratio[2] * position[:, 1]
    coupled = replace(robot, joints=tuple(joints))
    finding, *_ = sum_findings(coupled, [replace(shot, position=position)], OPTIONS)
    assert finding.cause == "gear_coupling"
    assert "leave `couplings` out" in finding.message


@pytest.mark.parametrize("factors", [(1, 1, 1), (2, 0.5, 2)])
def test_a_sound_log_has_no_sums(robot, shot, factors):
    assert sum_findings(with_masses(robot, factors), [shot], OPTIONS) == ()
