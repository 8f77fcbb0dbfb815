"""What is refused before a study of position-dependent models begins."""

from pathlib import Path

import pytest

from robid.errors import SettingsError
from robid.studies.settings.study import load_with_study

CONFIGS = Path(__file__).parents[4] / "configs"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("local: {fit: lpv}", "local: {fit: lvp}", "study.local.fit: there is no fit `lvp`; did you mean `lpv`?"),
        (", validate_on: left_out", "", "study.local.fit: fit `lpv` names no campaign in `validate_on`"),
        (
            "local: {fit: lpv}",
            "local: {fit: arm}",
            "study.local.fit: fit `arm` is of the family `elastic`, not `lpv`",
        ),
        ("fit: sliding,", "fit: slidin,", "study.global.fit: there is no fit `slidin`; did you mean `sliding`?"),
        ("uncompensated: lpv", "uncompensated: lp", "study.global.uncompensated: there is no fit `lp`; did you mean"),
        ("campaign: global", "campaign: gobal", "study.global.campaign: there is no campaign `gobal`; did you mean"),
        ("fixed: fixed}", "fixed: fix}", "study.global.fixed: there is no campaign `fix`; did you mean `fixed`?"),
    ],
)
def test_problems_are_told_with_their_field(tmp_path, old, new, message):
    text = (CONFIGS / "studies/turk2018.yaml").read_text().replace("../robots/", f"{CONFIGS}/robots/")
    assert old in text
    text = text.replace("\nfits:\n", "\nfits:\n  arm: {family: elastic, from: local}\n").replace(old, new, 1)
    (tmp_path / "turk2018.yaml").write_text(text)
    with pytest.raises(SettingsError) as caught:
        load_with_study(tmp_path / "turk2018.yaml")
    assert message in str(caught.value)


def test_campaigns_and_fit_are_those_of_the_example():
    study, example = (load_with_study(CONFIGS / name) for name in ("studies/turk2018.yaml", "ballscrew.yaml"))
    assert study.robot == example.robot
    own_fits, own = dict(study.experiment.fits), dict(study.experiment.campaigns)
    assert {name: own_fits[name] for name in example.experiment.fits} == example.experiment.fits
    assert {name: own[name] for name in example.experiment.campaigns} == example.experiment.campaigns
