"""What is refused before a study of external dynamics begins."""

from pathlib import Path

import pytest

from robid.errors import SettingsError
from robid.studies.settings.study import load_with_study

CONFIGS = Path(__file__).parents[4] / "configs"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("validation_hz: 5.20", "study.plants.validation_hz: S401 5.2 Hz is fitted; validate on another chirp"),
        ("band_hz: [0.01, 9]", "study.plants.band_hz: S400 ends beyond the fastest chirp that is fitted, 5.2 Hz"),
        ("band_hz: [1, 0.5]", "study.plants.band_hz: S399 must rise from a frequency above 0"),
        (
            "delay_samples: 11",
            "study.plants.max_delay_samples: S403 the true delay of 11 samples would not be searched",
        ),
        ("fit_hz: [5.2, 5.2]", "study.plants.fit_hz: S402"),
    ],
)
def test_problems_are_told_with_their_field(tmp_path, change, message):
    text = (CONFIGS / "studies/oliveira2019.yaml").read_text().replace("../robots/", f"{CONFIGS}/robots/")
    assert "plants: {" in text
    (tmp_path / "oliveira2019.yaml").write_text(text.replace("plants: {", f"plants: {{{change}, ", 1))
    with pytest.raises(SettingsError) as caught:
        load_with_study(tmp_path / "oliveira2019.yaml")
    assert message in str(caught.value)
