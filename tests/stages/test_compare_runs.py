"""`robid compare RUN RUN`: fits side by side, what their intervals allow and what not, and wrong names refused."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from robid.artifacts.results import MODEL
from robid.artifacts.store import read_artifact, write_artifact

RUN, OTHER = "runs/small", "runs/other"


@pytest.fixture
def other(done):
    """A copy of the run whose first parameter came out half as large again."""
    shutil.copytree(done.folder / RUN, done.folder / OTHER)
    path = done.folder / OTHER / "fits/elastic/model.h5"
    artifact = read_artifact(path, MODEL)
    datasets = dict(artifact.datasets)
    for name in ("value", "lower", "upper", "effective_value", "effective_lower", "effective_upper"):
        values = datasets[f"estimate/{name}"].values.copy()
        values[0] *= 1.5
        datasets[f"estimate/{name}"] = replace(datasets[f"estimate/{name}"], values=values)
    Path(path).unlink()
    write_artifact(path, replace(artifact, datasets=datasets))
    return done


def test_a_parameter_that_differs_is_named_and_the_others_agree(other):
    answer = other.robid("compare", RUN, OTHER, "--json")
    assert answer.code == 0, answer.err
    assert answer.json["type"] == "compare-runs"
    assert answer.json["runs"] == ["small", "other"]
    (pair,) = answer.json["fits"]
    assert (pair["first"]["fit"], pair["second"]["run"]) == ("elastic", "other")
    first, *others = pair["parameters"]
    assert first["differs"] is True
    assert first["relative"] == pytest.approx(0.5)
    assert not any(each["differs"] for each in others)
    assert all(each["relative"] == 0 for each in others)
    assert {each["label"] for each in answer.json["responses"]} == {"other/estimation", "other/validation"}
    assert all(each["agree"] for each in answer.json["responses"])
    assert first["name"] in answer.json["verdict"]


def test_a_table_in_the_terminal_and_a_page(other):
    answer = other.robid("compare", RUN, f"{OTHER}:elastic", "--output", "page.html")
    assert answer.code == 0, answer.err
    rows = [line for line in answer.out.splitlines() if line.rstrip().endswith((" differs", " agrees"))]
    assert sum(row.rstrip().endswith("differs") for row in rows) == 1
    assert "+50 %" in next(row for row in rows if row.rstrip().endswith("differs"))
    page = (other.folder / "page.html").read_text(encoding="utf-8")
    assert "+50 %" in page
    assert str(other.folder) not in page


@pytest.mark.parametrize(
    ("names", "code"),
    [
        ((RUN, f"{RUN}:none"), "S588"),
        ((RUN, RUN, RUN), "S587"),
        ((RUN, "small.yaml:estimation"), "S587"),
        ((RUN,), "S587"),
    ],
)
def test_names_that_are_not_two_runs_are_refused(done, names, code):
    answer = done.robid("compare", *names)
    assert answer.code == 2
    assert code in answer.err
    assert "remedy: " in answer.flat


def test_runs_without_anything_in_common_and_folders_that_are_no_run(done):
    (done.folder / "empty").mkdir()
    answer = done.robid("compare", RUN, "empty")
    assert answer.code == 3
    assert "A038" in answer.err
    renamed = done.folder / "renamed"
    shutil.copytree(done.folder / RUN / "estimation", renamed / "elsewhere")
    answer = done.robid("compare", RUN, "renamed")
    assert answer.code == 2
    assert "S586" in answer.err
