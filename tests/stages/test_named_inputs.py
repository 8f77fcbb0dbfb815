"""A chain of `--input` and `--output` works to its end, in the run folder and elsewhere."""

import shutil

import pytest

from robid.artifacts.artifact import Provenance
from robid.artifacts.store import read_header


def other(done, *parts):
    """A file of another run, beside the run folder."""
    folder = done.folder / "other"
    if not folder.exists():
        shutil.copytree(done.runs, folder)
    return str(folder.joinpath(*parts))


def test_a_fit_to_a_named_response_is_validated(done):
    named = other(done, "validation", "frf.h5")
    assert done.robid("fit", "small.yaml", "--input", named, "--force").code == 0
    status, why = done.states()["fits/elastic/model.h5"]
    assert (status, "estimation/frf.h5" in why, "named" in why) == ("stale", True, True)
    model = done.runs / "fits/elastic/model.h5"
    assert read_header(model).provenance.named == ["frf"]
    answer = done.robid("validate", "small.yaml", "--force")
    assert answer.code == 0, answer.err
    assert done.robid("validate", "small.yaml").out.endswith("to do\n")
    own = read_header(done.runs / "fits/elastic/validation.h5").provenance
    assert own.inputs["model"] == read_header(model).content_sha256
    # A page shows model and data beside each other, which do not belong together here; a run makes both again.
    done.refuse(3, "A019", "named", command=("report", "small.yaml", "--force"))
    answer = done.robid("run", "small.yaml", "--json")
    assert answer.code == 0, answer.err
    made = {node["output"] for node in answer.json["nodes"] if node["outcome"] == "made"}
    assert made == {"fits/elastic/model.h5", "fits/elastic/validation.h5"}
    assert {status for status, _ in done.states().values()} == {"fresh"}


def test_settings_that_changed_are_no_named_input(done):
    named = other(done, "validation", "frf.h5")
    assert done.robid("fit", "small.yaml", "--input", named, "--force").code == 0
    done.change("starts: 2", "starts: 1")
    done.refuse(3, "A019", "settings changed", command=("validate", "small.yaml", "--force"))


def test_what_is_named_but_the_same_is_fresh(done):
    named = other(done, "estimation", "frf.h5")
    assert done.robid("fit", "small.yaml", "--input", named, "--force").code == 0
    assert done.states()["fits/elastic/model.h5"] == ("fresh", "")


def test_a_chain_elsewhere_needs_no_run_folder(done):
    excitations = {name: other(done, name, "excitation.h5") for name in ("estimation", "validation")}
    shutil.rmtree(done.runs)
    for name, excitation in excitations.items():
        owner, place = ("--campaign", name), f"{name}_out"
        made = {kind: f"{place}/{kind}.h5" for kind in ("record", "frf")}
        steps = (
            ("simulate-or-acquire", "small.yaml", *owner, "--input", excitation, "--output", made["record"]),
            ("estimate-frf", "small.yaml", *owner, "--input", made["record"], "--output", made["frf"]),
        )
        for step in steps:
            assert done.robid(*step).code == 0
    fit = done.robid("fit", "small.yaml", "--input", "estimation_out/frf.h5", "--output", "model.h5")
    assert fit.code == 0, fit.err
    inputs = [f"{place}_out/{kind}.h5" for place in ("validation", "estimation") for kind in ("record", "frf")]
    # Each is taken for what it says that it is, in whatever order; a response that no validation reads is refused.
    inputs.remove("estimation_out/frf.h5")
    named = [part for path in ("model.h5", "estimation_out/truth.json", *inputs) for part in ("--input", path)]
    answer = done.robid("validate", "small.yaml", *named, "--output", "validation.h5", "--json")
    assert answer.code == 0, answer.err
    assert not done.runs.exists()
    made_from = read_header(done.folder / "validation.h5").provenance.inputs
    hashes = {path: read_header(done.folder / path).content_sha256 for path in inputs}
    assert made_from["seen_estimation"] == made_from["true_record"] == hashes["estimation_out/record.h5"]
    assert made_from["new_record"] == hashes["validation_out/record.h5"]
    assert made_from["frf"] == hashes["validation_out/frf.h5"]


def test_an_artifact_that_may_be_either_is_refused(done):
    record = other(done, "estimation", "record.h5")
    done.change("  estimation:\n", "  first:\n")
    for old in ("campaign: estimation", "from: estimation"):
        if old in (done.folder / "small.yaml").read_text():
            done.change(old, old.replace("estimation", "first"))
    done.refuse(2, "S513", command=("validate", "small.yaml", "--input", record))


def test_artifacts_of_before_say_nothing_of_names():
    assert Provenance("fit").named == []


@pytest.mark.parametrize("stage", ["fit", "validate"])
def test_what_a_stage_does_not_read_is_refused(done, stage):
    done.refuse(2, "S008", "frf.h5", command=(stage, "small.yaml", "--input", str(done.runs / "designs/best.h5")))
