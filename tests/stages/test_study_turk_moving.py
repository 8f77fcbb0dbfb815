"""The study of a travelling slide through the chain: a ball screw without friction, short periods and few lines."""

import json
import shutil
from pathlib import Path

import pytest
from ruamel.yaml import YAML

from robid.cli import run_command

ROOT = Path(__file__).parents[2]
CAMPAIGNS = {"local": [[-0.3], [0.0], [0.3]], "choosing": [[0.15]], "global": [[0.0]], "fixed": [[0.0]]}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """The study's own file with the travelling slide alone."""
    folder = tmp_path_factory.mktemp("moving")
    data = YAML(typ="safe").load((ROOT / "configs/studies/turk2018.yaml").read_text())
    shutil.copy(ROOT / "data/turk2018.yaml", folder / "paper.yaml")
    data["robot"] = str(ROOT / "configs/robots/ballscrew.yaml")
    data["campaigns"] = {name: data["campaigns"][name] for name in CAMPAIGNS}
    for name, places in CAMPAIGNS.items():
        campaign = data["campaigns"][name]
        campaign |= {"realizations": 2, "periods": 2, "configurations": {"list": places}}
        campaign["excitation"] |= {"period_s": 1.024, "low_hz": 12, "count": 60, "spacing": "linear", "rms": 3}
        campaign["source"]["simulate"]["imperfections"] = {"torque_noise_nm": 0.8}
    data["campaigns"]["global"] |= {"realizations": 1}
    data["campaigns"]["global"]["excitation"]["travel"]["amplitude_m"] = 0.2
    data["fits"] = {
        "lpv": {"family": "lpv", "from": ["local", "choosing"], "choose_on": "choosing", "scheduling": ["slide"]}
        | {"order": 3, "basis": {"degree": 2}, "path": {"count": 2, "smallest": 10}}
    }
    study = {"fit": "lpv", "campaign": "global", "fixed": "fixed"}
    data["study"] = {"kind": "turk2018", "global": study, "paper": "paper.yaml"}
    data["execution"] = {"backend": "serial"}
    YAML().dump(data, folder / "moving.yaml")
    assert run_command(["study", str(folder / "moving.yaml"), "--run-dir", str(folder / "run")]) == 0
    return folder


@pytest.mark.slow
def test_the_fitted_model_follows_the_slide(folder):
    summary = json.loads((folder / "run/summary.json").read_text())
    assert summary["global.ratio_mismatch_percent"] <= 15
    for output in ("slide", "slide.arm"):
        assert summary[f"global.ratio_mismatch_percent.{output}"] <= summary["global.ratio_mismatch_percent"]
        assert summary[f"global.unmoved_mismatch_percent.{output}"] > 30
        assert summary[f"global.true_error_percent.{output}"] < 10
        assert 1 / 2 < summary[f"global.total_over_noise.{output}"] < 1


@pytest.mark.slow
def test_its_page_says_why_ratios_need_not_agree(folder):
    page = (folder / "run/report.html").read_text()
    for text in ("While the slide travels", "need not agree", "2.76", "2.90", "error of the true drive"):
        assert text in page
