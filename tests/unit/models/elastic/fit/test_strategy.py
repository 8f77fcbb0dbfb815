"""The way from a start to a minimum: minima that lock a joint are left, other parameters keep their start."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from exact_systems import exact_frf, friction_frf, two_joint_robot, with_spring_factors
from robid.artifacts.parts import Parts
from robid.artifacts.results import START
from robid.models.elastic.fit import optimizers as module
from robid.models.elastic.fit.fitting import _ends, descend, draw_starts, fit_elastic, set_up
from robid.models.elastic.fit.optimizers import make_strategy
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.elastic.kept_starts import resuming_map
from robid.models.family import Work
from robid.results.levenberg import Minimum

CONFIGURATIONS = np.array([[-0.3, 0.5], [0.4, -1.0], [0.9, 1.2]])
FREQUENCY_HZ = np.unique(np.round(np.geomspace(1, 60, 40), 1))


def strategy_of(strategy="staged", configurations=CONFIGURATIONS, **options):
    robot = with_spring_factors(two_joint_robot(), [1.3, 0.8, 1.2, 0.9])
    frf = exact_frf(robot, configurations, FREQUENCY_HZ, delay_s=1e-3, relative_noise=0.005, seed=1)
    chosen = ElasticOptions(strategy=strategy, starts=21, start_decades=2.0, **options)
    problem = set_up(two_joint_robot(), frf, chosen, 1e-3)[0]
    return make_strategy(problem, two_joint_robot(), chosen)


def costs_of(strategy):
    ends = [strategy.descend(start) for start in draw_starts(strategy.problem.parameters, strategy.options)]
    return np.array([end.cost for end in ends])


@pytest.mark.parametrize("estimator", ["lls", "llsm", "nls"])
def test_starts_two_decades_away_reach_the_best_minimum(estimator):
    free = ("stiffness", "damping")
    staged = costs_of(strategy_of(free=free, estimator=estimator))
    plain = costs_of(strategy_of("plain", free=free, estimator=estimator))
    best = min(staged.min(), plain.min())
    assert np.mean(staged < 1.01 * best) >= 0.9
    assert np.mean(plain < 1.01 * best) <= 0.7


def test_a_locked_spring_is_put_back():
    start = np.zeros(8)
    start[[2, 3]] = np.log(50), np.log(20)  # a bearing so stiff that nothing is seen of it
    free = ("stiffness", "damping")
    staged, plain = (strategy_of(name, free=free).descend(start) for name in ("staged", "plain"))
    assert plain.cost > 10 * staged.cost
    assert staged.cost == pytest.approx(strategy_of(free=free).descend(np.zeros(8)).cost, rel=1e-6)


def test_coarse_stage_has_few_lines_and_no_slow_parameters():
    many = np.random.default_rng(1).uniform(-1, 1, (20, 2))
    free = ("stiffness", "damping", "viscous", "delay", "location")
    coarse = strategy_of(configurations=many, free=free, fixed=("gear_2.damping",)).coarse
    assert set(coarse.parameters.kind_of) == {"stiffness", "damping", "viscous", "delay"}
    assert "gear_2.damping" not in coarse.parameters.names
    assert coarse.weight.any(axis=(2, 3)).sum() == 8 * 30
    assert coarse.weight[[0, -1]].any()


def test_torques_that_were_not_compensated_right_do_not_mislead_the_coarse_stages():
    robot, chosen = two_joint_robot(), ElasticOptions()
    frf = friction_frf(robot, CONFIGURATIONS, FREQUENCY_HZ, [0.08, -0.05])
    nominal = with_spring_factors(robot, 0.8)
    problem = set_up(nominal, frf, chosen, 1e-3)[0]
    strategy = make_strategy(problem, nominal, chosen)
    staged = strategy._staged(strategy.coarse, np.zeros(len(problem.parameters.names)))
    found = dict(zip(problem.parameters.names, problem.parameters.values(staged.parameters), strict=True))
    for spring in robot.springs:
        assert found[f"{spring.name}.stiffness"] == pytest.approx(spring.stiffness, rel=1e-2)


@pytest.mark.parametrize(("names", "ways"), [
    (("bearing_1.damping",), 1), (("bearing_1.stiffness",), 6), (("bearing_1.damping", "forearm.damping"), 6),
])  # fmt: skip
def test_only_a_damper_lost_alone_is_given_up_after_one_way_back(monkeypatch, names, ways):
    strategy = strategy_of(free=("stiffness", "damping"))
    lost = np.isin(strategy.coarse.parameters.names, names)
    tried, descend = [], module._coarsely
    monkeypatch.setattr(module, "_lost", lambda *_: lost)
    monkeypatch.setattr(module, "_coarsely", lambda *given: tried.append(given) or descend(*given))
    strategy.descend(np.zeros(8))
    assert len(tried) == 1 + ways


def test_without_springs_and_dampers_there_is_no_coarse_stage():
    strategy = strategy_of(free=("viscous", "delay"))
    assert strategy.coarse is None
    assert strategy.descend(np.zeros(3)).status == "converged"


def test_everything_is_counted():
    strategy = strategy_of(free=("stiffness", "damping"))
    calls, problem = [0], strategy.problem
    for one in (problem, strategy.coarse):
        cost = one._symmetric.cost

        def counted(internal, cost=cost):
            calls[0] += 1
            return cost(internal)

        one._symmetric.cost = counted
    end = strategy.descend(np.full(8, 0.5))
    # Each accepted step asks twice, for the cost and for the normal equations there.
    assert end.evaluations < calls[0] < 2.2 * end.evaluations
    assert end.iterations < end.evaluations


def test_an_inertia_that_is_known_beforehand_is_never_lost():
    strategy = strategy_of(free=("stiffness", "motor_inertia"))
    names = strategy.coarse.parameters.names
    vanished = np.where([name.endswith("motor_inertia") for name in names], -8.0, 0.0)
    weak = replace(strategy.coarse, weight=1e-12 * strategy.coarse.weight)
    lost = module._lost(weak, vanished)
    assert {name for name, gone in zip(names, lost, strict=True) if gone} <= set(names[:4])


def fitted(agreeing, costs):
    """How many descents are made where they end at these costs."""
    made = []

    def at_cost(function, tasks):
        assert function is descend
        ends = [Minimum(task[1], costs[len(made) + place], 1, "converged", 1) for place, task in enumerate(tasks)]
        made.extend(ends)
        return ends

    tasks = [(None, np.zeros(1), False)] * len(costs)
    return [end.cost for end in _ends(at_cost, tasks, agreeing)]


def test_starts_end_once_enough_of_them_agree_on_the_best_minimum():
    assert fitted(3, [2.0, 2.0001, 2.0, 1.0, 1.0]) == [2.0, 2.0001, 2.0]
    assert fitted(3, [2.0, 2.0, 5.0, 9.0, 2.0, 1.0, 1.0]) == [2.0, 2.0, 5.0, 9.0, 2.0, 1.0, 1.0]
    assert fitted(3, [2.0, 2.0, 5.0, 9.0, 2.0, 3.0, 1.0]) == [2.0, 2.0, 5.0, 9.0, 2.0, 3.0]
    assert fitted(0, [2.0] * 7) == [2.0] * 7
    assert fitted(4, [2.0]) == [2.0]


def test_fewer_starts_that_agree_find_the_minimum_of_all():
    robot = with_spring_factors(two_joint_robot(), [1.3, 0.8, 1.2, 0.9])
    frf = exact_frf(robot, CONFIGURATIONS, FREQUENCY_HZ, delay_s=1e-3, relative_noise=0.005, seed=1)
    few, every = (
        fit_elastic(two_joint_robot(), frf, ElasticOptions(starts=12, agreeing_starts=count), 1e-3) for count in (3, 0)
    )
    assert len(few.starts.cost) < len(every.starts.cost) == 12
    np.testing.assert_allclose(few.costs.total, every.costs.total, rtol=1e-6)


def test_rounds_of_starts_go_on_where_they_were_killed(tmp_path):
    kept, made = Parts(tmp_path / "model.h5", START, "0123456789abcdef"), []

    def work_map(_function, tasks, on_done):
        ends = [Minimum(np.array([task]), task, 1, "converged", 1) for task in tasks]
        made.extend(tasks)
        for index, end in enumerate(ends):
            on_done(index, end)
        return ends

    work = Work(work_map, SimpleNamespace(advance=lambda: None), None)
    first = resuming_map(work, kept)
    assert [end.cost for end in first(descend, [1.0, 2.0])] == [1.0, 2.0]
    again = resuming_map(work, kept)
    assert [end.cost for end in again(descend, [1.0, 2.0])] == [1.0, 2.0]
    assert [end.cost for end in again(descend, [3.0, 4.0])] == [3.0, 4.0]
    assert made == [1.0, 2.0, 3.0, 4.0]
