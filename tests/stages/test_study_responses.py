"""The study of fits to responses, with few plants: its figures are counts of its tasks, and it goes on where it was."""

from pathlib import Path

import pytest

from robid.studies.responses.plants import KINDS

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_few_plants_of_each_kind(shop):
    text = (ROOT / "configs/studies/responses.yaml").read_text()
    text = text.replace("plants: 100, plants_per_task: 10", "plants: 2, plants_per_task: 1")
    text = text.replace("../robots/geared_drive.yaml", "arm.yaml").replace("[[0]]", "[[0, 0]]")
    (shop.folder / "responses.yaml").write_text(text)
    answer = shop.robid("study", "responses.yaml", "--json")
    assert answer.code in (0, 5), answer.err
    summary = answer.json["summary"]
    assert summary["tasks.count"] == 2 * len(KINDS)
    each = [summary[f"response.{kind}.order"] for kind in KINDS]
    assert summary["response.order"] == pytest.approx(sum(each) / len(each))
    assert summary["response.worst_order"] == min(each)
    assert 0.8 < summary["response.coverage"] <= 1
    assert shop.robid("study", "responses.yaml", "--json").json["summary"] == summary
