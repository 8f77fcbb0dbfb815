"""The page of benchmarks says what the record says, and the baseline is one."""

import json

from bench_tables import PAGE, RECORD, ROOT, page


def test_the_page_is_that_of_the_record():
    assert PAGE.read_text(encoding="utf-8") == page(json.loads(RECORD.read_text(encoding="utf-8")))


def test_the_baseline_holds_each_ratio_with_its_spread():
    found = json.loads((ROOT / "tests/bench/baseline.json").read_text(encoding="utf-8"))
    assert {"frf.vs_read_fft", "simulate.vs_rollout", "cli.status_vs_floor"} <= set(found["ratios"])
    assert all(one["low"] <= one["median"] <= one["high"] for one in found["ratios"].values())
    assert {"processor", "date"} <= set(found["machine"])
