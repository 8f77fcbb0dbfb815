"""`robid compare`: from experiments and files to a table, JSON and a page; wrong names and unlike responses refused."""

import pytest

from robid.artifacts.artifact import Provenance
from robid.artifacts.kinds import FRF, frf_from_artifact, frf_to_artifact
from robid.artifacts.store import read_artifact, write_artifact

PATH = "runs/small/estimation/frf.h5"


def rewritten(done, name, change):
    """A copy of the response, changed."""
    frf = frf_from_artifact(read_artifact(done.folder / PATH, FRF))
    write_artifact(done.folder / name, frf_to_artifact(change(frf), Provenance(stage="estimate-frf")))
    return name


def scaled(frf):
    from dataclasses import replace

    return replace(frf, response=1.1 * frf.response)


def test_a_campaign_and_its_file_are_the_same(done):
    answer = done.robid("compare", "small.yaml:estimation", PATH, "--json")
    assert answer.code == 0, answer.err
    (found,) = answer.json["comparisons"]
    assert answer.json["reference"] == "small/estimation (1)"
    assert found["label"] == "small/estimation (2)"
    assert found["agree"] is True
    assert (found["interpolated"], found["lines"]) == (None, 14)
    assert len(found["elements"]) == 4
    assert len(found["configurations"]) == 2
    assert {element["ratio"] for element in found["elements"]} == {0.0}


def test_a_change_of_size_is_told_in_a_table(done):
    other = rewritten(done, "larger.h5", scaled)
    answer = done.robid("compare", PATH, other)
    assert answer.code == 0, answer.err
    assert "larger against small/estimation, at 14 common lines, 6.00 to 78.0 Hz, in 2 configurations" in answer.out
    assert "larger differs in " in answer.out
    rows = [line.split() for line in answer.out.splitlines() if line.startswith(("turn per turn", "lift per lift"))]
    assert len(rows) == 2
    assert all(row[4:6] == ["0.83", "dB"] and row[-1] == "differs" for row in rows)


def test_the_page_is_written_left_alone_and_replaced_by_force_only(done):
    other = rewritten(done, "larger.h5", scaled)
    command = ("compare", PATH, other, "--output", "page.html")
    assert "page.html  made" in done.robid(*command).out
    page = (done.folder / "page.html").read_text()
    assert "small/estimation against larger" in page
    assert str(done.folder) not in page
    assert "page.html  fresh" in done.robid(*command).out
    third = ("compare", PATH, PATH, "--output", "page.html")
    assert done.robid(*third).code == 3
    assert done.robid(*third, "--force").code == 0
    # The report of a run is no comparison, nor is a comparison the report of a run.
    for path in ("runs/small/report.html", "small.yaml"):
        done.refuse(3 if path.endswith("html") else 2, command=("compare", PATH, PATH, "--output", path, "--force"))
    (done.folder / "page.html").rename(done.runs / "report.html")
    answer = done.robid("report", "small.yaml", "--force")
    assert answer.code == 3
    assert "The page" in answer.err or "no report" in answer.err


@pytest.mark.parametrize(
    ("named", "code", "words"),
    [
        (("small.yaml:estimation",), 2, "2 to 6 responses are compared, not 1"),
        ((PATH,) * 7, 2, "2 to 6 responses are compared, not 7"),
        (("small.yaml:none", PATH), 2, "has no campaign `none`; there are: `estimation`, `validation`"),
        (("small.yaml", PATH), 2, "name one of them as in `small.yaml:CAMPAIGN`"),
        (("small.yaml:candidates", PATH), 2, "has no campaign `candidates`"),
        (("nothing.yaml:estimation", PATH), 2, "nothing.yaml"),
        (("estimation", PATH), 2, "`estimation` is neither an experiment file nor a frf.h5"),
        (("nothing.h5", PATH), 3, "nothing.h5"),
        (("runs/small/estimation/record.h5", PATH), 3, "of kind `record`, but `frf` is needed"),
        ((PATH, PATH, "--output", "page.txt"), 2, "must end with .html"),
        ((PATH, "runs/small/validation/frf.h5"), 4, "D007 none of the 2 and 1 configurations is at the same"),
    ],
)
def test_what_cannot_be_compared_is_said(done, named, code, words):
    done.refuse(code, words, command=("compare", *named))


def test_other_units_are_refused_by_name(done):
    from dataclasses import replace

    def angles(frf):
        outputs = tuple(replace(one, quantity="angle", unit="rad") for one in frf.output_channels)
        return replace(frf, output_channels=outputs)

    other = rewritten(done, "angles.h5", angles)
    words = "D008 output `turn` is motor acceleration [rad/s^2] in the first, but motor angle [rad] in the second"
    done.refuse(4, words, "small/estimation (the first)", command=("compare", PATH, other))


def test_a_response_that_is_not_there_names_the_command(shop):
    command = ("compare", "small.yaml:estimation", "small.yaml:validation")
    answer = shop.robid(*command)
    assert answer.code == 3
    assert "robid estimate-frf small.yaml --campaign estimation" in answer.flat
