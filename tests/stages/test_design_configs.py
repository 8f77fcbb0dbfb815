"""Choices of configurations through the command line: measured and assumed information, priors, costs, bad input."""

import itertools
import shutil
from dataclasses import replace

import numpy as np
import pytest

from robid.artifacts.kinds import DESIGN, FRF, design_from_artifact, frf_from_artifact
from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact
from robid.design.configurations.measured import measured_information
from robid.models.elastic.files import solution_from_artifact
from robid.models.elastic.fit.fitting import set_up
from robid.models.elastic.fit.options import ElasticOptions, Weights
from robid.models.elastic.fit.solution import fitted_delay_s, fitted_robot
from robid.models.elastic.fit.uncertainty import sandwich
from robid.models.elastic.fit.weights import make_weights
from robid.models.known import load_experiment
from tolerances import IDENTITY

FILE = "design.yaml"
BEST = "best: {campaign: candidates, count: 2, information: measured, free: [stiffness]}"
SPRINGS = ("gear_turn.stiffness", "gear_lift.stiffness")


@pytest.fixture(scope="session")
def chosen_runs(tmp_path_factory, design_shop):
    folder = tmp_path_factory.mktemp("chosen")
    with pytest.MonkeyPatch.context() as monkeypatch:
        answer = design_shop(folder, monkeypatch).robid("run", "design.yaml")
    assert answer.code == 5, answer.err  # fit `earlier` misses its data
    return folder / "runs"


@pytest.fixture
def chosen(tmp_path, monkeypatch, chosen_runs, design_shop):
    """A folder with the design experiment and its finished run."""
    shutil.copytree(chosen_runs, tmp_path / "runs")
    return design_shop(tmp_path, monkeypatch)


@pytest.fixture
def fresh(tmp_path, monkeypatch, design_shop):
    """A folder with the design experiment, not run yet."""
    return design_shop(tmp_path, monkeypatch)


def design_of(shop, name):
    return design_from_artifact(read_artifact(shop.runs / f"designs/{name}.h5", DESIGN))


def information_at(shop, robot=None, delay_s=None):
    loaded = load_experiment(shop.folder / "design.yaml")
    frf = frf_from_artifact(read_artifact(shop.runs / "candidates/frf.h5", FRF))
    found = loaded.robot.to_robot() if robot is None else robot
    return measured_information(found, frf, 1e-3 if delay_s is None else delay_s, kinds=("stiffness",))


def test_measured_information_is_that_of_the_whole_response(chosen):
    matrices, names = information_at(chosen)
    design = design_of(chosen, "best")
    assert design.parameter_names == names == SPRINGS
    np.testing.assert_allclose(design.information, matrices, rtol=1e-8)


def test_no_pair_of_candidates_tells_more_than_the_chosen_one(chosen):
    design = design_of(chosen, "best")
    np.testing.assert_allclose(design.between_relative_std, 0.02)
    told = np.linalg.inv(np.linalg.inv(design.information) + 0.02**2 * np.eye(2))
    worths = {pair: np.linalg.slogdet(told[list(pair)].sum(axis=0))[1] for pair in itertools.combinations(range(6), 2)}
    assert tuple(design.chosen) == max(worths, key=worths.__getitem__)
    np.testing.assert_array_equal(design.counts[design.chosen], 1)


def test_what_the_command_prints_and_what_json_holds(chosen):
    design = design_of(chosen, "best")
    answer = chosen.robid("design-configs", "design.yaml", "--design", "best", "--force")
    for text in ("Chosen configurations", "Certified gap", "half of the realizations choose", "Measure next", *SPRINGS):
        assert text in answer.out
    told = chosen.robid("design-configs", "design.yaml", "--design", "best", "--json").json["design"]
    assert [row["candidate"] - 1 for row in told["chosen"]] == design.chosen.tolist()
    assert {unit for row in told["chosen"] for unit in row["units"]} == {"deg"}
    np.testing.assert_allclose(
        [row["positions"] for row in told["chosen"]], np.rad2deg(design.configurations[design.chosen]), rtol=IDENTITY
    )
    assert told["predicted_relative_std"] == dict(zip(SPRINGS, design.predicted_relative_std.tolist(), strict=True))
    assert told["gap"] <= 1e-8
    assert len(told["stability"]["kept"]) == 6
    assert told["next_best"][0]["candidate"] == int(np.argmax(design.gain)) + 1


def test_the_next_configuration_adds_most_to_an_earlier_fit(chosen):
    """What is known is the covariance that the fit states, misfit and all."""
    solution = solution_from_artifact(read_artifact(chosen.runs / "fits/earlier/model.h5", MODEL))
    places = [solution.estimate.names.index(name) for name in SPRINGS]
    assert solution.misfit > 1.5, "else a misfit that counts twice would not show"
    known = np.linalg.inv(solution.internal.covariance[np.ix_(places, places)])
    robot = fitted_robot(load_experiment(chosen.folder / "design.yaml").robot.to_robot(), solution.estimate)
    matrices, _ = information_at(chosen, robot, fitted_delay_s(solution.estimate, 1e-3))
    gain = [np.linalg.slogdet(known + each)[1] - np.linalg.slogdet(known)[1] for each in matrices]
    design = design_of(chosen, "next")
    np.testing.assert_allclose(design.gain, gain, rtol=1e-8)
    assert design.chosen.tolist() == [int(np.argmax(gain))]
    together = np.linalg.inv(known + matrices[design.chosen[0]])
    np.testing.assert_allclose(design.predicted_relative_std, np.sqrt(np.diag(together)), rtol=1e-8)


def test_what_an_earlier_fit_found_between_configurations_is_allowed_for(chosen):
    solution = solution_from_artifact(read_artifact(chosen.runs / "fits/places/model.h5", MODEL))
    places = [solution.estimate.names.index(name) for name in SPRINGS]
    between = solution.effective.between_std[places]
    assert between.max() > 0
    design = design_of(chosen, "spread")
    matrices, _ = information_at(chosen)
    whole = sum(
        np.linalg.inv(np.linalg.inv(design.counts[index] * matrices[index]) + np.diag(between**2))
        for index in design.chosen
    )
    np.testing.assert_allclose(design.predicted_relative_std, np.sqrt(np.diag(np.linalg.inv(whole))), rtol=1e-6)
    answer = chosen.robid("design-configs", FILE, "--design", "spread", "--force")
    assert "Between" in answer.out
    told = chosen.robid("design-configs", FILE, "--design", "spread", "--json").json["design"]
    assert told["between_relative_std"] == dict(zip(SPRINGS, between.tolist(), strict=True))


def test_a_design_is_stale_with_the_fit_that_tells_what_differs(chosen):
    chosen.change(
        "weights: {kind: optimal}, free: [stiffness], correct_torques: false}\nexecution",
        "free: [stiffness]}\nexecution",
        file=FILE,
    )
    states = chosen.states()
    assert {name for name in states if "designs" in name and states[name][0] == "stale"} == {"designs/spread.h5"}


def test_a_fit_of_one_place_does_not_tell_what_differs(chosen):
    chosen.change("between: places", "between: later", file=FILE)
    refused(
        chosen,
        4,
        "designs.spread: between",
        "D194",
        "state `between_relative_std`",
        command=("design-configs", FILE, "--design", "spread", "--force"),
    )


def test_a_fit_with_its_own_weights_is_never_better_than_the_best_weights(chosen):
    fitted, best = design_of(chosen, "fitted"), design_of(chosen, "best")
    assert fitted.efficiency < best.efficiency <= 1 + 1e-9
    assert all(design_of(chosen, name).efficiency <= 1 + 1e-9 for name in ("named", "allowing"))
    assert fitted.stability is None
    answer = chosen.robid("design-configs", "design.yaml", "--design", "fitted", "--force")
    assert "Lost by whole numbers" not in answer.out


@pytest.mark.parametrize(
    ("name", "options"),
    [
        (
            "fitted",
            ElasticOptions(
                weights=Weights("user", off_diagonal=0.3), free=("stiffness", "viscous", "motor_inertia", "delay")
            ),
        ),
        ("named", ElasticOptions(weights=Weights("optimal"), free=("stiffness",), correct_torques=False)),
        ("allowing", ElasticOptions(weights=Weights(model_error=0.05))),
    ],
)
def test_a_design_for_a_fit_promises_what_that_fit_states(chosen, name, options):
    """Its sandwich at the robot file's values, of the wanted springs with all that the fit estimates along.

    What the robot file knows of the springs themselves is no promise of the design's.
    """
    robot = load_experiment(chosen.folder / "design.yaml").robot.to_robot()
    frf = frf_from_artifact(read_artifact(chosen.runs / "candidates/frf.h5", FRF))
    design = design_of(chosen, name)
    problem, _ = set_up(robot, frf.select(design.chosen), options, 1e-3)
    known = np.r_[np.inf, np.inf, problem.parameters.prior_std[2:]]
    problem = replace(problem, parameters=replace(problem.parameters, prior_std=known))
    if name == "fitted":
        # The scale of user weights is that of all candidates, which friction's prior is held against.
        weights = make_weights(frf, options.weights, options.residual)[0]
        problem = replace(problem, weight=weights[design.chosen])
    covariance = sandwich(problem, np.zeros(len(problem.parameters.names)))[:2, :2]
    np.testing.assert_allclose(design.predicted_relative_std, np.sqrt(np.diag(covariance)), rtol=1e-5)


def test_a_design_is_stale_with_the_weights_of_its_fit(chosen):
    chosen.change("{kind: optimal}", "{kind: inflated}", file=FILE)
    states = chosen.states()
    assert states["designs/named.h5"][0] == "stale"
    assert states["designs/fitted.h5"][0] == "fresh"


def test_a_design_is_stale_with_what_its_fit_estimates(chosen):
    chosen.change("weights: {model_error: 0.05}", "weights: {model_error: 0.05}, fixed: [delay]", file=FILE)
    states = chosen.states()
    assert states["designs/allowing.h5"][0] == "stale"
    assert states["designs/named.h5"][0] == "fresh"


def test_all_designs_are_stale_with_what_is_known_of_motor_inertias(chosen):
    chosen.change("inertia_kgm2: 0.002", "inertia_relative_std: 0.1\n      inertia_kgm2: 0.002", file="arm.yaml")
    # Where a design does not estimate them along, they are what its fit may lack.
    states = {name: state for name, (state, _) in chosen.states().items() if name.startswith("designs/")}
    assert len(states) >= 6
    assert {*states.values()} == {"stale"}


def test_a_fit_that_fixes_what_a_design_estimates_along_has_it_fixed_there(chosen):
    before = design_of(chosen, "allowing").predicted_relative_std
    chosen.change(
        "weights: {model_error: 0.05}",
        "weights: {model_error: 0.05}, fixed: [turn.motor_inertia, lift.motor_inertia, gear_turn.stiffness]",
        file=FILE,
    )
    assert chosen.robid("design-configs", "design.yaml", "--design", "allowing", "--force").code == 0
    after = design_of(chosen, "allowing")
    assert after.parameter_names == SPRINGS
    assert np.prod(after.predicted_relative_std) < np.prod(before)


def test_visits_cost_experiments_and_the_way_from_the_first_candidate(chosen):
    design = design_of(chosen, "assumed")
    # 4 realizations of 2 experiments of 2 + 2 periods; joints reach 400/100 rad/s, half of it on the way.
    way = np.abs(design.configurations - design.configurations[0]).max(axis=1) / 2
    np.testing.assert_allclose(design.cost_s, 4 * 2 * (2 + 2) * 0.5 + way, rtol=IDENTITY)
    assert design.counts.sum() <= 5
    assert design.counts @ design.cost_s <= 5 * design.cost_s.mean() * (1 + 1e-9)
    assert len(design.stability.kept) == 3


def test_the_report_shows_every_design(chosen):
    page = (chosen.runs / "report.html").read_text()
    for text in ("Design best", "Design next", "Chosen configurations", "Information per parameter"):
        assert text in page


def test_a_measured_design_is_stale_with_its_responses(chosen):
    chosen.change("torque_noise_nm: 0.02", "torque_noise_nm: 0.03", file=FILE)
    states = chosen.states()
    assert states["designs/best.h5"][0] == "stale"
    assert states["designs/assumed.h5"][0] == "fresh"


def refused(shop, code, *texts, command=("run", "design.yaml")):
    answer = shop.robid(*command)
    assert answer.code == code, answer.err
    assert "Traceback" not in answer.err
    for text in ("remedy: ", *texts):
        assert text in answer.flat, answer.err


@pytest.mark.parametrize(
    ("design", "texts"),
    [
        ("best: {campaign: candidates, count: 7}", ("designs.best.count", "S160 cannot choose 7 of the 6")),
        ("best: {campaign: candidates, free: [stiffness], nuisance: [stiffness]}", ("nuisance", "name each kind once")),
        ("best: {campaign: candidates, fixed: [gear_tern.stiffness]}", ("fixed[1]", "gear_turn.stiffness")),
        ("best: {campaign: candidates, prior: earlyer}", ("designs.best.prior", "did you mean `earlier`?")),
        (
            "best: {campaign: candidates, free: [motor_inertia], prior: earlier}",
            ("designs.best.prior", "does not estimate `turn.motor_inertia`, `lift.motor_inertia`"),
        ),
        ("best: {campaign: candidates, weights: {mean: fit}}", ("weights.mean", "S162")),
        (
            "best: {campaign: candidates, information: measured, fit: earlyer, weights: {mean: fit}}",
            ("designs.best.fit", "did you mean `earlier`?"),
        ),
        (
            "best: {campaign: candidates, fit: earlier, weights: {off_diagonal: 0.3, mean: fit}}",
            ("designs.best.weights", "S164"),
        ),
        ("best: {campaign: candidates, between: earlyer}", ("designs.best.between", "did you mean `earlier`?")),
        (
            "best: {campaign: candidates, between: earlier}",
            ("designs.best.between", "does not estimate `gear_turn.damping`"),
        ),
        (
            "best: {campaign: candidates, between_relative_std: {stiffness: -1}}",
            ("designs.best.between_relative_std.stiffness",),
        ),
        ("best: {campaign: candidates, criterion: f}", ("designs.best.criterion",)),
    ],
)
def test_settings_that_cannot_be(fresh, design, texts):
    fresh.change(BEST, design, file=FILE)
    refused(fresh, 2, "design.yaml:", *texts)


def test_a_measured_design_needs_a_source(fresh):
    fresh.change(
        "    source: {simulate: {<<: *simulate, seed: 2, truth: {spring_factor: 1.3, damper_factor: 3, seed: 1}}}\n",
        "",
        file=FILE,
    )
    fresh.change(BEST, BEST.replace("candidates", "first").replace("count: 2", "count: 1"), file=FILE)
    refused(fresh, 2, "designs.best.information", "campaign `first` has no `source`", "S161")


def test_a_circle_through_a_prior_is_told(fresh):
    fresh.change("{list_deg: [[20, 30]]}", "{from: next}", file=FILE)
    refused(fresh, 2, "S168")


CHOOSE = ("design-configs", "design.yaml", "--design", "best")


@pytest.mark.parametrize(
    ("campaign", "design", "code", "texts"),
    [
        ("{list_deg: [[0, 30], [90, 30], [-90, 30]]}", "count: 1", 4, ("all alike", "more than the first axis")),
        (
            "{random: {count: 6, seed: 1}}",
            "count: 2, weights: {low_cut_hz: 500}",
            4,
            (
                "designs.best: D005 The responses of the candidates",
                "do not depend on: gear_turn.stiffness; gear_lift.stiffness",
            ),
        ),
        ("{list_deg: [[0, -50], [0, 30]]}", "count: 1", 2, ("out of reach", "configuration 1: it reaches")),
        (
            "{random: {count: 6, seed: 1}}",
            "count: 2, cost: travel, budget: 1",
            2,
            ("designs.best: budget: S024 The budget of 1 does not pay 2",),
        ),
    ],
)
def test_candidates_that_cannot_be_chosen_from(fresh, campaign, design, code, texts):
    fresh.change("controller:", "floor_m: 0\ncontroller:", file="arm.yaml")
    fresh.change("{random: {count: 6, seed: 1}}", campaign, file=FILE)
    fresh.change(BEST, f"best: {{campaign: candidates, {design}}}", file=FILE)
    for name in ("next", "fitted", "named", "allowing", "assumed", "spread"):
        line = next(line for line in (fresh.folder / "design.yaml").read_text().splitlines() if f"  {name}: " in line)
        fresh.change(f"{line}\n", "", file=FILE)
    refused(fresh, code, *texts, command=CHOOSE)


@pytest.mark.parametrize(
    ("count", "texts"),
    [
        ("count: 2", ("the best 2 configurations", "Raise count")),
        ("count: 6, experiments: 2", ("the best 2 experiments", "Raise experiments")),
    ],
)
def test_fewer_configurations_than_the_parameters_need(fresh, count, texts):
    # One line and the diagonal alone: two complex numbers for four parameters and three nuisances.
    fresh.change("count: 14, rms: 6", "count: 1, rms: 6", file=FILE)
    fresh.change(BEST, f"best: {{campaign: candidates, {count}, weights: {{off_diagonal: 0}}}}", file=FILE)
    refused(fresh, 4, *texts, command=CHOOSE)


@pytest.mark.parametrize("information", ["measured", "assumed"])
def test_a_choice_for_prediction_is_the_best_of_all_pairs(chosen, information):
    """Every pair of six candidates is chosen in turn, each judged by the same command."""
    chosen.change(
        "designs:\n",
        f"designs:\n  far: {{campaign: candidates, count: 2, criterion: prediction, information: {information},"
        " free: [stiffness]}\n",
        file=FILE,
    )
    answer = chosen.robid("design-configs", FILE, "--design", "far")
    assert answer.code == 0, answer.err
    design = design_of(chosen, "far")
    by_way = {each.way: each for each in design.alternatives}
    own = design_of(chosen, "best")
    # What a design promises of its parameters is what its row says of them.
    row = next(each for each in own.alternatives if each.way == own.criterion)
    assert row.relative_std == pytest.approx(np.median(own.predicted_relative_std), rel=1e-9)
    assert row.worst_relative_std == pytest.approx(own.predicted_relative_std.max(), rel=1e-9)
    assert set(by_way) == {"d", "a", "e", "prediction", "random", "random_best", "random_worst"}
    assert by_way["prediction"].prediction_error <= min(each.prediction_error for each in design.alternatives) * 1.001
    assert design.efficiency <= 1
    assert by_way["prediction"].bias_error > 0
    told = chosen.robid("design-configs", FILE, "--design", "far", "--json").json["design"]
    assert {row["way"]: row["prediction_error"] for row in told["alternatives"]} == {
        way: each.prediction_error for way, each in by_way.items()
    }


def test_a_choice_for_prediction_is_stale_with_what_the_robot_file_may_have_wrong(chosen):
    chosen.change("designs:\n", "designs:\n  far: {campaign: candidates, count: 2, criterion: prediction}\n", file=FILE)
    chosen.robid("design-configs", FILE, "--design", "far")
    assert chosen.states()["designs/far.h5"][0] == "fresh"
    text = (chosen.folder / "arm.yaml").read_text()
    (chosen.folder / "arm.yaml").write_text(text + "\ndoubts: {mass_relative_std: 0.2}\n")
    # Of choices for parameters it is stated too how well they predict.
    assert {chosen.states()[f"designs/{name}.h5"][0] for name in ("far", "best")} == {"stale"}


def test_the_visit_after_a_fit_is_proposed_and_nothing_is_written(chosen):
    before = chosen.files()
    command = ("design-configs", FILE, "--design", "assumed", "--next", "later")
    told = chosen.robid(*command, "--json").json
    by_purpose = {row["purpose"]: row for row in told["next"]}
    assert set(by_purpose) == {"parameters", "prediction"}
    # A second configuration helps, whatever it is for; each proposal is the better one for its own purpose.
    errors = {name: row["after"]["prediction_error"] for name, row in by_purpose.items()}
    assert errors["prediction"] <= errors["parameters"]
    assert errors["prediction"] < told["now"]["prediction_error"]
    frf = frf_from_artifact(read_artifact(chosen.runs / "candidates/frf.h5", FRF))
    for row in told["next"]:
        place = np.deg2rad(row["positions"])
        np.testing.assert_allclose(frf.configurations[row["candidate"] - 1], place, atol=1e-9)
    assert chosen.files() == before
    shown = chosen.robid(*command)
    assert shown.code == 0
    assert str(by_purpose["prediction"]["candidate"]) in shown.out


def test_a_visit_is_proposed_only_after_a_fit_that_is_there(chosen):
    answer = chosen.robid("design-configs", FILE, "--design", "best", "--next", "none")
    assert answer.code == 2
    assert "places" in answer.err
    answer = chosen.robid("design-configs", FILE, "--design", "best", "--next", "places", "--force")
    assert answer.code == 2
    assert "S603" in answer.err
    shutil.rmtree(chosen.runs / "fits/places")
    answer = chosen.robid("design-configs", FILE, "--design", "best", "--next", "places")
    assert answer.code == 3
    assert "robid fit" in answer.err


def test_what_is_to_be_predicted_may_be_elsewhere(chosen):
    """The expected error is that in the named configurations: in one of the candidates, that one is chosen."""
    frf = frf_from_artifact(read_artifact(chosen.runs / "candidates/frf.h5", FRF))
    place = np.rad2deg(frf.configurations[4]).tolist()
    chosen.change(
        "designs:\n",
        "designs:\n  far: {campaign: candidates, count: 1, criterion: prediction, predict_at: there}\n",
        file=FILE,
    )
    chosen.change(
        "campaigns:\n",
        f"campaigns:\n  there:\n    configurations: {{list_deg: [{place}]}}\n"
        "    excitation: {period_s: 0.5, low_hz: 4, high_hz: 80, count: 14, rms: 6, seed: 1}\n",
        file=FILE,
    )
    answer = chosen.robid("design-configs", FILE, "--design", "far")
    assert answer.code == 0, answer.err
    assert design_of(chosen, "far").chosen.tolist() == [4]


@pytest.mark.parametrize(("name", "code"), [("nowhere", "S605"), ("later_places", "S606")])
def test_where_to_predict_must_be_stated(chosen, name, code):
    chosen.change("  best: {", f"  far: {{campaign: candidates, count: 1, predict_at: {name}}}\n  best: {{", file=FILE)
    chosen.change(
        "campaigns:\n",
        "campaigns:\n  later_places:\n    configurations: {from: best}\n"
        "    excitation: {period_s: 0.5, low_hz: 4, high_hz: 80, count: 14, rms: 6, seed: 1}\n",
        file=FILE,
    )
    answer = chosen.robid("design-configs", FILE, "--design", "far")
    assert answer.code == 2
    assert code in answer.err


@pytest.mark.parametrize("output", ["resonances", "tool_displacement", "feedforward_torque"])
@pytest.mark.parametrize("information", ["assumed", "measured"])
def test_what_is_predicted_is_what_the_choice_is_best_at(chosen, output, information):
    """No criterion and no draw gives a smaller expected error of that output than the choice for it."""
    own = f"campaign: candidates, count: 2, information: {information}, criterion: prediction"
    chosen.change("  best: {", f"  told: {{{own}, predict: {output}}}\n  best: {{", file=FILE)
    answer = chosen.robid("design-configs", FILE, "--design", "told")
    assert answer.code == 0, answer.err
    design = design_of(chosen, "told")
    errors = {each.way: each.prediction_error for each in design.alternatives}
    assert errors["prediction"] <= 1.000001 * min(errors.values())
    assert design.predict == output
    beside = np.array([each.resonance_error for each in design.alternatives])
    assert (beside > 0).all()
    if output == "resonances":
        np.testing.assert_allclose(beside, [each.prediction_error for each in design.alternatives], rtol=1e-6)


def test_resonances_that_are_not_there_are_not_predicted(chosen):
    own = "campaign: slow, count: 2, criterion: prediction, predict: resonances"
    chosen.change("  best: {", f"  told: {{{own}}}\n  best: {{", file=FILE)
    chosen.change(
        "campaigns:\n",
        "campaigns:\n  slow:\n    configurations: {random: {count: 4, seed: 1}}\n"
        "    excitation: {period_s: 5, low_hz: 1, high_hz: 3, count: 4, rms: 6, seed: 1}\n",
        file=FILE,
    )
    answer = chosen.robid("design-configs", FILE, "--design", "told")
    assert answer.code == 4
    assert "D605" in answer.err
