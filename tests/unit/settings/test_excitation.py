"""The excitation of a campaign: one section a signal, chosen by the key `signal`."""

from typing import get_args

import pytest
from pydantic import TypeAdapter, ValidationError

from robid.design.excitation.options import ChirpOptions, ExcitationOptions, FourierOptions, MultisineOptions
from robid.models.known import experiment_schema
from robid.settings.experiment import Experiment
from robid.settings.problems import validate_document
from robid.settings.sources import ExcitationSettings
from robid.settings.yaml import load_yaml

FILE = """schema_version: 1
name: test
robot: robot.yaml
campaigns:
  one:
    configurations: {random: {count: 1}}
    excitation:
"""


@pytest.fixture
def problems(tmp_path):
    def of(*lines):
        path = tmp_path / "experiment.yaml"
        path.write_text(FILE + "".join(f"      {line}\n" for line in lines))
        return [str(problem).removeprefix(f"{path}:") for problem in validate_document(Experiment, load_yaml(path))[1]]

    return of


@pytest.mark.parametrize(
    ("section", "options"),
    [
        ({}, MultisineOptions()),
        ({"count": 7, "crest_at": "reference_and_motion"}, MultisineOptions(count=7, crest_at="reference_and_motion")),
        ({"signal": "chirp", "chirp_peak": 0.5}, ChirpOptions(chirp_peak=0.5)),
        ({"signal": "fourier", "rms": [1, 2]}, FourierOptions(rms=(1.0, 2.0))),
    ],
)
def test_the_key_chooses_the_options(section, options):
    assert TypeAdapter(ExcitationSettings).validate_python(section) == options


def test_a_key_of_another_signal_is_refused_with_the_name_of_that_signal(problems):
    assert problems("signal: chirp", "phase_starts: 3", "chirp_peak: 0.5") == [
        "9: campaigns.one.excitation.phase_starts: S386 belongs to `signal: multisine`, not to `signal: chirp`"
    ]
    assert problems("at_rest: true", "period_s: 2", "chirp_peak: 0.5") == [
        "8: campaigns.one.excitation.at_rest: S386 belongs to `signal: fourier`, not to `signal: multisine`",
        "10: campaigns.one.excitation.chirp_peak: S386 belongs to `signal: chirp` or `signal: pose_chirp`, not to"
        " `signal: multisine`",
    ]


def test_a_key_that_no_signal_has_and_an_unknown_signal_are_told(problems):
    assert problems("signal: fourier", "at_rst: true") == [
        "9: campaigns.one.excitation.at_rst: S380 unknown key; did you mean `at_rest`?"
    ]
    (problem,) = problems("signal: sweep")
    assert problem.startswith("8: campaigns.one.excitation.signal: ")
    assert all(f"'{name}'" in problem for name in ("multisine", "chirp", "stepped_sine", "fourier", "sweep"))


@pytest.mark.parametrize("wrong", [{"rms": -1, "period_s": 0}, [], "chirp", None])
def test_what_is_no_excitation_is_refused(wrong):
    with pytest.raises(ValidationError):
        TypeAdapter(ExcitationSettings).validate_python(wrong)


def test_a_section_fits_one_signal_of_the_schema():
    """Without the key it fits the multisine alone, with it the one it names: what `oneOf` asks for."""
    schema = experiment_schema()
    names = [
        each["$ref"].rpartition("/")[2] for each in schema["$defs"]["Campaign"]["properties"]["excitation"]["oneOf"]
    ]
    members = [schema["$defs"][name] for name in names]
    assert names == [kind.__name__ for kind in get_args(ExcitationOptions)]
    assert [node["properties"]["signal"]["const"] for node in members if "signal" not in node.get("required", ())] == [
        "multisine"
    ]
    assert len({node["properties"]["signal"]["const"] for node in members}) == len(members)
