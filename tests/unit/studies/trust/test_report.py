"""What is asked of which figure, and that the decision on it says the same."""

from pathlib import Path

import numpy as np

from robid.studies.settings.study import load_with_study
from robid.studies.trust.report import ASKED, bars
from robid.studies.trust.singles import SINGLE_ASKED

ROOT = Path(__file__).parents[4]


def test_every_set_has_the_bars_of_its_kind():
    study = load_with_study(ROOT / "configs" / "studies" / "trust.yaml").experiment.study
    asked = bars(study)
    of_sets = {name for name in asked if name.split(".")[0] in study.sets}
    assert of_sets == {
        *("a.effective.coverage_95", "b.effective.coverage_95", "light.effective.coverage_95"),
        *("a.physical.coverage_95", "a.physical.worst", "b.trusted_wrong"),
    }
    assert asked["light.effective.coverage_95"].lower == 0.90
    assert asked["b.effective.coverage_95"].lower == 0.92
    of_single = {f"c.{name}" for name in SINGLE_ASKED}
    assert len(asked) == len(of_sets) + 6 + len(of_single)
    bare = bars(study.model_copy(update={"linear": None, "causes": {}, "single": None}))
    assert {*asked}.difference(bare) == {
        *("linear.coverage_95", "linear.file.coverage_95", "causes.first", "causes.first_three"),
        *of_single,
    }
    assert bars(study.model_copy(update={"linear": None, "causes": {}, "sets": {}})).keys() == of_single
    of_light = {"linear": None, "causes": {}, "single": None, "sets": {"light": study.sets["light"]}}
    assert bars(study.model_copy(update=of_light)).keys() == {"light.effective.coverage_95"}  # it has no other figures


def test_the_rule_states_what_is_asked():
    (path,) = (ROOT / "docs/decisions").glob("*-the-rule-by-which-intervals-are-judged-*.md")
    rule = " ".join(path.read_text().split())
    said = {
        "effective.coverage_95": "`effective.coverage_95` | at least 0.92 pooled and for A and B each",
        "light.effective.coverage_95": "0.90 for light robots",
        "listed.physical.coverage_95": "`a.physical.coverage_95` | at least 0.90",
        "listed.physical.worst": "`a.physical.worst` | at least 0.75",
        "unlisted.trusted_wrong": "`b.trusted_wrong` | at most 0.05",
        "width_ratio": "`width_ratio` | at most 2",
        "linear.coverage_95": "`linear.coverage_95` | 0.92 to 0.98",
        "linear.file.coverage_95": "0.92 to 0.98; at least 0.92",
        "causes.first": "`causes.first`, `causes.first_three` | at least 0.8",
        "causes.first_three": "at least 0.8, 0.9",
        "c.trusted_wrong": "`c.trusted_wrong` | at most 0.05",
        "c.first": "`c.first` | at least 0.7",
        "c.first_cases": "`c.first_cases` | at least 25",
        "c.false": "`c.false` | at most 0.07",
        "c.width_ratio": "`c.width_ratio` | at most 2.5",
    }
    every = {**ASKED, **{f"c.{name}": asked for name, asked in SINGLE_ASKED.items()}}
    assert said.keys() == every.keys()
    for name, words in said.items():
        assert words in rule, name
        limit = every[name].lower if np.isfinite(every[name].lower) else every[name].upper
        assert f"{limit:g}" in words, name
