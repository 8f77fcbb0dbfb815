"""What is wrong with an external fit is told with its place."""

from dataclasses import replace
from pathlib import Path

import pytest

from robid.models.external.settings import ExternalFit, problems
from robid.models.known import load_experiment

STAGES = Path(__file__).parents[3] / "stages"
BOTH = ("estimation", "validation")


@pytest.fixture(scope="module")
def loaded():
    return load_experiment(STAGES / "small.yaml")


def told(loaded, reads="estimation", **more):
    fit = ExternalFit(family="external", **{"from": reads}, **more)
    experiment = loaded.experiment.model_copy(update={"fits": {"own": fit}})
    return [
        (".".join(str(part) for part in field), message) for field, message in problems(experiment, "own", loaded.robot)
    ]


@pytest.mark.parametrize(
    ("more", "field", "message"),
    [
        ({"poles": 2, "zeros": 2}, "zeros", "S061 is not below `poles` (2)"),
        ({"zeros": 5}, "zeros", "S061 is not below `max_poles` (5)"),
        ({"pairs": (("turm", "lift"),)}, "pairs.0", "campaign `estimation` has no input `turm`; did you mean `turn`?"),
        ({"pairs": (("turn", "lift.arm"),)}, "pairs.0", "campaign `estimation` has no output `lift.arm`"),
        ({"pairs": (("turn", "lift"), ("turn", "lift"))}, "pairs.1", "is there twice"),
        ({"choose_on": "estimation", "rule": "sufficient"}, "choose_on", "nothing is left to fit"),
        ({"choose_on": "validation"}, "choose_on", "which is none of the campaigns in `from`"),
        ({"reads": BOTH, "choose_on": "validation"}, "choose_on", "S065"),
    ],
)
def test_it_is(loaded, more, field, message):
    ((place, words),) = told(loaded, **more)
    assert place == field
    assert message in words


def test_nothing_is_wrong_with_sound_settings(loaded):
    assert told(loaded, validate_on="validation") == []
    assert told(loaded, pairs=(("turn", "lift"), ("lift", "lift")), matrix="full", delay_samples=30) == []
    assert told(loaded, reads=BOTH, choose_on="validation", rule="sufficient") == []


def test_a_period_is_asked_of_what_repeats_alone(loaded):
    campaign = loaded.experiment.campaigns["estimation"]
    assert told(loaded, start="periodic") == []
    campaigns = {**loaded.experiment.campaigns, "estimation": _OneShot(campaign)}
    experiment = loaded.experiment.model_copy(update={"campaigns": campaigns})
    ((place, words),) = told(replace(loaded, experiment=experiment), start="periodic")
    assert place == "start"
    assert "one shot" in words


class _OneShot:
    """A campaign whose samples do not repeat."""

    is_one_shot = True

    def __init__(self, campaign):
        self._campaign = campaign

    def __getattr__(self, name):
        return getattr(self._campaign, name)
