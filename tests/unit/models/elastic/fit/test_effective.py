"""The values that clusters agree on, of springs that differ between clusters and of springs that do not."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, two_joint_robot, with_spring_factors
from realizations import averaged
from robid.clusters.pooling import pool
from robid.frf.joined import join
from robid.models.elastic.fit.fitting import fit_elastic
from robid.models.elastic.fit.intervals import find_spreads
from robid.models.elastic.fit.optimizers import optimise
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.fit.parameters import map_parameters
from robid.models.elastic.fit.physical import cluster_evidence, weigh_clusters
from robid.models.elastic.fit.problem import make_problem
from robid.models.elastic.fit.uncertainty import influence, score_covariance, structured_covariance
from robid.robot.linearize import linearize, solve_statics
from robid.robot.model import build_model
from robid.robot.response import nominal_parameters

FREQUENCY_HZ = np.geomspace(2.0, 60.0, 40)
OPTIONS = ElasticOptions(weights=Weights("inflated"), free=("stiffness", "damping"))
SCATTER = 0.03


def fitted(scatter, seed, n_cluster=8, amplitudes=1, options=OPTIONS, mean=1.0, frequency_hz=FREQUENCY_HZ):
    """A fit of clusters whose springs differ, as its problem, its minimum and the estimator linearised there."""
    generator = np.random.default_rng(seed)
    configurations = generator.uniform(-1.4, 1.4, (n_cluster, 2))
    robots = [
        with_spring_factors(two_joint_robot(), factors)
        for factors in mean * np.exp(scatter * generator.standard_normal((n_cluster, 4)))
    ]
    rows = [
        averaged(exact_frf(robot, cluster[None], frequency_hz), 0.003, seed=1000 * seed + 10 * index + amplitude)
        for index, (robot, cluster) in enumerate(zip(robots, configurations, strict=True))
        for amplitude in range(amplitudes)
    ]
    frf = join(rows, [str(index) for index in range(len(rows))])
    model = build_model(two_joint_robot())
    linear = linearize(model, solve_statics(model, frf.configurations), frf.output_names)
    nominal = nominal_parameters(two_joint_robot(), linear, 0.0)
    parameters = map_parameters(two_joint_robot(), nominal, options, (), np.zeros(0))
    problem = make_problem(frf, linear, parameters, options)[0]
    internal = optimise(problem, np.zeros(len(parameters.names))).parameters
    return problem, internal, influence(problem, internal)


def springs(problem):
    return np.array([kind == "stiffness" for kind in problem.parameters.kind_of])


def test_scores_of_all_configurations_have_the_sandwich_as_covariance():
    problem, _, found = fitted(0.0, 1)
    meat = score_covariance(problem, found).sum(axis=0)
    inverse = 0.5 * found.inverse
    known = inverse @ np.diag(2 * found.prior) @ inverse
    np.testing.assert_allclose(
        inverse @ meat @ inverse + known, structured_covariance(problem, found), rtol=1e-9, atol=1e-18
    )


def test_at_the_minimum_the_scores_of_all_clusters_and_what_is_known_are_in_balance():
    problem, internal, found = fitted(SCATTER, 2, amplitudes=2)
    evidence = cluster_evidence(problem, internal, score_covariance(problem, found))
    assert len(evidence.rows) == 8
    alike = replace(problem, model_error=np.zeros(()))
    # Where weights are the inverse of the covariance, bread and meat agree and the fit's own minimum stays.
    bread = cluster_evidence(alike, internal, 2 * _bread(problem, internal))
    shift = pool(bread, np.zeros(internal.size)).shift
    assert (np.abs(shift) < 1e-3 * np.sqrt(np.diag(structured_covariance(problem, found)))).all()


def _bread(problem, internal):
    derivative = problem.linear(internal)[1]
    rows = derivative.reshape(len(derivative), -1, derivative.shape[-1])
    weighted = problem.fully_weighted(derivative).reshape(rows.shape)
    return np.real(weighted.conj().swapaxes(1, 2) @ rows)


def test_without_differences_the_intervals_are_those_of_noise_and_assumed_error():
    problem, internal, found = fitted(0.0, 3)
    effective = weigh_clusters(problem, internal, found)
    own = springs(problem)
    std = np.sqrt(np.diag(structured_covariance(problem, found)))
    half = effective.pooled.reach(0.95)
    np.testing.assert_allclose(half[own], 1.96 * std[own], rtol=0.6)
    assert (half[own] > 0.9 * std[own]).all()
    assert (np.abs(effective.values - internal)[own] < 1.5 * std[own]).all()


def test_what_springs_differ_by_is_found_and_their_mean_is_held():
    held, between, narrow = [], [], []
    for seed in range(10, 35):
        problem, internal, found = fitted(SCATTER, seed)
        effective = weigh_clusters(problem, internal, found)
        own = springs(problem)
        held.append((np.abs(effective.values) <= effective.pooled.reach(0.95))[own])
        std = np.sqrt(np.diag(structured_covariance(problem, found)))
        narrow.append((np.abs(internal) <= 1.96 * std)[own])
        between.append(effective.pooled.between[own])
    assert np.sqrt(np.mean(between)) == pytest.approx(SCATTER, rel=0.25)
    # 100 springs; 0.95 less three deviations.
    assert np.mean(held) > 0.88
    assert np.mean(narrow) < 0.7, "noise and assumed error must say far less, or there is nothing to find"


def test_amplitudes_of_one_place_are_one_place():
    problem, internal, found = fitted(SCATTER, 5, n_cluster=4, amplitudes=3)
    # Three, and the little that is known of dampers beforehand.
    assert (weigh_clusters(problem, internal, found).pooled.degrees_of_freedom < 3.5).all()


@pytest.mark.parametrize("seed", [2, 3])
def test_a_spring_at_infinity_leaves_the_others_their_intervals(seed):
    # Few lines for many parameters: each cluster leaves some of their combinations all but unseen.
    options = replace(OPTIONS, free=("stiffness", "damping", "motor_inertia"))
    rigid = np.array([1.0, 1.0, 1.0, 1e6])
    problem, internal, found = fitted(
        SCATTER, seed, options=options, mean=rigid, frequency_hz=np.geomspace(2.0, 60.0, 5)
    )
    near = weigh_clusters(problem, internal, found).pooled
    for stiff in (12.0, 8.0):
        point = np.where(np.array(problem.parameters.names) == "forearm.stiffness", stiff, internal)
        far = weigh_clusters(problem, point, influence(problem, point))
        assert (np.sqrt(far.pooled.between[:3]) < 2 * SCATTER).all()
        np.testing.assert_allclose(far.pooled.reach(0.95)[:3], near.reach(0.95)[:3], rtol=0.2)
        assert far.values[3] == stiff, "nothing says how stiff it is"


def spreads(problem, internal, found, excess=1.0):
    return find_spreads(problem, internal, found, excess, 0.95)


def test_few_clusters_are_widened_by_the_misfit_instead():
    problem, internal, found = fitted(0.0, 6, n_cluster=3, amplitudes=2)
    sound, poor = (spreads(problem, internal, found, excess) for excess in (0.5, 4.0))
    np.testing.assert_allclose(poor.effective.std, 2 * sound.effective.std)
    np.testing.assert_array_equal(sound.effective.values, internal)
    assert sound.between is None
    assert sound.effective.rule == "noise and assumed model error"
    assert poor.effective.rule == "noise and assumed model error, widened by the misfit"


def test_from_four_clusters_on_their_differences_count_and_no_misfit():
    problem, internal, found = fitted(0.0, 6, n_cluster=4)
    one, other = (spreads(problem, internal, found, excess) for excess in (1.0, 4.0))
    np.testing.assert_array_equal(one.effective.covariance, other.effective.covariance)
    assert one.between is not None
    assert "4 clusters" in one.effective.rule


@pytest.mark.parametrize("kind", ["user", "inflated"])
def test_without_a_covariance_the_assumed_error_stands_in_for_noise(kind):
    true = with_spring_factors(two_joint_robot(), [1.3, 0.8, 1.2, 0.9], [0.7, 1.4, 1.2, 0.8])
    clusters = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2], [-1.1, 0.3], [0.2, 2.0]])
    frf = exact_frf(true, clusters, FREQUENCY_HZ)
    options = ElasticOptions(weights=Weights(kind=kind))
    estimate = fit_elastic(two_joint_robot(), frf, options, 0.0).estimate
    springs = np.array(estimate.kinds) == "stiffness"
    truth = [spring.stiffness for spring in true.springs]
    assert (estimate.lower[springs] < truth).all()
    assert (truth < estimate.upper[springs]).all()
    reach = np.log(estimate.upper[springs] / estimate.lower[springs])
    assert (reach > 1e-3).all()  # not as certain as without any error
    assert (reach < 1.0).all()  # not as uncertain as without any data
    assert "assumed model error" in estimate.interval_rule
