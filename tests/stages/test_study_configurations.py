import json
import shutil
from pathlib import Path

import pytest

_HERE = Path(__file__).parent
MODELS = ("m49", "opt2", "guess", "mirr", "optp", "low", "rand_a", "rand_b", "nonlinear")
MEASURED = {"estimation_1": 12, "validation_1": 3, "estimation_2": 12, "validation_2": 3, "again_1": 12}


def names(folder):
    return {path.name.split(".")[0] for path in folder.glob("*.h5")}


@pytest.fixture
def study(shop):
    shutil.copy(_HERE / "configurations.yaml", shop.folder)
    (shop.folder / "paper.yaml").write_text("average_cost: {opt2: 0.123}\naverage_std_above: {m49: 0.1}\n")
    object.__setattr__(shop, "runs", shop.folder / "runs" / "configurations")
    return shop


@pytest.mark.slow
def test_models_of_every_individual_are_fitted_judged_and_stepped(study):
    answer = study.robid("study", "configurations.yaml", "--json")
    assert answer.code == 0, answer.err
    summary = answer.json["summary"]
    tasks = study.runs / "tasks"
    places = {f"{name}_{number}" for name, count in MEASURED.items() for number in range(1, count + 1)}
    assert names(tasks / "responses") == places
    assert names(tasks / "models") == {f"{name}_{number}" for name in MODELS for number in (1, 2)}
    assert names(tasks / "sets") == {"rand_a_1_2", "rand_a_2_2"}
    assert names(tasks / "steps") == {"steps_1", "steps_2"}
    assert not list(tasks.glob("*.h5"))
    assert summary == json.loads((study.runs / "summary.json").read_text())
    assert summary["tasks.count"] == len(places) + 18 + 2 + 2
    for name in MODELS:
        for key in ("average_std", "average_fit_std", "average_effective_std", "scatter", "fit_scatter", "average_cost",
                    "worst_cost", "average_excess"):  # fmt: skip
            assert summary[f"{name}.{key}"] > 0
        for key in ("fit_std", "effective_std", "scatter", "fit_scatter"):
            average = summary.get(f"{name}.average_{key}", summary.get(f"{name}.{key}"))
            assert 0 < summary[f"{name}.typical_{key}"] <= average
        assert summary[f"{name}.worst_cost"] >= summary[f"{name}.average_cost"]
    assert summary["m49.average_std"] < min(summary[f"{name}.average_std"] for name in ("opt2", "guess", "mirr"))
    assert 0 <= summary["opt2.gap"] < 1e-6
    assert summary["m49.revisited_cost"] > 0
    assert 0 < summary["optp.vs_random"] < 10
    assert summary["optp.vs_random_error"] > 0
    assert summary["optp.scatter_vs_opt2"] == pytest.approx(summary["optp.scatter"] / summary["opt2.scatter"])
    assert summary["nonlinear.step_tool_rms_m"] < summary["m49.step_tool_rms_m"]
    page = (study.runs / "report.html").read_text()
    for text in (
        "Table II",
        "0.123",
        "by geometric means",
        "&gt; 10 %",
        "How long must I measure?",
        "Design optimal",
        "Fig. 6",
    ):
        assert text in page
    kept = {path: path.stat().st_mtime_ns for path in tasks.rglob("*.h5")}
    lost = next((tasks / "models").glob("guess_2.*"))
    lost.unlink()
    again = study.robid("study", "configurations.yaml")
    assert again.code == 0
    assert "17 of 18 tasks are there from an earlier run" in again.err
    assert "An average deviation of" in " ".join(again.out.split())
    assert {path for path, at in kept.items() if path.stat().st_mtime_ns != at} == {lost}


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("estimation: [estimation_1,", "estimation: [estimation_3,", "study.estimation[1]: there is no campaign"),
        ("validation: [validation_1, validation_2]", "validation: [validation_1]", "one for each"),
        ("validation: [validation_1, validation_2]", "validation: [validation_2, validation_1]", "S393"),
        ("revisited: [again_1]", "revisited: [again_1, again_1, again_1]", "one for each of the first"),
        ("revisited: [again_1]", "revisited: [validation_1]", "S392"),
        ("predictive: optp", "predictive: opt3", "there is no model `opt3`"),
        ("guess: {configurations: [3, 4]}", "guess: {configurations: [3, 30]}", "there are 12 configurations"),
        ("low: {count: 2,", "low: {count: 20,", "S395 cannot take 20 of 12 configurations"),
        ("low_torque: lift", "low_torque: lifft", "there is no joint `lifft`"),
        ("axes: [turn, lift]", "axes: [turn, lifft]", "there is no joint `lifft`"),
        ("  design: optimal\n", "  design: optimum\n", "there is no design `optimum`"),
        ("stepped: [m49, nonlinear]", "stepped: [m49, linear]", "there is no model `linear`"),
    ],
)
def test_what_cannot_be_compared_is_told_before_anything_is_made(study, old, new, message):
    study.change(old, new, "configurations.yaml")
    answer = study.robid("study", "configurations.yaml")
    assert answer.code == 2
    assert message in answer.flat
    assert not study.runs.exists()
