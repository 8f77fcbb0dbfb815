"""A friction law that is off is named with what to do, and what is told mends it."""

import re


def sentence(shop):
    answer = shop.robid("run", "small.yaml", "--json")
    assert answer.code == 0, answer.err
    return next(node["grade_sentence"] for node in answer.json["nodes"] if node.get("grade_sentence"))


def follow(shop, told):
    """Writes what a finding says into the experiment file."""
    period = re.search(r"`period_s: (\S+)` instead of (\S+),", told)
    if period is not None:
        shop.change(f"period_s: {period[2]}", f"period_s: {period[1]}")
    setting = re.search(r"`(compensation: silent_lines)`", told)[1]
    for _ in range(2):
        shop.change("compensation: nominal", setting)


def test_a_law_that_is_off_is_mended_as_told(shop):
    for _ in range(2):
        if "friction_relative: 0.1" in (shop.folder / "small.yaml").read_text():
            shop.change("friction_relative: 0.1", "friction_relative: 0.8")
    # A period of half a second has too few lines that stay silent; a second has enough.
    told = sentence(shop)
    assert "F021" in told
    assert "`period_s: 1`" in told
    follow(shop, told)
    assert "F021" not in sentence(shop)


def test_lines_that_are_there_are_to_be_used(shop):
    shop.change("friction_relative: 0.1", "friction_relative: 0.8")
    shop.change("period_s: 0.5", "period_s: 1")
    told = sentence(shop)
    assert "F021" in told
    assert "try `compensation: silent_lines`" in told
    assert "period_s" not in told
    follow(shop, told)
    assert "F021" not in sentence(shop)
