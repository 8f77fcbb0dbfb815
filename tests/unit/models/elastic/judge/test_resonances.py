"""Resonances between the lines come back, with honest intervals, and the model's counterparts are its modes."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, two_mass_robot, with_spring_factors
from robid.frf.local_model import interpolated_mode, parabola_mode, rational_mode
from robid.models.elastic.fit.fitting import fit_elastic, set_up
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.judge.extrema import own_resonance_errors
from robid.models.elastic.judge.fitted import damping_ratio, fitted_model, frequency_std, poles, zeros
from robid.models.elastic.judge.resonances import tabulate_resonances
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters, response
from solutions import with_estimate

ANTIRESONANCE_HZ = np.sqrt(546.4 / 4.752e-3) / (2 * np.pi)
RESONANCE_HZ = np.sqrt(546.4 * (1 / 4.752e-3 + 1 / 4.780e-3)) / (2 * np.pi)
BENCH_HZ = np.arange(11.0, 251.0)
BENCH = {"sampling_period_s": 4e-4, "delay_s": 5e-4, "output_names": ("drive", "drive.arm")}
OPTIONS = ElasticOptions(
    free=("stiffness", "damping", "viscous", "arm_viscous", "motor_inertia", "link_inertia", "delay")
)


def table_of(robot, frf, delay_s, options=OPTIONS):
    return tabulate_resonances(robot, fit_elastic(robot, frf, options, delay_s), frf, options, delay_s)


def linear_model(robot, configurations):
    model = build_model(robot)
    linear = linearize(model, solve_statics(model, np.atleast_2d(configurations)))
    return linear, nominal_parameters(robot, linear, 0.0)


@pytest.mark.parametrize(
    "frequency_hz", [BENCH_HZ, np.unique(np.round(np.geomspace(10, 250, 60)))], ids=["1 Hz grid", "60 log-spaced"]
)
@pytest.mark.parametrize("torque_hold", ["zoh", "band_limited"])
def test_two_masses_between_the_lines(frequency_hz, torque_hold):
    frf = exact_frf(two_mass_robot(), [[0.0]], frequency_hz, **BENCH, torque_hold=torque_hold)
    table = table_of(two_mass_robot(), frf, BENCH["delay_s"])
    assert table.kind == ("antiresonance", "resonance")
    assert set(table.channel) == {"drive"}
    np.testing.assert_allclose(table.pole_hz, [ANTIRESONANCE_HZ, RESONANCE_HZ], rtol=1e-6)
    np.testing.assert_allclose(table.mode_hz, [ANTIRESONANCE_HZ, RESONANCE_HZ], rtol=1e-6)
    model, parameters = linear_model(two_mass_robot(), [0.0])
    for found in (table.measured_hz, table.model_hz):
        # Peaks lie beside the undamped frequencies, and where the curve has them.
        for hz, at, pick in zip(found, (ANTIRESONANCE_HZ, RESONANCE_HZ), (np.argmin, np.argmax), strict=True):
            dense = at + np.linspace(-0.02, 0.02, 4001)
            curve = np.abs(response(model, parameters, dense, None).sampled[0, :, 0, 0])
            assert abs(hz - dense[pick(curve)]) < 2e-5
            assert abs(hz - at) > 5e-4
    natural = 2 * np.pi * np.array([ANTIRESONANCE_HZ, RESONANCE_HZ])
    np.testing.assert_allclose(table.damping, 0.01 / (2 * 546.4) * natural, rtol=1e-6)


def test_interval_has_the_deviation_of_repeated_measurements():
    found, reach = [], []
    for seed in range(40):
        frf = exact_frf(two_mass_robot(), [[0.0]], BENCH_HZ, **BENCH, relative_noise=1e-3, seed=seed)
        if seed == 0:
            solution = fit_elastic(two_mass_robot(), frf, OPTIONS, BENCH["delay_s"])
        table = tabulate_resonances(two_mass_robot(), solution, frf, OPTIONS, BENCH["delay_s"])
        found.append(table.measured_hz)
        reach.append(0.5 * (table.upper_hz - table.lower_hz))
    found = np.array(found)
    np.testing.assert_allclose(found.mean(axis=0), [ANTIRESONANCE_HZ, RESONANCE_HZ], rtol=1e-3)
    ratio = np.median(reach, axis=0) / 1.96 / found.std(axis=0)
    assert (ratio > 0.7).all(), ratio
    assert (ratio < 1.4).all(), ratio


def test_same_model_leaves_no_error_where_modes_crowd():
    robot = two_joint_robot()
    lines = np.unique(np.round(np.geomspace(1, 60, 60), 1))
    frf = exact_frf(robot, [[-0.3, 0.5], [0.9, 1.2]], lines, delay_s=1e-3)
    table = table_of(robot, frf, 1e-3, ElasticOptions())
    assert len(table.kind) >= 8
    np.testing.assert_allclose(table.model_hz, table.measured_hz, rtol=1e-6)
    assert set(table.configuration.tolist()) == {0, 1}


def test_stiffer_model_shows_higher_frequencies():
    robot = two_mass_robot()
    frf = exact_frf(robot, [[0.0]], BENCH_HZ, **BENCH)
    solution = fit_elastic(robot, frf, OPTIONS, BENCH["delay_s"])
    stiffer = with_spring_factors(robot, 1.1)
    factor = np.where(np.array(solution.estimate.kinds) == "stiffness", 1.1, 1.0)
    nominal, value = solution.estimate.nominal * factor, solution.estimate.value * factor
    moved = with_estimate(solution, nominal=nominal, value=value)
    table = tabulate_resonances(stiffer, moved, frf, OPTIONS, BENCH["delay_s"])
    # Peaks are off the undamped frequencies by the square of the damping, which does not follow the stiffness.
    np.testing.assert_allclose(table.model_hz / table.measured_hz, np.sqrt(1.1), rtol=1e-5)


def test_far_model_has_no_counterpart():
    robot = two_mass_robot()
    frf = exact_frf(robot, [[0.0]], BENCH_HZ, **BENCH)
    solution = fit_elastic(robot, frf, OPTIONS, BENCH["delay_s"])
    factor = np.where(np.array(solution.estimate.kinds) == "stiffness", 3.0, 1.0)
    nominal, value = solution.estimate.nominal * factor, solution.estimate.value * factor
    moved = with_estimate(solution, nominal=nominal, value=value)
    table = tabulate_resonances(with_spring_factors(robot, 3.0), moved, frf, OPTIONS, BENCH["delay_s"])
    np.testing.assert_allclose(table.measured_hz, [ANTIRESONANCE_HZ, RESONANCE_HZ], rtol=1e-3)
    assert np.isnan(table.model_hz).all()
    assert np.isnan(table.damping).all()


@pytest.mark.parametrize("seed", range(5))
def test_noise_makes_no_resonances(seed):
    rigid = two_mass_robot(stiffness=5e5, damping=50.0)
    frf = exact_frf(rigid, [[0.0]], BENCH_HZ, **BENCH, relative_noise=0.05, seed=seed)
    free = ElasticOptions(free=("viscous", "motor_inertia", "delay"))
    assert table_of(rigid, frf, BENCH["delay_s"], free).kind == ()


def test_dip_down_to_the_noise_floor_is_seen():
    frf = exact_frf(two_mass_robot(), [[0.0]], BENCH_HZ, **BENCH, relative_noise=0.03, seed=3)
    table = table_of(two_mass_robot(), frf, BENCH["delay_s"])
    assert table.kind == ("antiresonance", "resonance")
    assert table.lower_hz[0] <= ANTIRESONANCE_HZ <= table.upper_hz[0]


def test_poles_and_zeros_are_those_of_the_response():
    robot = two_joint_robot()
    linear, parameters = linear_model(robot, [0.4, -0.9])
    free = replace(parameters, damping=0 * parameters.damping, viscous=0 * parameters.viscous)
    for motor in range(2):
        for root in zeros(linear, free, 0, motor).roots:
            at = np.array([abs(root) / (2 * np.pi)])
            here = np.abs(response(linear, free, at, None).sampled[0, 0, motor, motor])
            near = np.abs(response(linear, free, 1.01 * at, None).sampled[0, 0, motor, motor])
            assert here < 1e-6 * near
    for root in poles(linear, free, 0).roots[-4:]:
        at = np.array([abs(root) / (2 * np.pi)]) * (1 + 1e-8)
        here = np.abs(response(linear, free, at, None).sampled).max()
        assert here > 1e3 * np.abs(response(linear, free, 1.01 * at, None).sampled).max()


def test_damping_ratio_is_the_textbook_one():
    linear, parameters = linear_model(two_mass_robot(damping=0.4), [0.0])
    natural = np.sqrt(546.4 / 4.752e-3)
    locked = zeros(linear, parameters, 0, 0).roots
    np.testing.assert_allclose(damping_ratio(locked), 0.4 / (2 * 4.752e-3 * natural), rtol=1e-9)
    np.testing.assert_allclose(np.abs(locked), natural, rtol=1e-9)


def test_local_model_is_exact_for_its_own_form_and_refuses_a_slope():
    frequency = np.array([20.0, 21.3, 22.9, 24.4, 26.2, 28.0, 30.1])
    s = 2j * np.pi * frequency
    root = 2 * np.pi * 24.9 * (-0.02 + 1j * np.sqrt(1 - 0.02**2))
    data = (3.0 + 0.1 * s + 0.4 * s**2) / ((s - root) * (s - root.conjugate()))
    mode = rational_mode(frequency, data, np.full(7, 1e-12), 3, "resonance")
    np.testing.assert_allclose(mode.root, root, rtol=1e-6)
    assert rational_mode(frequency, 1.0 / s, np.full(7, 1e-12), 3, "resonance") is None


def noisy_mode(seed, relative, half_width_lines, kind):
    """A wide extremum between lines of 1 Hz, with another 20 Hz higher, read from its highest or lowest line."""
    frequency = np.arange(50.0, 105.0)
    s = 2j * np.pi * frequency
    here, there = (2 * np.pi * hz * (-0.035 + 1j * np.sqrt(1 - 0.035**2)) for hz in (76.3, 96.3))
    data = (s - here) * (s - here.conjugate()) / ((s - there) * (s - there.conjugate()))
    data = 1 / data if kind == "resonance" else data
    generator = np.random.default_rng(seed)
    variance = relative**2 * np.abs(data) ** 2
    moved = generator.standard_normal((2, data.size))
    data = data + np.sqrt(0.5 * variance) * (moved[0] + 1j * moved[1])
    extremum = int(np.abs(data).argmax() if kind == "resonance" else np.abs(data).argmin())
    return rational_mode(frequency, data, variance, extremum, kind, half_width_lines)


@pytest.mark.parametrize("kind", ["resonance", "antiresonance"])
def test_more_lines_find_a_noisy_root_without_bias_and_as_sure_as_they_say(kind):
    found = [noisy_mode(seed, 0.06, 8, kind) for seed in range(100)]
    found = [mode for mode in found if mode is not None]
    assert len(found) > 95
    hz, said = (np.array([getattr(mode, key) for mode in found]) for key in ("frequency_hz", "std_hz"))
    assert abs(hz.mean() - 76.3) < 4 * hz.std() / np.sqrt(hz.size)
    assert np.median(said) == pytest.approx(hz.std(), rel=0.3)
    narrow = [noisy_mode(seed, 0.06, 3, kind) for seed in range(100)]
    assert np.std([mode.frequency_hz for mode in narrow if mode is not None]) > 2 * hz.std()


def test_more_lines_serve_noise_alone():
    assert noisy_mode(0, 0.01, 3, "resonance") is not None
    assert noisy_mode(0, 0.01, 8, "resonance") is None


@pytest.mark.parametrize("kind", ["resonance", "antiresonance"])
def test_interpolation_finds_a_root_that_no_mechanical_form_explains(kind):
    frequency = np.array([23.1, 24.4, 26.0])
    data = 3.0 * (2j * np.pi * (frequency - 24.75) + 1.5) * np.exp(0.9j + 0.02j * frequency)
    if kind == "resonance":
        data = 1 / data
    mode = interpolated_mode(frequency, data, np.full(3, 1e-12), 1, kind)
    np.testing.assert_allclose(mode.root, 2j * np.pi * 24.75 - 1.5, rtol=1e-3)
    lines = np.concatenate([frequency[:1] - 2, frequency, frequency[-1:] + 2])
    distorted = np.concatenate([[5.0], data / np.abs(data).min(), [5.0j]])
    assert rational_mode(lines, distorted, np.full(5, 1e-12), 2, kind) is None


def test_parabola_finds_the_vertex():
    frequency = np.array([20.0, 21.3, 22.9, 24.4, 26.2])
    magnitude = np.exp(-5 * np.log(frequency / 22.5) ** 2) + 0j
    mode = parabola_mode(frequency, magnitude * np.exp(0.7j), np.full(5, 1e-6), 2, "resonance")
    np.testing.assert_allclose(mode.frequency_hz, 22.5, rtol=1e-9)
    assert mode.std_hz > 0
    for line, kind in ((3, "resonance"), (2, "antiresonance")):
        assert parabola_mode(frequency, magnitude, np.full(5, 1e-6), line, kind) is None


def test_a_root_that_grows_in_time_is_refused():
    frequency = np.array([23.1, 24.4, 26.0])
    data = 1 / (2j * np.pi * (frequency - 24.75) - 6.0)
    assert interpolated_mode(frequency, data, np.full(3, 1e-12), 1, "resonance") is None
    assert interpolated_mode(frequency, data.conj(), np.full(3, 1e-12), 1, "resonance") is not None


def test_counterpart_lies_where_the_measured_one_was_sought():
    """Two modes half a line apart: whichever line the model peaks at, the pair stays within its window."""
    robot = two_joint_robot()
    lines = np.unique(np.round(np.geomspace(3, 60, 40), 1))
    configurations = np.random.default_rng(4).uniform(-1.5, 1.5, (6, 2))
    frf = exact_frf(robot, configurations, lines, delay_s=1e-3, relative_noise=0.003, seed=5)
    table = table_of(robot, frf, 1e-3, ElasticOptions())
    paired = np.isfinite(table.model_hz)
    assert paired.sum() >= 20
    np.testing.assert_allclose(table.model_hz[paired], table.measured_hz[paired], rtol=0.01)


@pytest.mark.parametrize("kinds", [OPTIONS.free, ("stiffness", "delay", "damping")])
def test_deviation_of_a_mode_is_that_of_moved_parameters(kinds):
    robot, options = two_joint_robot(), ElasticOptions(free=kinds, fixed=("gear_2.stiffness",))
    frf = exact_frf(robot, [[-0.3, 0.5], [0.9, 1.2]], np.geomspace(1, 60, 30), delay_s=1e-3)
    fitted = fitted_model(robot, fit_elastic(robot, frf, options, 1e-3), frf, options, 1e-3)
    n_param = len(fitted.problem.parameters.names)
    root = np.random.default_rng(2).standard_normal((n_param, n_param))
    covariance = root @ root.T

    def moved(modes_of, step):
        values = fitted.problem.parameters.parameters(fitted.internal + step)
        return np.abs(modes_of(fitted.problem.model, values).roots) / (2 * np.pi)

    for modes_of in (lambda *at: poles(*at, 1), lambda *at: zeros(*at, 1, 0)):
        steps = 1e-5 * np.eye(n_param)
        slopes = np.array([(moved(modes_of, step) - moved(modes_of, -step)) / 2e-5 for step in steps])
        wanted = np.sqrt(np.einsum("pm,pq,qm->m", slopes, covariance, slopes))
        found = frequency_std(fitted, covariance, modes_of(*fitted.linear), 1)
        np.testing.assert_allclose(found, wanted, rtol=1e-5)


@pytest.mark.slow
def test_interval_of_the_model_holds_its_truth_about_as_often_as_it_says():
    held = []
    for seed in range(40):
        frf = exact_frf(two_mass_robot(), [[0.0]], BENCH_HZ, **BENCH, relative_noise=1e-3, seed=seed)
        table = table_of(two_mass_robot(), frf, BENCH["delay_s"], replace(OPTIONS, weights=Weights(model_error=0.0)))
        truth = np.array([ANTIRESONANCE_HZ, RESONANCE_HZ])
        held.append((table.mode_lower_hz <= truth) & (truth <= table.mode_upper_hz))
    assert 0.85 <= np.mean(held) <= 0.99


def test_resonance_errors_are_those_of_the_stiffness():
    robot, frequency = two_mass_robot(), BENCH_HZ
    frf = exact_frf(robot, [[0.0]], frequency, sampling_period_s=4e-4, relative_noise=1e-4)
    options = ElasticOptions(free=("stiffness",), weights=Weights(kind="user"))
    problem, _ = set_up(robot, frf, options, 0.0)
    factor = 1.1
    errors = [own_resonance_errors(problem, np.array([x])) for x in (0.0, np.log(factor), np.log(4.0))]
    assert errors[0].shape == (1,)
    assert errors[0][0] < 1e-3
    assert errors[1][0] == pytest.approx(np.sqrt(factor) - 1, rel=2e-2)
    assert np.isinf(errors[2][0])
