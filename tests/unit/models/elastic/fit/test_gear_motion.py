"""Dampers that grow with the load and hysteresis: closed forms, derivatives, and known truth that returns."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad

from exact_systems import exact_frf, linear_axis, two_joint_robot, with_spring_factors
from robid.errors import DataError
from robid.models.elastic.fit.fitting import fit_elastic, set_up
from robid.models.elastic.fit.gear_motion import bristle_table, mean_size
from robid.models.elastic.fit.nuisance.listing import estimated_nuisances, list_nuisances
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.judge.fitted import fitted_model, poles
from robid.robot.linearize import solve_statics
from robid.robot.model import HYSTERESIS_SHARE, build_model
from robid.robot.parameters import NUISANCE_KIND

FREQUENCY_HZ = np.geomspace(1, 60, 30)
PLACES = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [0.2, 2.0]])
DELAY_S = 1e-3
STIFFNESS = 3e4
GROWTH_1_RAD = 60.0


def with_torques(frf, size_nm=0.02):
    turns = np.random.default_rng(3).random((*frf.response.shape[:2], 2, 4))
    return replace(frf, input_amplitude=size_nm * np.exp(2j * np.pi * turns))


@pytest.mark.parametrize("slip", [0.1, 0.5, 2.0])
def test_bristles_on_a_sine_lose_what_their_loop_encloses(slip):
    amplitude, omega = 2e-4, np.array([31.0])
    table = bristle_table(STIFFNESS, np.full((1, 1, 1), 0.5 * amplitude, complex), np.array([7]), omega)
    h = slip * amplitude
    # On its way up `z = h - (h + z0) exp(-(x + A) / h)`, from `-z0` to `z0 = h tanh(A / h)`.
    turned = h * np.tanh(amplitude / h)
    enclosed = 2 * quad(lambda x: h - (h + turned) * np.exp(-(x + amplitude) / h), -amplitude, amplitude)[0]
    found = table.added(STIFFNESS * h, omega)[0, 0]
    assert found.imag == pytest.approx(STIFFNESS * enclosed / (np.pi * amplitude**2), rel=0.02)
    assert table.added(-STIFFNESS * h, omega)[0, 0] == -found


def test_bristles_that_slip_early_rub_and_those_that_never_slip_are_springs():
    lines = np.unique(np.geomspace(5, 200, 40).astype(int))
    omega, turns = 2 * np.pi * lines, np.random.default_rng(1).random((2, lines.size, 8))
    moved = 1e-4 / (1 + (omega[:, None] / 100) ** 2) * np.exp(2j * np.pi * turns)
    table = bristle_table(STIFFNESS, moved, lines, omega)
    speed = np.sqrt((2 * np.abs(moved[:, :, 0]) ** 2 * omega**2).sum(axis=1)).mean()
    early = 0.003 * STIFFNESS * table.swing
    rubs = table.added(early, omega).imag / omega
    # Coulomb friction under a normal motion, statistically linearised.
    assert np.median(rubs) == pytest.approx(np.sqrt(2 / np.pi) * early / speed, rel=0.12)
    sticks = table.added(300 * STIFFNESS * table.swing, omega)
    np.testing.assert_allclose(sticks.real, STIFFNESS, rtol=0.02)
    assert np.abs(sticks.imag).max() < 0.01 * STIFFNESS
    step = 1e-3 * early
    difference = (table.added(early + step, omega) - table.added(early - step, omega)) / (2 * step)
    np.testing.assert_allclose(table.slope(early, omega), difference, rtol=1e-3)


@pytest.mark.parametrize("mean", [0.0, 0.7, -3.0, 50.0])
def test_mean_size_of_a_normal_variable(mean):
    drawn = np.abs(mean + 1.3 * np.random.default_rng(0).standard_normal(400_000)).mean()
    assert mean_size(np.array(mean), np.array(1.3**2)) == pytest.approx(drawn, rel=5e-3)
    assert mean_size(np.array(mean), np.array(0.0)) == pytest.approx(abs(mean), abs=1e-12)


def test_derivatives_by_the_kinds_of_gears_are_those_of_the_response():
    frf = with_torques(exact_frf(two_joint_robot(), PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003))
    problem = set_up(two_joint_robot(), frf, ElasticOptions(free=("load_damping", "hysteresis")), DELAY_S)[0]
    kinds = np.array(problem.parameters.kind_of)
    point = np.random.default_rng(2).uniform(-0.2, 0.2, kinds.size)
    point[kinds == NUISANCE_KIND] = [0.5, 0.7, 0.3, -0.4]
    derivative = problem.linear(point)[1]
    for index in np.flatnonzero(np.isin(kinds, (NUISANCE_KIND, "damping"))):
        step = 1e-4 * (np.arange(point.size) == index)
        ahead, behind = problem.linear(point + step)[0], problem.linear(point - step)[0]
        difference = -(ahead - behind) / 2e-4
        np.testing.assert_allclose(derivative[..., index], difference, rtol=1e-4, atol=1e-5 * np.abs(difference).max())


def loaded_arm():
    """Responses of an arm whose dampers grow with the load, each place's from a robot of its own dampers."""
    true = with_spring_factors(two_joint_robot(), [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])
    bent = np.abs(solve_statics(build_model(true), PLACES).deflection)
    parts = []
    for place, row in zip(PLACES, bent.tolist(), strict=True):
        grown = [
            replace(s, damping=s.damping * (1 + GROWTH_1_RAD * x * (s.place == "transmission")))
            for s, x in zip(true.springs, row, strict=True)
        ]
        parts.append(exact_frf(replace(true, springs=tuple(grown)), place, FREQUENCY_HZ, delay_s=DELAY_S))
    sound = exact_frf(true, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=5)
    clean = exact_frf(true, PLACES, FREQUENCY_HZ, delay_s=DELAY_S)
    response = np.concatenate([part.response for part in parts]) + sound.response - clean.response
    return true, replace(sound, response=response)


def test_growth_of_dampers_returns_and_the_dampers_with_it():
    true, frf = loaded_arm()
    wrong = fit_elastic(two_joint_robot(), frf, ElasticOptions(), DELAY_S)
    options = ElasticOptions(free=("load_damping",))
    solution = fit_elastic(two_joint_robot(), frf, options, DELAY_S)
    estimate, plain = solution.estimate, wrong.estimate
    assert solution.costs.total < 0.2 * wrong.costs.total
    for spring in true.springs[:2]:
        growth, damper = (estimate.names.index(f"{spring.name}.{kind}") for kind in ("load_damping", "damping"))
        assert estimate.lower[growth] < GROWTH_1_RAD < estimate.upper[growth]
        off = abs(estimate.value[damper] / spring.damping - 1)
        assert off < 0.1 * abs(plain.value[plain.names.index(f"{spring.name}.damping")] / spring.damping - 1)
    fitted = fitted_model(two_joint_robot(), solution, frf, options, DELAY_S)
    modelled = fitted.problem.model_response(fitted.internal)
    np.testing.assert_allclose(modelled, solution.responses.modelled, rtol=1e-6)


def test_a_damper_whose_load_is_alike_everywhere_is_named_with_what_to_do():
    robot = replace(two_joint_robot(), gravity_m_s2=np.zeros(3))
    frf = with_torques(exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=5))
    solution = fit_elastic(robot, frf, ElasticOptions(free=("gear_2.load_damping",)), DELAY_S)
    told = [each for each in solution.estimate.undetermined if "hardly distinguished from gear_2.damping" in each]
    assert len(told) == 1
    assert "measure some that load it otherwise, or leave it out of `free`" in told[0]


def test_the_load_of_a_gear_that_slides_is_told_in_its_unit():
    places = np.array([[0.3], [0.8], [1.5], [1.9]])
    frf = exact_frf(linear_axis(upright=True), places, FREQUENCY_HZ, relative_noise=0.003, seed=5)
    options = ElasticOptions(free=("load_damping",))
    told = " ".join(fit_elastic(linear_axis(upright=True), frf, options, 0.0).estimate.undetermined)
    # 80 kg on 5 MN/m.
    assert "bent nearly alike in all configurations (0.16 to 0.16 mm)" in told


def test_bristles_that_stick_are_part_of_the_spring_and_the_fit_says_so():
    stiffer = with_spring_factors(two_joint_robot(), [1 + HYSTERESIS_SHARE, 1, 1, 1], [1, 1, 1, 1])
    frf = with_torques(exact_frf(stiffer, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=5))
    solution = fit_elastic(two_joint_robot(), frf, ElasticOptions(free=("gear_1.hysteresis",)), DELAY_S)
    told = [each for each in solution.estimate.undetermined if each.startswith("gear_1.hysteresis may be none")]
    assert len(told) == 1
    assert "part of the spring: excite the gear more (`rms`)" in told[0]


def test_hysteresis_without_a_known_swing_is_refused_and_growth_is_not():
    frf = exact_frf(two_joint_robot(), PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003)
    set_up(two_joint_robot(), frf, ElasticOptions(free=("load_damping",)), DELAY_S)
    with pytest.raises(DataError, match="D132"):
        set_up(two_joint_robot(), frf, ElasticOptions(free=("hysteresis",)), DELAY_S)


def test_hysteresis_that_a_fit_estimates_is_no_nuisance_any_more():
    robot, options = two_joint_robot(), ElasticOptions(free=("gear_1.hysteresis",))
    assert [nuisance.name for nuisance in estimated_nuisances(robot, options)] == ["gear_1.hysteresis"]
    names = {nuisance.name for nuisance in list_nuisances(robot, options)}
    assert {"gear_2.hysteresis_early", "gear_2.hysteresis_late"} <= names
    assert not any(name.startswith("gear_1.hysteresis") for name in names)


def test_resonances_know_growth_and_hysteresis():
    robot = two_joint_robot()
    frf = with_torques(exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003))
    options = ElasticOptions(free=("load_damping", "hysteresis"))
    problem = set_up(robot, frf, options, DELAY_S)[0]
    sound = problem.parameters.parameters(np.zeros(len(problem.parameters.names)))
    assert sound.doubt.size == 4
    effects = problem.model.effects
    before = poles(problem.model, sound, 0).roots
    for amounts, spring in (([300.0, 0, 0, 0], 0), ([0, 2.0, 0, 0], 0)):
        moved = replace(sound, doubt=np.array(amounts))
        after = poles(problem.model, moved, 0).roots
        row = int(np.argmax(np.abs(after / before - 1)))
        assert abs(after[row] / before[row] - 1) > 1e-3
        omega = float(np.abs(after[row]))
        stiffness = effects.stiffness(moved.doubt, np.array([omega]))[0, 0, spring]
        damping = sound.damping.copy()
        damping[spring] = damping[spring] * effects.growth(moved.doubt)[0, spring] + stiffness.imag / omega
        linear = sound.stiffness + stiffness.real * (np.arange(4) == spring)
        same = replace(sound, stiffness=linear, damping=damping)
        assert after[row] == pytest.approx(poles(problem.model, same, 0).roots[row], rel=1e-6)


@pytest.mark.parametrize("slip", [0.1, 3.0])
def test_hysteresis_is_found_on_its_side_of_the_largest_loss(slip):
    robot, options = two_joint_robot(), ElasticOptions(free=("gear_1.hysteresis",))
    frf = with_torques(exact_frf(robot, PLACES, FREQUENCY_HZ, delay_s=DELAY_S, relative_noise=0.003, seed=5))
    problem = set_up(robot, frf, options, DELAY_S)[0]
    bristle, names = problem.model.effects.bristles[0], problem.parameters.names
    true = slip * bristle.stiffness * bristle.swing
    point = np.zeros(len(names))
    point[names.index("gear_1.hysteresis")] = true / problem.parameters.scale[names.index("gear_1.hysteresis")]
    changed = problem.model_response(point) / problem.model_response(np.zeros(len(names)))
    estimate = fit_elastic(robot, replace(frf, response=frf.response * changed), options, DELAY_S).estimate
    assert estimate.value[names.index("gear_1.hysteresis")] == pytest.approx(true, rel=0.3)
    assert estimate.value[names.index("gear_1.stiffness")] == pytest.approx(robot.springs[0].stiffness, rel=0.02)
