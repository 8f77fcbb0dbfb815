"""Problems that solvers once ended on without numbers or with a bare error, each as small as it gets."""

from dataclasses import replace

import numpy as np
import pytest

import robid
from degenerate import outcome, unfit_numbers, unfit_words
from degenerate_problems import PLACES, PROBLEMS, _axes, _local, _loop, _rigid_log
from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from linear_loop import LINES, N_SAMPLE, STEP_S
from rigid_robots import planar_arm
from robid.face.fits import Fit
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.fit.problem import _gram
from robid.models.elastic.fit.weights import make_weights
from robid.models.external.fit.output_error import nrmse
from robid.results.estimate import Estimate
from robid.results.levenberg import Normal, _cosine
from robid.robot.description import Robot
from robid.signals.filters import design_decimator, low_pass_reach
from tolerances import IDENTITY

ARM = robid.RobotModel(two_joint_robot(), 1e-3)
MEASURED = exact_frf(
    with_spring_factors(two_joint_robot(), 1.2, 0.8), PLACES[:1], np.geomspace(3, 80, 12), relative_noise=0.02
)
FREE = {"free": ("stiffness", "damping"), "correct_torques": False}


def refused(code, call):
    assert outcome(call) == f"refused: {code}"


@pytest.mark.parametrize(("family", "count"), [("response", 40), ("rigid", 3), ("lpv", 3), ("design", 30)])
def test_some_problems_by_seed(family, count):
    outcomes = {seed: outcome(PROBLEMS[family](seed)[1]) for seed in range(count)}
    assert not {seed: ended for seed, ended in outcomes.items() if ended.startswith("WRONG")}


# The judge of the tests above.
def test_a_number_that_is_none_is_seen_where_nothing_documents_it():
    found = robid.fit_model("elastic", ARM, MEASURED, **FREE).found
    assert unfit_numbers(found) == []
    for field in ("value", "lower", "relative_std"):
        worse = replace(found, estimate=replace(found.estimate, **{field: getattr(found.estimate, field) * np.nan}))
        assert unfit_numbers(worse) == [f".estimate.{field} is not a number"]
        assert outcome(lambda worse=worse: Fit(worse)).startswith("WRONG")
    endless = replace(found, estimate=replace(found.estimate, value=found.estimate.value + np.inf))
    assert unfit_numbers(endless) == [".estimate.value is infinite"]
    assert isinstance(found.estimate, Estimate)
    assert unfit_words(replace(found, estimate=replace(found.estimate, advice="off by nan %")))
    unknown = replace(found.estimate, nominal=found.estimate.nominal * np.nan)  # its declaration says when
    assert unfit_numbers(unknown) == []


@pytest.mark.parametrize("error", [ValueError("x"), np.linalg.LinAlgError("x"), robid.DataError("no code")])
def test_a_bare_error_is_no_ending(error):
    def fails():
        raise error

    assert outcome(fails).startswith("WRONG")
    assert outcome(lambda: np.log(np.zeros(1))).startswith("WRONG: RuntimeWarning")
    assert outcome(lambda: sum(range(10**6)), limit_s=1e-6).startswith("WRONG: took")


# Elastic
def test_what_is_exactly_zero_has_no_weight_in_logarithms_whatever_the_model_says():
    response = MEASURED.response.copy()
    response[..., 1] = 0
    silent = replace(MEASURED, response=response)
    options = ElasticOptions()
    for size in (None, np.abs(MEASURED.response)):
        found, whole = (make_weights(each, options.weights, options.residual, size) for each in (silent, MEASURED))
        assert not found[0][..., 1].any()
        np.testing.assert_allclose(found[0][..., 0], whole[0][..., 0], rtol=IDENTITY)
        assert found[1] > whole[1]
    # As with an element whose noise is infinite: nothing of it moves the estimate.
    variance = np.where(np.arange(2) == 1, np.inf, 1.0)
    without = replace(MEASURED, dropped=np.broadcast_to(np.isinf(variance), (*response.shape[:2], 2)))
    zero, lost = (robid.fit_model("elastic", ARM, each, **FREE).parameters for each in (silent, without))
    for name in zero:
        assert zero[name].value == pytest.approx(lost[name].value, rel=1e-3)


@pytest.mark.parametrize("estimator", ["lls", "nls"])
def test_a_motor_that_never_moved_is_off_and_no_number_is_lost(estimator):
    response = MEASURED.response.copy()
    response[..., 1] = 0
    fit = robid.fit_model("elastic", ARM, replace(MEASURED, response=response), estimator=estimator, **FREE)
    assert unfit_numbers(fit.found) == []
    assert fit.found.alone.value == 0 or estimator == "lls"


def test_a_covariance_of_outputs_that_err_alike_is_refused_by_weights_that_invert_it():
    alike = replace(MEASURED, total_covariance=np.ones_like(MEASURED.total_covariance))
    refused("D243", lambda: robid.fit_model("elastic", ARM, alike, weights={"kind": "optimal_full"}, **FREE))
    assert outcome(lambda: robid.fit_model("elastic", ARM, alike, **FREE)).startswith("ended")


def test_a_negative_variance_is_refused():
    negative = replace(MEASURED, total_covariance=-MEASURED.total_covariance)
    refused("D241", lambda: robid.fit_model("elastic", ARM, negative, **FREE))


def test_a_response_far_beyond_the_model_keeps_its_weights(capfd):
    """With weights relative to the model, noise would be above the response, and nothing left to fit."""
    large = replace(MEASURED, response=1e9 * MEASURED.response, total_covariance=1e18 * MEASURED.total_covariance)
    fit = robid.fit_model("elastic", ARM, large, **FREE)
    assert fit.found.solution.costs.total > 1e3
    assert fit.found.alone.value == 0
    assert "DSYRK" not in capfd.readouterr().err


def test_no_lines_have_no_normal_matrix(capfd):
    np.testing.assert_array_equal(_gram(np.zeros((3, 2, 0), complex), real=False), np.zeros((3, 3)))
    assert capfd.readouterr() == ("", "")


def test_tiny_noise_gives_findings_without_roots_of_rounding():
    small = replace(MEASURED, total_covariance=1e-22 * MEASURED.total_covariance)
    assert outcome(lambda: robid.fit_model("elastic", ARM, small, weights={"kind": "optimal"}, **FREE)).startswith(
        "ended"
    )


def test_as_many_parameters_as_residuals_have_findings_all_the_same():
    line = exact_frf(with_spring_factors(two_joint_robot(), 1.2), PLACES[:1], np.array([17.0]), relative_noise=0.02)
    call = lambda: robid.fit_model("elastic", ARM, line, **FREE)  # noqa: E731
    assert outcome(call).startswith("ended")


def test_the_cosine_of_a_large_cost_is_that_of_a_small_one():
    gradient, hessian = np.array([3.0, 4.0]), np.diag([9.0, 25.0])
    found = [
        _cosine(Normal(scale * 2.0, scale * gradient, scale * hessian), np.ones(2, bool)) for scale in (1.0, 1e200)
    ]
    assert found[0] == pytest.approx(found[1])


# Responses
@pytest.mark.parametrize("silent", [[0, 1], [0, 0]])
def test_an_output_that_never_moves_has_a_response_of_zero(silent):
    u, y, _ = _loop(1e-3)
    record = robid.make_record(u[None], y[None] * silent, STEP_S, frequency_hz=LINES / (N_SAMPLE * STEP_S))
    response = robid.estimate_frf(record).response
    assert not response[:, :, 0].any()
    assert bool(response[:, :, 1].all()) == bool(silent[1])


@pytest.mark.parametrize("n_sample", [3, 4, 5, 9, 17])
def test_a_period_of_few_samples_has_its_response(n_sample):
    generator, gain = np.random.default_rng(1), np.array([[2.0, 1.0], [0.5, -1.0]])
    u = np.tile(generator.standard_normal((1, 3, 2, 1, n_sample, 2)), (1, 1, 1, 2, 1, 1))
    y = u @ gain.T + 1e-6 * generator.standard_normal(u.shape)
    found = robid.estimate_frf(robid.make_record(u, y, 1.0, frequency_hz=[1 / n_sample]), outputs="measured")
    np.testing.assert_allclose(found.response[0, 0], gain, atol=1e-3)


def test_numbers_that_overflow_are_refused():
    refused("D501", lambda: robid.make_record(np.full((8, 1), 1e200), np.ones((8, 1)), 1e-3))


def test_inputs_that_rest_where_the_reference_excites_are_refused():
    refused("D604", PROBLEMS["response"](15)[1])


# Rigid
def rigid_fit(u, y, robot=None, **options):
    made = robid.RobotModel(robot or planar_arm(3), 2e-3)
    records = [robid.make_record(*pair, 2e-3, names=made.joints, held=False) for pair in ((u, y), (0 * u, 0 * y))]
    if options.pop("validated", False):
        options["validate_on"] = records[1]
    return lambda: robid.fit_model("rigid", made, records[0], **options)


def test_short_silent_and_slow_rigid_records_are_refused():
    u, y = _rigid_log(0.01, 0.6)
    refused("D600", rigid_fit(u[:3], y[:3]))
    refused("D601", rigid_fit(u, y, validated=True))
    refused("D254", rigid_fit(u, y, filters={"position_cut_hz": 1e-9}))


def test_filters_longer_than_any_record_are_refused_before_they_are_made():
    with pytest.raises(ValueError, match="any record"):
        design_decimator(10**10)
    with pytest.raises(ValueError, match="any record"):
        low_pass_reach(1e-9, 1e-3)


def test_a_rotor_without_inertia_has_real_bodies_all_the_same():
    arm: Robot = planar_arm(3)
    light = replace(
        arm, joints=tuple(replace(joint, motor=replace(joint.motor, inertia_kgm2=0.0)) for joint in arm.joints)
    )
    assert outcome(rigid_fit(*_rigid_log(0.01, 0.6), robot=light)) == "ended: converged"


# External
def test_an_output_at_rest_is_described_by_a_model_at_rest():
    still, moving = np.zeros((5, 1)), np.arange(5.0)[:, None]
    assert nrmse(still, still) == [1.0]
    assert nrmse(moving, moving) == [1.0]
    assert nrmse(moving, np.full((5, 1), 2.0)) == [0.0]


def test_a_matrix_of_axes_that_do_not_move_each_other_is_fitted():
    u, y = _axes(1e-4)
    quantity = {"input_quantity": "position", "output_quantity": "position", "linear": True}
    record = robid.make_record(u, y, 0.012, names=["first", "second"], **quantity)
    call = lambda: robid.fit_model("external", record, matrix="full", poles=3, zeros=1, delay_samples=0)  # noqa: E731
    assert outcome(call).startswith("ended")


@pytest.mark.parametrize("seed", [1])
def test_starts_that_grow_beyond_numbers_are_left_out(seed):
    assert not outcome(PROBLEMS["external"](seed)[1]).startswith("WRONG")


# Over positions
def test_an_output_without_any_response_is_refused_by_name():
    frf = _local(-40.0, np.linspace(-1, 1, 7)[:, None])
    silent = replace(frf, response=frf.response * np.array([1, 0])[:, None])
    options = {"choose_on": [1], "scheduling": [0], "basis": {"degree": 2}, "path": {"count": 2}}
    with pytest.raises(robid.DataError, match="table never moves") as error:
        robid.fit_model("lpv", silent, **options)
    assert error.value.codes == ("D602",)
    refused("D602", lambda: robid.fit_model("lpv", frf, validate_on=silent.select([3]), **options))
    still = replace(frf, response=frf.response * (np.arange(7) != 3)[:, None, None, None])
    refused("D602", lambda: robid.fit_model("lpv", still, **options))


def test_a_basis_without_inverse_is_no_step_of_the_search():
    assert not outcome(PROBLEMS["lpv"](6)[1]).startswith("WRONG")


# Designs
USUAL = np.random.default_rng(1).uniform(-1.5, 1.5, (20, 2))
BAND = np.geomspace(3, 80, 12)
EVERY = [f"{spring.name}.{kind}" for spring in two_joint_robot().springs for kind in ("stiffness", "damping")]


@pytest.mark.parametrize(
    ("code", "places", "lines", "options"),
    [
        ("S599", USUAL[:0], BAND, {}),
        ("S600", USUAL * np.nan, BAND, {}),
        ("S600", USUAL + np.inf, BAND, {}),
        ("S601", USUAL, BAND, {"relative_error": 0.0}),
        ("S601", USUAL, BAND, {"relative_error": np.nan}),
        ("S602", USUAL, BAND[:0], {}),
        ("S602", USUAL, np.append(BAND, 0.0), {}),
        ("S602", USUAL, np.append(BAND, 500.0), {}),
        ("S602", USUAL, -BAND, {}),
        ("D599", USUAL, BAND, {"fixed": EVERY}),
    ],
)
def test_designs_of_nothing_are_refused(code, places, lines, options):
    refused(code, lambda: robid.choose_configurations(ARM, places, lines, 4, **options))


def test_a_response_is_asked_for_at_places_and_frequencies_that_there_are():
    refused("S599", lambda: ARM.response(USUAL[:0], BAND))
    refused("S602", lambda: ARM.response(USUAL, [0.0]))
    assert np.isfinite(ARM.response(USUAL[:1], [700.0], continuous=True)).all()


def test_criteria_that_depend_on_the_scale_are_refused_where_rounding_decides():
    springs = [
        replace(one, damping=one.damping * 10.0 ** (8 * (index % 2) - 8))
        for index, one in enumerate(two_joint_robot().springs)
    ]
    robot = robid.RobotModel(replace(two_joint_robot(), springs=tuple(springs)), 1e-3)
    refused("D603", lambda: robid.choose_configurations(robot, USUAL, np.geomspace(1e-3, 1e-2, 12), 4, criterion="e"))
