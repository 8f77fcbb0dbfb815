"""What is refused of a travelling slide before the study begins."""

from pathlib import Path

import pytest

from robid.errors import SettingsError
from robid.studies.settings.study import load_with_study

CONFIGS = Path(__file__).parents[4] / "configs"
GLOBAL = "\n    source: {simulate: {<<: *simulate, seed: 3}}"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("campaign: global", "campaign: local", ".campaign: S406 campaign `local` has no `excitation.travel`"),
        (
            "realizations: 1\n    periods: 7",
            "realizations: 1\n    periods: 1",
            ".campaign: S407 campaign `global` needs at least 2 periods",
        ),
        (
            "scheduling: [slide]",
            "scheduling: [slide, slide.arm]",
            ".fit: S408 fit `sliding` has 2 scheduling parameters",
        ),
        (f", slide.arm]{GLOBAL}", f"]{GLOBAL}", ".campaign: S409 campaign `global` does not record `slide.arm`"),
        ("fixed: fixed}", "fixed: global}", ".fixed: S410 campaign `global` has no frequency response"),
        ("fixed: fixed}", "fixed: once}", ".fixed: S411 campaign `once` needs at least 2 realizations and 2 periods"),
        ("../robots/ballscrew", "../robots/kr300", ": S405 is of a drive of one joint; the robot has 6"),
    ],
)
def test_problems_are_told_with_their_field(tmp_path, old, new, message):
    text = (CONFIGS / "studies/turk2018.yaml").read_text()
    once = text[text.index("  fixed:") : text.index("  sliding:")].replace("fixed:", "once:")
    text = text.replace("\nfits:\n", once.replace("realizations: 4", "realizations: 1") + "\nfits:\n")
    assert old in text
    text = text.replace(old, new).replace("../robots/", f"{CONFIGS}/robots/")
    (tmp_path / "turk2018.yaml").write_text(text)
    with pytest.raises(SettingsError) as caught:
        load_with_study(tmp_path / "turk2018.yaml")
    assert f"study.global{message}" in str(caught.value)
