"""What is refused before a study of rough robot files begins."""

from pathlib import Path

import pytest

from robid.errors import SettingsError
from robid.studies.settings.study import load_with_study

ROOT = Path(__file__).parents[4]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("duration_s: [8, 10]", "duration_s: [8, 12]", "study.validated.duration_s: S432 a whole motion has 10 s only"),
        ("choose: {first: 501", "choose: {first: 8100", "study.seeds: S433 the seeds of `judge` and `choose` overlap"),
        ("poor_share: 0.35", "poor_share: 1.35", "study.validated.poor_share: S383"),
    ],
)
def test_problems_are_told_with_their_field(tmp_path, old, new, message):
    text = (ROOT / "configs/studies/rough.yaml").read_text()
    assert old in text
    text = text.replace("../", f"{ROOT}/configs/").replace(old, new, 1)
    (tmp_path / "rough.yaml").write_text(text)
    with pytest.raises(SettingsError) as caught:
        load_with_study(tmp_path / "rough.yaml")
    assert message in str(caught.value)
