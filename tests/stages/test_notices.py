"""What is said beforehand is said once a run folder, stage by stage and run by run."""

NEWER = "robid upgrade"


def _older(shop):
    shop.change("schema_version: 2", "schema_version: 1")


def test_a_notice_is_said_by_the_first_stage_of_a_run_folder_only(shop):
    _older(shop)
    assert NEWER in shop.robid("design-configs", "small.yaml").err
    assert NEWER not in shop.robid("design-configs", "small.yaml", "--force").err
    assert NEWER not in shop.robid("design-excitation", "small.yaml", "--campaign", "estimation").err
    assert NEWER in shop.robid("design-configs", "small.yaml", "--run-dir", "elsewhere").err


def test_what_answers_in_json_has_not_said_it(shop):
    _older(shop)
    assert shop.robid("design-configs", "small.yaml", "--json").err == ""
    assert NEWER in shop.robid("design-excitation", "small.yaml", "--campaign", "estimation").err


def test_a_stage_that_has_nothing_to_do_or_nothing_to_read_says_nothing_and_leaves_no_folder(shop):
    _older(shop)
    shop.robid("fit", "small.yaml")
    assert not shop.runs.exists()
    shop.robid("design-configs", "small.yaml")
    (shop.runs / ".notices").unlink()
    assert NEWER not in shop.robid("design-configs", "small.yaml").err


def test_a_folder_that_a_killed_command_left_without_its_end_is_no_obstacle(shop):
    _older(shop)
    shop.robid("design-configs", "small.yaml")
    (shop.runs / ".notices").write_bytes(b"\xff\xfe half")
    assert NEWER in shop.robid("design-configs", "small.yaml", "--force").err
