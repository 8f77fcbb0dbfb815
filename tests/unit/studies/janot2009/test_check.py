"""What is refused before a study of robust regression begins."""

from pathlib import Path

import pytest

from robid.errors import SettingsError
from robid.studies.settings.study import load_with_study

CONFIGS = Path(__file__).parents[4] / "configs"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("campaign: motion", "campaign: motoin", "study.branch.campaign: there is no campaign `motoin`"),
        (
            "{list_deg: [[0, 25, -90]]}",
            "{random: {count: 2}}",
            "study.branch.campaign: S416 campaign `motion` does not list",
        ),
        (
            "torque_noise_nm: 0.09",
            "duration_s: 2",
            "study.haptic.duration_s: S415 filters at 20 Hz leave fewer than 100",
        ),
        ("torque_noise_nm: 0.09", "bad_cut_hz: 20", "study.haptic.bad_cut_hz: S413"),
        ("harmonics: 12", "bad_cut_hz: 250", "study.branch.bad_cut_hz: S414 must lie below 250 Hz"),
    ],
)
def test_problems_are_told_with_their_field(tmp_path, old, new, message):
    text = (CONFIGS / "studies/janot2009.yaml").read_text()
    assert old in text
    text = text.replace("../robots/", f"{CONFIGS}/robots/").replace(old, new)
    (tmp_path / "janot2009.yaml").write_text(text)
    with pytest.raises(SettingsError) as caught:
        load_with_study(tmp_path / "janot2009.yaml")
    assert message in str(caught.value)


def test_a_branch_needs_a_controller(tmp_path):
    robot = (CONFIGS / "robots/branch.yaml").read_text()
    kept = [line for line in robot.splitlines(keepends=True) if not line.startswith("controller:")]
    (tmp_path / "branch.yaml").write_text("".join(kept))
    text = (CONFIGS / "studies/janot2009.yaml").read_text().replace("../robots/", "")
    (tmp_path / "janot2009.yaml").write_text(text)
    with pytest.raises(SettingsError, match="S412"):
        load_with_study(tmp_path / "janot2009.yaml")
