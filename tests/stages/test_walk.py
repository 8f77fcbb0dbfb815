"""The walk of the documentation, from a log to the report, is followed word by word."""

import json
import re
import shlex
import shutil
from pathlib import Path

import pytest

from robid.artifacts.truth import read_truth
from settings_tables import ROOT

PAGE = ROOT / "docs/tutorials/log_to_report.md"
FENCE = re.compile(r"^```(\w*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def blocks(title):
    """Language and text of the code of a part of the page."""
    part = PAGE.read_text(encoding="utf-8").partition(f"\n## {title}\n")[2]
    return FENCE.findall(re.split(r"^##+ ", part, maxsplit=1, flags=re.MULTILINE)[0])


class Reader:
    """Does what the page says, in a folder of its own."""

    def __init__(self, shop):
        self.shop, self.names = shop, {}
        (shop.folder / "robots").mkdir()
        shutil.copy(ROOT / "configs/robots/motor_bench.yaml", shop.folder / "robots")

    def follow(self, title, skip=""):
        found = [(language, text) for language, text in blocks(title) if not skip or skip not in text]
        assert found, title
        for language, text in found:
            if language == "yaml":
                name = re.match(r"# (\w+\.yaml)\n", text)[1]
                (self.shop.folder / name).write_text(text, encoding="utf-8")
            elif language == "python":
                exec(compile(text, str(PAGE), "exec"), self.names)  # the page's own code
            else:
                for line in text.splitlines():
                    _, *arguments = shlex.split(line)
                    answer = self.shop.robid(*arguments)
                    assert answer.code == 0, (line, answer.err)


@pytest.fixture(scope="module")
def walked(tmp_path_factory, workshop):
    with pytest.MonkeyPatch.context() as monkeypatch:
        reader = Reader(workshop(tmp_path_factory.mktemp("walk"), monkeypatch))
        reader.follow("Make the logs", skip="rosbags")
        reader.follow("Look at it")
        yield reader


@pytest.mark.usefixtures("walked")
def test_the_table_is_drawn_and_its_responses_are_reported():
    page = Path("bench.html").read_text(encoding="utf-8")
    assert "load_angle [deg]" in page
    assert "check: sign by" in page
    assert Path("runs/from_csv/report.html").is_file()
    proposal = Path("from_csv.yaml").read_text(encoding="utf-8")
    assert "{period_s: 1, low_hz: 5, high_hz: 200, lines: all, grid: full}" in proposal
    assert "not stated" not in proposal


def test_the_fit_finds_the_drive_that_was_simulated(walked):
    walked.follow("Fit a model")
    found = json.loads(Path("runs/csv_model/summary.json").read_text(encoding="utf-8"))
    truth = read_truth(Path("runs/bench/played/truth.json"), Path("runs/bench/played/record.h5"))
    true = truth.robot.springs[0].stiffness
    assert abs(true / 500 - 1) > 0.02
    assert abs(found["fits.two_mass.parameters.coupling.stiffness.estimate"] / true - 1) < 0.01


def test_the_mat_file_is_imported_with_the_sign_of_its_load(walked):
    walked.follow("The MAT file and the bag", skip="bag")
    proposal = Path("from_mat.yaml").read_text(encoding="utf-8")
    assert re.search(r"variable: log.phi_l, unit: rad, sign: -1\} # check: ", proposal)
    assert "normalised: true" in proposal
    assert Path("runs/from_mat/report.html").is_file()


def test_the_bag_is_imported_by_the_names_of_its_joints(walked):
    pytest.importorskip("rosbags", reason="the extra `ros` is not installed")
    walked.follow("Make the logs", skip="record")
    walked.follow("The MAT file and the bag", skip="mat")
    proposal = Path("from_bag.yaml").read_text(encoding="utf-8")
    assert '"/joint_states.effort[drive]"' in proposal
    assert Path("runs/from_bag/report.html").is_file()
