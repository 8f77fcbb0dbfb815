"""The page of benchmarks says what the record says, and the baseline is one."""

import json

from bench_tables import MEANINGS, PAGE, RECORD, ROOT, page


def test_the_page_is_that_of_the_record():
    assert PAGE.read_text(encoding="utf-8") == page(json.loads(RECORD.read_text(encoding="utf-8")))


def test_a_figure_has_its_own_meaning_beside_those_that_begin_alike():
    rows = [line.split(" | ") for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| `")]
    said = {row[0].strip("| `"): row[2] for row in rows}
    assert {key: said[key] for key in MEANINGS if key in said} == {
        key: MEANINGS[key] for key in MEANINGS if key in said
    }


def test_the_baseline_holds_each_ratio_with_its_spread():
    found = json.loads((ROOT / "tests/bench/baseline.json").read_text(encoding="utf-8"))
    assert {"frf.vs_read_fft", "simulate.vs_rollout", "cli.status_vs_floor"} <= set(found["ratios"])
    assert all(one["low"] <= one["median"] <= one["high"] for one in found["ratios"].values())
    assert {"processor", "date"} <= set(found["machine"])
