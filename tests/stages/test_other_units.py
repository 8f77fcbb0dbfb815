"""Numbers that look like another unit's: told by every command, and nothing else changes."""


def test_radians_in_place_of_degrees_are_a_warning_with_the_number(shop):
    text = (shop.folder / "small.yaml").read_text()
    assert "warning" not in shop.robid("status", "small.yaml").err
    assert shop.robid("status", "small.yaml", "--json").json["warnings"] == []
    assert "list_deg: [[20, 30]]" in text
    (shop.folder / "small.yaml").write_text(text.replace("[[20, 30]]", "[[0.7854, -1.5708]]"))
    answer = shop.robid("status", "small.yaml")
    assert answer.code == 0
    assert "-90 deg" in answer.flat
    (told, *_) = shop.robid("status", "small.yaml", "--json").json["warnings"]
    assert "list_deg" in told
    assert "warning: " in shop.robid("design-excitation", "small.yaml", "--campaign", "validation").err
