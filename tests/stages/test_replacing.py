"""Outputs take the place of outputs of their own kind only; a truth is the one that the record was made with."""

import json
import shutil

import pytest

FIT = ("fit", "small.yaml", "--force")


@pytest.mark.parametrize(
    ("command", "target", "what"),
    [
        (FIT, "small.yaml", "the experiment file"),
        (FIT, "arm.yaml", "the robot file"),
        (FIT, "runs/small/estimation/frf.h5", "the input `frf`"),
        (FIT, "runs/small/validation/frf.h5", "an artifact of kind `frf`"),
        (FIT, "runs/small/report.html", "no model of robid"),
        (("fit", "small.yaml"), "notes.txt", "no model of robid"),
        (FIT, "folder", "a folder in the place"),
        (
            ("estimate-frf", "small.yaml", "--campaign", "estimation", "--force"),
            "runs/small/estimation/record.h5",
            "input",
        ),
        (("report", "small.yaml", "--force"), "runs/small/fits/elastic/model.h5", "the input"),
        (("report", "small.yaml", "--force"), "page.html", "no report of robid"),
        (("export", "small.yaml", "--format", "json", "--force"), "runs/small/estimation/truth.json", "no export"),
        (("export", "small.yaml", "--format", "json", "--force"), "runs/small/summary.json", "no export"),
        (("export", "small.yaml", "--format", "mjcf", "--force"), "other.xml", "no export"),
    ],
)
@pytest.mark.parametrize("spelling", ["plain", "detour", "symlink", "hard link"])
def test_an_output_replaces_only_its_own_kind(done, command, target, what, spelling):
    (done.folder / "folder").mkdir()
    for name in ("notes.txt", "page.html", "other.xml"):
        (done.folder / name).write_text("<html>mine</html>")
    path = done.folder / target
    if spelling == "detour":
        named = done.folder / "folder" / ".." / target
    elif spelling == "plain" or path.is_dir():
        named = path
    else:
        named = done.folder / f"link{path.suffix}"
        (named.symlink_to if spelling == "symlink" else named.hardlink_to)(path)
    kept = path.read_bytes() if path.is_file() else b""
    done.refuse(3, what, "A034", command=(*command, "--output", str(named)))
    assert not path.is_file() or path.read_bytes() == kept


@pytest.mark.parametrize(
    ("form", "name"),
    [
        ("csv", "parameters.csv"),
        ("json", "parameters.json"),
        ("mjcf", "model.xml"),
        ("mat", "model.mat"),
        ("statespace", "s.npz"),
        ("statespace", "s.json"),
    ],
)
def test_an_export_replaces_one_that_was_edited(done, form, name):
    command = ("export", "small.yaml", "--format", form, "--output", name)
    assert done.robid(*command).code == 0
    path = done.folder / name
    made = path.read_bytes()
    if name == "s.npz":
        path.write_bytes(made + b"\0")
    else:
        path.write_bytes(made.rstrip() + b" \n")
    done.refuse(3, "--force", command=command)
    answer = done.robid(*command, "--force")
    assert answer.code == 0, answer.err
    assert path.read_bytes() == made


def test_files_beside_an_output_are_kept_as_well(done):
    other = done.folder / "elsewhere"
    other.mkdir()
    (other / "summary.json").write_text('{"mine": {"a": 1}}')
    command = ("report", "small.yaml", "--output", str(other / "report.html"))
    done.refuse(3, "no summary of robid", command=command)
    (other / "truth.json").write_text("[1, 2]")
    command = ("simulate-or-acquire", "small.yaml", "--campaign", "estimation", "--output", str(other / "record.h5"))
    done.refuse(3, "no truth of robid", command=command)
    assert (other / "truth.json").read_text() == "[1, 2]"


def test_an_output_of_its_own_kind_is_replaced_elsewhere(done):
    copy = done.folder / "copy.h5"
    shutil.copy(done.runs / "fits/elastic/model.h5", copy)
    answer = done.robid(*FIT, "--output", str(copy))
    assert answer.code == 0, answer.err
    assert not list(done.folder.glob("*.lock"))


def test_a_run_replaces_no_file_of_another(done):
    done.change("starts: 2", "starts: 3")
    (done.runs / "summary.json").write_text('["mine"]')
    done.refuse(3, "no summary of robid")


def test_an_unfinished_file_that_is_a_link_is_not_written_through(done):
    (done.runs / "fits/elastic/model.h5.partial").symlink_to(done.folder / "small.yaml")
    before = (done.folder / "small.yaml").read_text()
    assert done.robid(*FIT).code == 0
    assert (done.folder / "small.yaml").read_text() == before


def edit(path):
    content = json.loads(path.read_text())
    content["robot"]["springs"][0]["stiffness"] *= 1.001
    path.write_text(json.dumps(content))


@pytest.mark.parametrize("spoil", ["edited", "foreign", "folder"])
def test_a_truth_that_is_not_the_records_is_refused(done, spoil):
    truth = done.runs / "estimation" / "truth.json"
    if spoil == "edited":
        edit(truth)
    elif spoil == "foreign":
        shutil.copy(done.runs / "validation" / "truth.json", truth)
    else:
        truth.unlink()
        truth.mkdir()
    status, why = done.states()["estimation/record.h5"]
    assert (status, "truth" in why) == ("stale", True)
    for command in (("run",), ("validate", "--force"), ("report", "--force")):
        done.refuse(3, "estimation/truth.json", "truth", command=(command[0], "small.yaml", *command[1:]))
    if spoil == "folder":
        truth.rmdir()
    else:
        truth.unlink()
    answer = done.robid("run", "small.yaml", "--json")
    assert answer.code == 0, answer.err
    made = {node["output"] for node in answer.json["nodes"] if node["outcome"] == "made"}
    assert "estimation/record.h5" in made
    assert "estimation/frf.h5" not in made


def test_a_truth_named_on_the_command_line_must_be_the_records(done):
    foreign = done.folder / "truth.json"
    shutil.copy(done.runs / "estimation" / "truth.json", foreign)
    edit(foreign)
    command = ("validate", "small.yaml", "--force", "--input", str(foreign))
    done.refuse(3, "A017", command=command)


@pytest.mark.parametrize("spoil", ["no stamp", "broken stamp", "not text", "folder"])
def test_status_survives_a_damaged_report(done, spoil):
    page = done.runs / "report.html"
    if spoil == "folder":
        page.unlink()
        page.mkdir()
    elif spoil == "not text":
        page.write_bytes(b"\xff\xfe\x00" * 100)
    else:
        text = page.read_text()
        stamp = text.index('id="provenance">') + len('id="provenance">')
        page.write_text(text[:100] if spoil == "no stamp" else text[:stamp] + "{broken" + text[stamp:])
    status, why = done.states()["report.html"]
    assert status == "stale"
    assert "The page" in why
    done.refuse(3, "report.html", "move it away")
