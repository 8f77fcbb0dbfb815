from pathlib import Path

import pytest

from robid.errors import SettingsError
from robid.studies.settings.study import load_with_study

ROOT = Path(__file__).parents[3]
STAGES = ROOT / "tests/stages"


@pytest.fixture
def refused(tmp_path):
    (tmp_path / "arm.yaml").write_text((STAGES / "arm.yaml").read_text())

    def load(*changes):
        text = (STAGES / "study.yaml").read_text()
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        (tmp_path / "study.yaml").write_text(text)
        with pytest.raises(SettingsError) as found:
            load_with_study(tmp_path / "study.yaml")
        return str(found.value)

    return load


@pytest.mark.parametrize("path", sorted((ROOT / "configs/studies").glob("*.yaml")), ids=lambda path: path.stem)
def test_every_study_loads_and_is_named_like_its_file(path):
    experiment = load_with_study(path).experiment
    assert experiment.study is not None
    assert experiment.name == path.stem


def test_all_problems_are_told_at_once(refused):
    message = refused(
        ("campaign: bench", "campaign: bensch"),
        ("estimators: [logarithmic, arithmetic]", "estimators: [logarithm, arithmetic, arithmetic]"),
        ("compensations: [none, nominal]", "compensations: [zzz]\n  reference_estimator: best"),
    )
    for text in (
        "study.campaign: there is no campaign `bensch`; did you mean `bench`?",
        "study.estimators[1]: there is no `logarithm`; did you mean `logarithmic`?",
        "study.estimators[3]: `arithmetic` is there twice",
        "study.compensations[1]: there is no `zzz`; known here:",
        "study.reference_estimator: there is no `best`",
    ):
        assert text in message


@pytest.mark.parametrize(("old", "new"), [("group: 2", "group: 3"), ("group: 2", "group: 4")])
def test_groups_divide_the_realizations(refused, old, new):
    assert "study.group: S418 does not divide the 4 realizations of `bench`" in refused((old, new))


def test_only_simulated_campaigns_have_a_truth(refused):
    source = (STAGES / "study.yaml").read_text()
    simulate = source[source.index("    source:\n") : source.index("    estimate:")]
    assert "study.campaign: S389 campaign `bench` is not simulated" in refused((simulate, ""))


def test_unknown_keys_and_kinds_are_named(refused):
    assert "study.grup: S380 unknown key; did you mean `group`?" in refused(("group: 2", "grup: 2"))
    wrong = refused(("kind: frf", "kind: frequency"))
    assert (
        "study.kind: S383 input should be one of 'frf', 'wernholt2008', 'zimmermann2023', 'mistakes', 'janot2009',"
        " 'oliveira2019', 'responses', 'turk2018', 'trust', 'rough', 'encoders', 'fleet' (found 'frequency')" in wrong
    )
    assert "study.kind: S381" in refused(("  kind: frf\n", ""))


def test_a_campaign_may_not_take_the_folder_of_tasks(refused):
    assert "`tasks` is a folder of every run" in refused(
        ("  bench:\n", "  tasks:\n"), ("campaign: bench", "campaign: tasks")
    )


def test_problems_of_a_study_of_parameter_estimators_are_told_at_once(tmp_path):
    (tmp_path / "arm.yaml").write_text((STAGES / "arm.yaml").read_text())
    text = (STAGES / "estimators.yaml").read_text()
    for old, new in (
        ("wide: [lls15u]", "wide: [lls15u, lls15u, lls2]\n  reference: lls1u\n  individual_estimators: [lls1u, lls2]"),
        ("campaign: bench", "campaign: bensch"),
    ):
        assert old in text
        text = text.replace(old, new, 1)
    (tmp_path / "study.yaml").write_text(text)
    with pytest.raises(SettingsError) as found:
        load_with_study(tmp_path / "study.yaml")
    for message in (
        "study.campaign: there is no campaign `bensch`; did you mean `bench`?",
        "study.reference: `lls1u` does not use all configurations",
        "study.wide[2]: `lls15u` is there twice",
        "study.wide[3]: there is no `lls2`; did you mean `lls1u`?",
        "study.individual_estimators[1]: `lls1u` does not use all configurations",
        "study.individual_estimators[2]: there is no `lls2`",
    ):
        assert message in str(found.value)
    (tmp_path / "study.yaml").write_text(text.replace("estimator: lls,", "estimator: llls,", 1))
    with pytest.raises(SettingsError, match=r"study\.estimators\.lls15u\.estimator: .*'lls'"):
        load_with_study(tmp_path / "study.yaml")
