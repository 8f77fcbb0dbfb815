"""Sets, ties, medians and effort of the study of configurations, on figures made to measure."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import two_joint_robot
from robid.design.configurations.information import ConfigurationDesign
from robid.studies.settings.study import ModelChoice, ZimmermannStudy
from robid.studies.simulated import differs, scatter, scatter_error, scatters_differ
from robid.studies.zimmermann2023.figures import (
    Found,
    Model,
    Rivals,
    crossing,
    deviations,
    effort_curves,
    explained_springs,
    prediction_figures,
    rivals,
    summarise,
)
from robid.studies.zimmermann2023.models import further_sets, model_sets, options_of, transmission_torque
from robid.studies.zimmermann2023.report import _contradictions, _otherwise, _standing, _too_sure

N_SEED, N_CONF = 5, 6
SCATTER = np.array([0.97, 1.01, 1.0, 1.02, 0.99])
ERRORS = np.random.default_rng(3).standard_normal((N_SEED, 1, 2))


def study(**models):
    return ZimmermannStudy(
        kind="zimmermann2023",
        estimation=tuple(f"e{number}" for number in range(N_SEED)),
        validation=tuple(f"v{number}" for number in range(N_SEED)),
        design="d",
        axes=("a",),
        models={name: ModelChoice(**choice) for name, choice in models.items()},
    )


def test_models_take_listed_drawn_or_low_torque_configurations():
    chosen = study(
        m49={},
        opt2={"configurations": (5, 3)},
        rand_a={"configurations": tuple(range(2, 10)), "count": 3, "seed": 1},
        rand_b={"configurations": tuple(range(2, 10)), "count": 3, "seed": 2},
        low={"count": 2, "low_torque": "a"},
    )
    torque = {"a": np.array([5.0, -1, 4, 3, -6, 7, 0.5, 9, 9, 9])}
    sets = model_sets(chosen, torque, 10)
    assert sets["m49"] == tuple(range(10))
    assert sets["opt2"] == (3, 5)
    assert sets["low"] == (1, 6)
    assert len(set(sets["rand_a"])) == 3
    assert set(sets["rand_a"]) <= set(range(2, 10))
    assert sets["rand_a"] != sets["rand_b"]
    assert model_sets(chosen, torque, 10) == sets


def test_a_choice_adds_to_what_all_fits_free_and_fix():
    chosen = study(nonlinear={"free": ("stiffness", "cubic"), "fixed": ("gear_1.cubic",)})
    options = options_of(chosen, chosen.models["nonlinear"])
    assert options.free == ("stiffness", "viscous", "cubic")
    assert options.fixed == ("gear_1.cubic",)


def test_gravity_torque_is_the_weight_times_its_lever():
    robot = two_joint_robot()
    upright = transmission_torque(robot, robot.joints[1].name, np.array([[0.0, 0.2], [0.0, 1.3], [2.0, 0.2]]))
    first = transmission_torque(robot, robot.joints[0].name, np.array([[0.0, 0.2], [0.0, 1.3], [2.0, 0.2]]))
    assert np.abs(np.concatenate([upright, first])).max() > 1
    assert upright.shape == first.shape == (3,)


def test_a_difference_counts_only_beyond_the_scatter():
    assert not differs(SCATTER, np.ones(N_SEED))
    assert differs(1.1 * SCATTER, np.ones(N_SEED))
    assert differs(np.ones(N_SEED), 1.1 * SCATTER)
    scattered = np.array([0.5, 1.0, 2.0, 3.0, 0.7])
    assert differs(1.05 * scattered, scattered * np.array([1, 1.001, 0.999, 1, 1]))
    assert not differs(np.array([2.0]), np.array([1.0]))
    assert not differs(np.array([np.nan, 2.0]), np.ones(2))


def model(name, std, cost=1.0, used=(0, 1), stiffness=1.0, slope=None):
    ones = np.ones((N_SEED, N_CONF))
    return Model(
        name=name,
        used=used,
        wanted=("gear.stiffness", "bearing.stiffness"),
        std=std * SCATTER[:, None] * np.array([0.5, 1.5]),
        fit_std=2 * std * SCATTER[:, None] * np.array([0.5, 2]),
        effective_std=std * SCATTER[:, None] * np.ones((N_SEED, 2)),
        error=std * ERRORS,
        fit_error=3 * std * ERRORS,
        stiffness=np.full((N_SEED, 2), stiffness),
        cost=cost * ones * np.linspace(0.5, 1.5, N_CONF),
        expected=0.2 * ones,
        resonance_error=np.array([0.01, -0.02, 0.05, np.nan, 0.0, -0.2])[:, None] * np.ones((N_SEED, 1, 1)),
        slope=slope,
    )


def candidates(n_param=2, n_candidate=12):
    generator = np.random.default_rng(1)
    rows = generator.standard_normal((n_candidate, 4, n_param)) * np.array([10, 1])
    matrices = rows.swapaxes(1, 2) @ rows
    weights = np.zeros(n_candidate)
    weights[[2, 4]] = 0.5
    return ConfigurationDesign(
        weights=weights,
        gap=1e-9,
        criterion="d",
        slopes=np.ones(n_candidate),
        chosen=np.array([2, 4]),
        counts=np.zeros(n_candidate, int),
        efficiency=1.0,
        choice_efficiency=1.0,
        rounding_loss=0.0,
        gain=np.zeros(n_candidate),
        information=matrices,
        predicted_relative_std=np.ones(n_param),
        parameter_names=("gear.stiffness", "bearing.stiffness"),
        configurations=np.zeros((n_candidate, 2)),
    )


def found(**models):
    choices = study(**{name: {} for name in models}).model_copy(update={"nonlinear": "nonlinear"})
    there = np.ones((N_SEED, N_CONF, 1), bool)
    there[:, 3] = False
    design = candidates()
    effort = effort_curves(design, design.information[:2], design.parameter_names, 24)
    truth = np.ones((N_SEED, 2))
    return Found(choices, models, ("gear", "bearing"), truth, there, design, effort, (), {})


def everything(**other):
    slope = np.ones((N_SEED, N_CONF, 2))
    slope[:, :, 0] = 1 + np.arange(N_CONF)
    return {
        "m49": model("m49", 0.01, cost=1.0, used=tuple(range(N_CONF)), stiffness=3.0),
        "opt2": model("opt2", 0.03, cost=1.05, stiffness=1.5),
        "guess": model("guess", 0.04),
        "nonlinear": model("nonlinear", 0.02, cost=0.4, slope=slope),
        **other,
    }


def test_a_choice_for_prediction_is_held_against_random_sets_in_pairs():
    """Costs rise alike from one individual to the next: the paired error is that of the small differences alone."""
    rise, off = 1 + np.arange(N_SEED), 0.01 * np.array([1, -1, 0, 2, -2])
    every = everything(
        optp=replace(model("optp", 0.03), cost=np.tile((rise + off)[:, None], N_CONF)),
        **{
            f"rand_{letter}": replace(model("r", 0.03), cost=np.tile((c * rise)[:, None], N_CONF))
            for letter, c in (("a", 1), ("b", 3))
        },
    )
    held = found(**every)
    chosen = {name: ModelChoice(count=2) if name.startswith("rand") else one for name, one in held.study.models.items()}
    held = replace(held, study=held.study.model_copy(update={"models": chosen, "predictive": "optp"}))
    figures = prediction_figures(held)
    assert figures["optp.vs_random"] == pytest.approx((rise + off).mean() / (2 * rise).mean())
    difference = rise + off - 2 * rise
    assert figures["optp.vs_random_error"] == pytest.approx(
        difference.std(ddof=1) / np.sqrt(N_SEED) / (2 * rise).mean()
    )
    assert figures["optp.vs_opt2"] == pytest.approx((rise + off).mean() / held.models["opt2"].cost.mean())
    for number in range(N_SEED):
        assert figures[f"optp.cost.e{number}"] == pytest.approx((rise + off)[number])
        assert figures[f"optp.random_cost.e{number}"] == pytest.approx(2 * rise[number])
    assert prediction_figures(found(**everything())) == {}


def test_figures_are_medians_over_the_individuals():
    summary = summarise(found(**everything()))
    assert summary["opt2.average_std"] == pytest.approx(0.03)
    assert summary["opt2.average_std_low"] == pytest.approx(0.03 * 0.97)
    assert summary["opt2.worst_std"] == pytest.approx(0.045)
    assert summary["opt2.average_fit_std"] == pytest.approx(0.06 * 1.25)
    assert summary["opt2.typical_fit_std"] == pytest.approx(0.06)
    assert summary["opt2.average_effective_std"] == pytest.approx(0.03)
    assert summary["opt2.typical_effective_std"] == pytest.approx(0.03)
    apart = ERRORS.std(axis=0, ddof=1)
    assert summary["opt2.scatter"] == pytest.approx(0.03 * apart.mean())
    assert summary["opt2.typical_scatter"] == pytest.approx(0.03 * np.sqrt(np.prod(apart)))
    for scattered in ("scatter", "typical_scatter"):
        fitted = summary[f"opt2.{scattered.replace('scatter', 'fit_scatter')}"]
        assert fitted == pytest.approx(3 * summary[f"opt2.{scattered}"])
    assert summary["opt2.offset"] == pytest.approx(0.03 * np.abs(ERRORS.mean(axis=0)).mean())
    assert summary["opt2.scatter_error"] > 0
    assert summary["m49.average_cost"] == pytest.approx(1.0)
    assert summary["m49.worst_cost"] == pytest.approx(1.5)
    assert summary["m49.average_excess"] == pytest.approx(0.8)
    assert summary["opt2.over_m49_cost"] == pytest.approx(1.05)
    assert summary["opt2.gap"] == 1e-9
    assert summary["nonlinear.excess_ratio"] == pytest.approx(0.25)
    assert summary["m49.missed"] == 2
    assert summary["resonances"] == 5


@pytest.mark.parametrize("mean", ["average", "typical"])
def test_lowest_deviation_and_ties_are_told_apart(mean):
    none = Rivals((), ())
    assert rivals(found(**everything()), mean) == {"deviation": none, "scatter": none}
    tied = np.array([1.05, 0.96, 1.02, 0.97, 1.01]) / SCATTER
    near = model("mirr", 0.03)
    other = 0.03 * np.random.default_rng(4).standard_normal((N_SEED, 1, 2))
    near = Model(**{**vars(near), "fit_std": near.fit_std * tied[:, None], "error": other})
    held = rivals(found(**everything(mirr=near)), mean)
    assert held == {"deviation": Rivals((), ("mirr",)), "scatter": Rivals((), ("mirr",))}
    low = Rivals(("opt1",), ())
    assert rivals(found(**everything(opt1=model("opt1", 0.02))), mean) == {"deviation": low, "scatter": low}


def test_a_spring_that_no_data_tell_decides_one_mean_and_not_the_other():
    lost = model("guess", 0.02)
    lost = Model(**{**vars(lost), "fit_std": lost.fit_std * [0.1, 8], "error": lost.error * [0.1, 8]})
    own, none = everything(guess=lost), Rivals((), ())
    assert rivals(found(**own), "average") == {"deviation": none, "scatter": none}
    low = Rivals(("guess",), ())
    assert rivals(found(**own), "typical") == {"deviation": low, "scatter": low}


def test_scatter_is_the_deviation_about_what_all_individuals_share():
    generator = np.random.default_rng(1)
    error = 0.7 + generator.standard_normal((4000, 3, 2)) * [0.1, 0.3]
    assert scatter(error, "average") == pytest.approx(0.2, rel=0.02)
    assert scatter(error, "typical") == pytest.approx(np.sqrt(0.03), rel=0.02)
    assert np.isnan(scatter(error[:1, :1], "average"))


@pytest.mark.parametrize("mean", ["average", "typical"])
def test_scatter_is_as_uncertain_as_it_varies(mean):
    """Against the spread over many repetitions, of sets that share much of an individual's error."""
    generator = np.random.default_rng(2)

    def draw():
        return generator.standard_normal((6, 1, 8)) + 0.5 * generator.standard_normal((6, 3, 8))

    drawn = [draw() for _ in range(300)]
    found = np.array([(np.log(scatter(error, mean)), scatter_error(error, mean)) for error in drawn])
    assert found[:, 1].mean() == pytest.approx(found[:, 0].std(), rel=0.2)
    assert np.isnan(scatter_error(draw()[:2], mean))


@pytest.mark.parametrize("mean", ["average", "typical"])
def test_models_that_scatter_alike_differ_seldom_and_others_mostly(mean):
    generator = np.random.default_rng(5)
    shared = generator.standard_normal((400, 6, 1, 12))
    pairs = [(each + 0.3 * generator.standard_normal(each.shape), each) for each in shared]
    alike = [
        scatters_differ(one + 0 * other, other + 0.3 * generator.standard_normal(one.shape), mean)
        for one, other in pairs
    ]
    assert np.mean(alike) < 0.09
    apart = [scatters_differ(2 * one, other, mean) for one, other in pairs]
    assert np.mean(apart) > 0.9
    assert not scatters_differ(2 * shared[0][:2], shared[0][:2], mean)


def test_drawn_models_have_further_sets_that_share_nothing():
    pool = tuple(range(28, 49))
    choice = ModelChoice(configurations=pool, count=7, seed=3)
    first = model_sets(study(rand_a=vars(choice)), {}, 49)["rand_a"]
    sets = [first, *further_sets(choice, 49)]
    assert [len(one) for one in sets] == [7, 7, 7]
    assert sorted(index for one in sets for index in one) == list(pool)
    assert further_sets(choice, 49) == tuple(sets[1:])
    assert further_sets(ModelChoice(configurations=pool), 49) == ()
    assert further_sets(ModelChoice(count=7, low_torque="a"), 49) == ()


def test_a_part_cannot_be_better_known_than_the_whole():
    paper = {"average_std": {"opt2": 0.04, "guess": 0.2}, "average_std_above": {"m49": 0.1}}
    (told,) = _contradictions(found(**everything()), paper)
    assert "contains those of opt2, must" in told
    assert "here it does so for every spring" in told
    assert "> 10 % of it and 4.0 % of opt2" in told
    assert _contradictions(found(**everything()), {"average_std": {"m49": 0.01, "opt2": 0.04}}) == ()


def test_a_model_that_scatters_further_than_it_states_is_told():
    honest = found(**everything())
    assert _too_sure(honest, summarise(honest)) == ()
    wrong = model("m49", 0.01, used=tuple(range(N_CONF)))
    wrong = found(**everything(m49=Model(**{**vars(wrong), "error": 10 * wrong.error})))
    (told,) = _too_sure(wrong, summarise(wrong))
    assert told.startswith("m49 states too little: it scatters by")


def test_local_springs_are_held_against_the_slope_where_they_were_measured():
    explained = explained_springs(found(**everything()))
    assert set(explained) == {("m49", "gear"), ("opt2", "gear"), ("guess", "gear")}
    assert explained["m49", "gear"][1] == pytest.approx(np.full(N_SEED, 3.5))
    assert explained["opt2", "gear"][1] == pytest.approx(np.full(N_SEED, 1.5))
    summary = summarise(found(**everything()))
    assert summary["nonlinear.explains_error"] == pytest.approx(1 - 3 / 3.5)


def test_deviations_of_known_information():
    assert deviations(np.diag([4.0, 100.0])) == pytest.approx([0.3, 0.5])
    assert np.isinf(deviations(np.ones((2, 2)))).all()


def test_a_goal_is_met_between_two_counts():
    counts = np.array([10.0, 20, 40])
    assert crossing(counts, np.array([4.0, 2.0, 1.0]), 2.0) == pytest.approx(20)
    assert crossing(counts, np.array([4.0, 2.0, 1.0]), np.sqrt(8)) == pytest.approx(10 * np.sqrt(2))
    assert crossing(counts, np.array([np.inf, 2.0, 1.0]), 3.0) == 20
    assert np.isinf(crossing(counts, np.array([4.0, 2.0, 1.0]), 0.5))


def test_deviations_fall_with_the_root_of_the_experiments():
    effort = found(**everything()).effort
    visits = (effort.experiments / 24).astype(int).tolist()
    ten, twenty_eight = visits.index(14), visits.index(28)
    for name, loss in (("optimal", 0.01), ("guess", 1e-6)):  # some shares are no whole numbers
        ratio = effort.average[name][ten] / effort.average[name][twenty_eight]
        assert ratio == pytest.approx(np.sqrt(2), rel=loss)
    assert (effort.average["optimal"] <= 1.05 * effort.average["random"]).all()
    assert (effort.average["random"] <= effort.average["worst of random"]).all()
    assert "48 experiments" in effort.sentence


def test_more_visits_to_the_guess_tell_no_more_than_its_configurations_allow():
    design = replace(candidates(), between_relative_std=np.array([0.5, 2.0]))
    guess = design.information[:2]
    effort = effort_curves(design, guess, design.parameter_names, 24)
    visits = zip((9, 8), guess, strict=True)
    told = [np.linalg.inv(np.linalg.inv(count * one) + np.diag([0.25, 4.0])) for count, one in visits]
    std = np.sqrt(np.diag(np.linalg.inv(sum(told))))
    place = (effort.experiments / 24).astype(int).tolist().index(17)
    assert effort.average["guess"][place] == pytest.approx(std.mean())
    assert effort.average["guess"][-1] > np.mean([0.5, 2.0]) / np.sqrt(2)


def test_of_models_that_tie_is_said_which_lie_below():
    figures = {"opt2": 0.05, "guess": 0.03, "mirr": 0.06}
    told = _standing("opt2", "scatter", figures, Rivals((), ("guess", "mirr")))
    assert told.startswith("no model with as few configurations has surely a lower scatter than opt2 (5.00 %)")
    assert told.endswith("below it guess (3.00 %) and above it mirr")
    assert _standing("opt2", "scatter", figures, Rivals((), ("mirr",))).startswith("opt2 has the lowest scatter")
    lower = _standing("opt2", "scatter", figures, Rivals(("guess",), ("mirr",)))
    assert lower.startswith("opt2 does not have the lowest scatter (5.00 %); surely below it: guess;")
    assert _otherwise(Rivals(("guess", "mirr"), ())).endswith("surely below it: guess, mirr")
    assert not _otherwise(Rivals((), ("guess",)))
