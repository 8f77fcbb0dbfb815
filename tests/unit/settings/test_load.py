from pathlib import Path

import pytest

from robid.errors import DataError, SettingsError
from robid.models.known import load_experiment

CONFIGS = Path(__file__).parents[3] / "configs"

ROBOT = """schema_version: 1
name: arm
controller: {sampling_period_s: 1.0e-3}
joints:
  - &joint
    name: one
    dh: {}
    limits_deg: [-90, 90]
    link: {mass_kg: 1, com_m: [0, 0, 0], inertia_kgm2: {xx: 1, yy: 1, zz: 1}}
    motor: {inertia_kgm2: 1.0e-3, gear_ratio: 100, max_speed_rad_s: 300, max_torque_nm: 10}
  - {<<: *joint, name: two, limits_deg: [-45, 45]}
springs:
  - &spring {name: g1, joint: one, place: transmission, stiffness_nm_rad: 1.0e+5, damping_nms_rad: 10}
  - {<<: *spring, name: g2, joint: two}
"""

EXPERIMENT = """schema_version: 1
name: test
robot: robot.yaml
campaigns:
  candidates:
    configurations: {random: {count: 5, seed: 1}}
    excitation: &excitation {period_s: 2, low_hz: 1, high_hz: 50, count: 20}
  measured:
    configurations: {from: best}
    excitation: *excitation
    source: &source {simulate: {seed: 1}}
  fresh:
    configurations: {list_deg: [[10, 20], [-80, 40]]}
    excitation: {<<: *excitation, seed: 2}
    source: *source
designs:
  best: {campaign: candidates, count: 3}
fits:
  springs: {family: elastic, from: measured, validate_on: fresh}
"""

LOG = """source:
      acquire:
        file: log_{experiment}.mat
        format: mat
        sampling_period_s: 1.0e-3
        inputs: [{name: one, variable: u1}, {name: two, variable: u2}]
        outputs: [{name: one, variable: y1}, {name: two.arm, variable: y2}]
        references: [{name: one, variable: r1}, {name: two, variable: r2}]
    realizations: 1
    estimate: {compensation: none}
"""
REFERENCES = "[{name: one, variable: r1}, {name: two, variable: r2}]"


def _write(folder: Path, experiment: str = EXPERIMENT, robot: str = ROBOT) -> Path:
    (folder / "robot.yaml").write_text(robot, encoding="utf-8")
    path = folder / "experiment.yaml"
    path.write_text(experiment, encoding="utf-8")
    return path


def _replaced(text: str, old: str, new: str) -> str:
    assert old in text
    return text.replace(old, new, 1)


def _refused(path: Path) -> list[str]:
    with pytest.raises(SettingsError) as caught:
        load_experiment(path)
    assert caught.value.remedy
    return caught.value.what.splitlines()


@pytest.mark.parametrize("path", sorted(CONFIGS.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_example_loads_without_its_data(path, monkeypatch):
    monkeypatch.setenv("ROBID_DATA", "/nowhere")
    loaded = load_experiment(path)
    assert loaded.path == path
    assert len(loaded.robot.all_springs) >= sum(not joint.rigid for joint in loaded.robot.joints)
    if loaded.robot.model is None:
        assert len(loaded.robot.to_robot().springs) == len(loaded.robot.all_springs)
        return
    with pytest.raises(DataError, match="D215") as caught:
        loaded.robot.to_robot()
    assert "ROBID_DATA" in caught.value.remedy


def test_every_robot_is_used_by_an_example():
    examples = [*CONFIGS.glob("*.yaml"), *(CONFIGS / "studies").glob("*.yaml")]
    named = [(path, load_experiment(path).experiment.robot) for path in examples]
    used = {(path.parent / robot).resolve() for path, robot in named if robot is not None}
    assert used == {path.resolve() for path in CONFIGS.glob("**/robots/*.yaml")}


def test_merge_keys_reach_the_models(tmp_path):
    experiment = load_experiment(_write(tmp_path)).experiment
    ours, other = (experiment.campaigns[name].excitation for name in ("measured", "fresh"))
    assert (ours.count, ours.seed) == (20, 1)
    assert (other.count, other.seed) == (20, 2)


@pytest.mark.parametrize(
    ("old", "new", "line", "field", "words"),
    [
        ("period_s: 2", "periods_s: 2", 7, "campaigns.candidates.excitation.periods_s", "did you mean `period_s`?"),
        (
            "{simulate: {seed: 1}}",
            "{simulate: {truth: {sead: 1}}}",
            11,
            "campaigns.measured.source.simulate.truth.sead",
            "did you mean `seed`?",
        ),
        ("validate_on: fresh", "validates_on: fresh", 19, "fits.springs.validates_on", "did you mean `validate_on`?"),
        ("validate_on: fresh", "weights: {knd: user}", 19, "fits.springs.weights.knd", "did you mean `kind`?"),
        ("count: 3", "cuont: 3", 17, "designs.best.cuont", "did you mean `count`?"),
        ("fits:", "fit:", 18, "fit", "did you mean `fits`?"),
        (
            "count: 20",
            "count: many",
            7,
            "campaigns.candidates.excitation.count",
            "valid integer, unable to parse string as an integer (found 'many')",
        ),
        ("count: 20", "count: 0", 7, "campaigns.candidates.excitation.count", "greater than or equal to 1 (found 0)"),
        ("count: 20", "count: null", 7, "campaigns.candidates.excitation.count", "found nothing"),
        ("count: 20", "count: 20, rms: [1, x]", 7, "campaigns.candidates.excitation.rms[2]", "found 'x'"),
        ("count: 20", "count: 20, rms: x", 7, "campaigns.candidates.excitation.rms", "; or: "),
        ("count: 20", "count: 20, spacing: lin", 7, "campaigns.candidates.excitation.spacing", "'log' or 'linear'"),
        ("high_hz: 50", "high_hz: .inf", 7, "campaigns.candidates.excitation.high_hz", "finite"),
        ("family: elastic, ", "", 19, "fits.springs.family", "is missing"),
        ("family: elastic", "family: plastic", 19, "fits.springs.family", "'elastic'"),
        ("name: test", "name: ../test", 2, "name", "S385"),
        ("  fresh:\n", "  fr/esh:\n", 12, "campaigns.fr/esh", "S385"),
        (
            "{from: best}",
            "{from: best, random: {count: 2}}",
            9,
            "campaigns.measured.configurations",
            "exactly one of `list_deg`",
        ),
        ("{from: best}", "{}", 9, "campaigns.measured.configurations", "S306"),
        ("{from: best}", "{list_deg: []}", 9, "campaigns.measured.configurations.list_deg", "at least 1"),
        (
            "{simulate: {seed: 1}}",
            "{simulate: }",
            11,
            "campaigns.measured.source",
            "exactly one of `simulate`, `acquire`",
        ),
    ],
)
def test_a_wrong_field_is_told_on_its_line(tmp_path, old, new, line, field, words):
    path = _write(tmp_path, _replaced(EXPERIMENT, old, new))
    told = [text for text in _refused(path) if text.startswith(f"{path}:{line}: {field}: ")]
    assert len(told) == 1
    assert words in told[0]


@pytest.mark.parametrize(
    ("old", "new", "field", "words"),
    [
        (
            "from: best",
            "from: bets",
            "campaigns.measured.configurations.from",
            "no design `bets`; did you mean `best`?",
        ),
        ("campaign: candidates", "campaign: candidate", "designs.best.campaign", "did you mean `candidates`?"),
        (
            "source: &source",
            "experiments: 1\n    source: &source",
            "campaigns.measured.estimate.estimator",
            "use the estimator `local_periodic`",
        ),
        (
            "source: &source",
            "experiments: 1\n    estimate: {estimator: local_periodic, compensation: silent_lines}\n"
            "    source: &source",
            "campaigns.measured.estimate.compensation",
            "S188 needs a block of 2 experiments, not 1",
        ),
        (
            "source: &source",
            "experiments: 3\n    source: &source",
            "campaigns.measured.experiments",
            "S186 a block has 2 experiments",
        ),
        (
            "campaign: candidates",
            "campaign: measured",
            "campaigns.measured.configurations.from",
            "circle: measured -> measured",
        ),
        ("count: 3", "count: 6", "designs.best.count", "S160 cannot choose 6 of the 5"),
        ("from: measured", "from: measure", "fits.springs.from", "did you mean `measured`?"),
        ("validate_on: fresh", "validate_on: frech", "fits.springs.validate_on", "did you mean `fresh`?"),
        ("validate_on: fresh", "validate_on: measured", "fits.springs.validate_on", "validate on another"),
        ("from: measured", "from: candidates", "fits.springs.from", "has no `source`"),
        (
            "validate_on: fresh",
            "configurations: [0, 3]",
            "fits.springs.configurations[2]",
            "S201 there is no configuration 3 of `measured`: there are 3",
        ),
        ("validate_on: fresh", "configurations: [1, 1]", "fits.springs.configurations[2]", "there twice"),
        (
            "validate_on: fresh",
            "fixed: [g2.damping, g1.stifness]",
            "fits.springs.fixed[2]",
            "did you mean `g1.stiffness`?",
        ),
        ("validate_on: fresh", "free: [delay], fixed: [g1.damping]", "fits.springs.fixed[1]", "known here: `delay`"),
        ("from: measured", "from: [measured, frech]", "fits.springs.from", "did you mean `fresh`?"),
        ("from: measured", "from: [measured, measured]", "fits.springs.from", "S199"),
        ("from: measured", "from: [measured, fresh]", "fits.springs.validate_on", "validate on another"),
        (
            "from: measured, validate_on: fresh",
            "from: [measured, fresh], configurations: [5]",
            "fits.springs.configurations[1]",
            "no configuration 5 of `measured` and `fresh`: there are 5 configurations, numbered from 0 to 4",
        ),
        (
            "validate_on: fresh",
            "tied: {g1.stiffness: g2.damping}",
            "fits.springs.tied",
            "`g1.stiffness` cannot follow `g2.damping`, which is of another kind",
        ),
        ("validate_on: fresh", "tied: {g1.stiffness: g3.stiffness}", "fits.springs.tied", "`g3.stiffness` is not"),
        (
            "validate_on: fresh",
            "bounds: {g1.cubic: [0, 1]}",
            "fits.springs.bounds",
            "`g1.cubic` is not estimated",
        ),
        ("validate_on: fresh", "bounds: {g1.damping: [3, 2]}", "fits.springs.bounds", "nothing between 3 and 2"),
        (
            "count: 20}",
            "count: 20, rms: [1, 2, 3]}",
            "campaigns.candidates.excitation.rms",
            "3 values for the 2 motors",
        ),
        ("count: 20}", "count: 20, rms: 0}", "campaigns.candidates.excitation.rms", "above 0"),
        ("high_hz: 50", "high_hz: 501", "campaigns.candidates.excitation", "Nyquist frequency 500 Hz"),
        ("high_hz: 50", "high_hz: 1", "campaigns.candidates.excitation", "not below high_hz"),
        ("period_s: 2", "period_s: 2.0005", "campaigns.candidates.excitation.period_s", "not a whole number"),
        ("count: 20}", "count: 60}", "campaigns.candidates.excitation", "contains 49 odd lines"),
        (
            "[[10, 20], [-80, 40]]",
            "[[10, 20], [-80]]",
            "campaigns.fresh.configurations.list_deg[2]",
            "1 angles for the 2 joints",
        ),
        (
            "[-80, 40]]",
            "[-80, 46]]",
            "campaigns.fresh.configurations.list_deg[2][2]",
            "46 deg is unreachable: joint `two` moves from -45 to 45 deg",
        ),
        (
            "{list_deg: [[10, 20], [-80, 40]]}",
            "{grid_deg: [[0, 91], [0]]}",
            "campaigns.fresh.configurations.grid_deg[1][2]",
            "joint `one`",
        ),
        (
            "{list_deg: [[10, 20], [-80, 40]]}",
            "{grid_deg: [[0]]}",
            "campaigns.fresh.configurations.grid_deg",
            "1 rows for the 2 joints",
        ),
        (
            "{count: 5, seed: 1}",
            "{count: 5, margin_deg: 50}",
            "campaigns.candidates.configurations.random.margin_deg",
            "joint `two`",
        ),
        ("  fresh:\n", "  fresh:\n    payload_kg: 5\n", "campaigns.fresh.payload_kg", "no payload"),
        ("  candidates:\n", "  fits:\n", "campaigns.fits", "S176"),
    ],
)
def test_what_cannot_work_together_is_told(tmp_path, old, new, field, words):
    path = _write(tmp_path, _replaced(EXPERIMENT, old, new))
    told = [text for text in _refused(path) if f": {field}: " in text]
    assert len(told) == 1
    assert words in told[0]


@pytest.mark.parametrize(
    ("old", "new", "field", "words"),
    [
        ("file: log_", "file: $HOME/log_", "file", "only `${ROBID_DATA}`"),
        ("log_{experiment}", "log", "file", "one log for each of 2 experiments: put `{experiment}` into its name"),
        ("log_{experiment}", "log_{run}", "file", "only `{configuration}`, `{realization}`, `{experiment}` stand"),
        ("    realizations: 1", "    realizations: 3", "file", "each of 3 realizations: put `{realization}`"),
        ("[[10, 20]]", "[[10, 20], [0, 0]]", "file", "each of 2 configurations: put `{configuration}`"),
        ("variable: u1", "variable: u1, hold: band_limited", "inputs", "S372"),
        (
            "variable: u1",
            "variable: u1, unit: A, torque_constant_nm_a: 1, normalised: true",
            "inputs",
            "S371",
        ),
        (REFERENCES, REFERENCES.replace("two, v", "one, v"), "references[2].name", "`one` is there twice"),
        (REFERENCES, REFERENCES.replace("r2}", "r2, unit: deg}"), "references[2].unit", "use rad/s or deg/s or rpm"),
        (REFERENCES, REFERENCES.replace("one, v", "six, v"), "references", "named in this order: one, two"),
        ("{name: two, variable: u2}", "{name: three, variable: u2}", "inputs", "named in this order: one, two"),
        ("name: two.arm", "name: to.arm", "outputs[2].name", "did you mean `two.arm`?"),
        ("name: two.arm", "name: two.amr", "outputs[2].name", "did you mean `two.arm`?"),
        ("name: two.arm", "side: tool, name: two.arm", "outputs[2].side", "is the arm side of `two`"),
        ("name: two.arm", "quantity: torque, name: two.arm", "outputs[2]", "is no unit of a torque"),
        ("name: two.arm", "unit: counts, name: two.arm", "outputs[2]", "`counts_per_turn` or `resolution_m`"),
        ("name: two.arm", "counts_per_turn: 0, name: two.arm", "outputs[2].counts_per_turn", "greater than 0"),
        ("name: two.arm", "unit: kg, name: two.arm", "outputs[2].unit", "'rpm'"),
        ("name: two.arm", "one_shot: true, name: two.arm", "outputs[2].one_shot", "S380"),
        ("name: two.arm", "name: one", "outputs[2].name", "there twice"),
        ("variable: u1", "variable: u1, unit: A", "inputs[1]", "S370"),
        ("variable: u1", "variable: u1, normalised: true", "inputs[1]", "neither"),
        ("inputs:", "input:", "input", "did you mean `inputs`?"),
        ("sampling_period_s: 1.0e-3", "sampling_period_s: 2.0e-2", None, "Nyquist frequency 25 Hz"),
    ],
)
def test_wrong_logs_are_told(tmp_path, old, new, field, words):
    experiment = _replaced(EXPERIMENT, "{list_deg: [[10, 20], [-80, 40]]}", "{list_deg: [[10, 20]]}")
    experiment = _replaced(experiment, "source: *source\n", LOG)
    experiment = _replaced(experiment, ", validate_on: fresh", "")
    load_experiment(_write(tmp_path, experiment))
    place = f"campaigns.fresh.source.acquire.{field}" if field else "campaigns.fresh.excitation"
    told = [text for text in _refused(_write(tmp_path, _replaced(experiment, old, new))) if f": {place}: " in text]
    assert any(words in text for text in told)


def test_other_quantities_may_be_logged(tmp_path):
    experiment = _replaced(EXPERIMENT, "{list_deg: [[10, 20], [-80, 40]]}", "{list_deg: [[10, 20]]}")
    experiment = _replaced(_replaced(experiment, "source: *source\n", LOG), ", validate_on: fresh", "")
    further = "{name: two.tacho, variable: w, unit: rpm}, {name: X, variable: x, unit: mm, side: tool}, {name: two.arm"
    loaded = load_experiment(_write(tmp_path, _replaced(experiment, "{name: two.arm", further)))
    acquire = loaded.experiment.campaigns["fresh"].source.acquire
    assert [one.channel.quantity for one in acquire.outputs] == ["angle", "speed", "position", "angle"]


def test_references_need_the_controller_and_its_sampling_period(tmp_path):
    experiment = _replaced(EXPERIMENT, "{list_deg: [[10, 20], [-80, 40]]}", "{list_deg: [[10, 20]]}")
    experiment = _replaced(experiment, "source: *source\n", LOG)
    experiment = _replaced(experiment, ", validate_on: fresh", "")
    told = _refused(_write(tmp_path, _replaced(experiment, "period_s: 1.0e-3", "period_s: 2.0e-3")))
    assert "sampling_period_s: S232 must be the controller's, 0.001 s" in told[0]


def test_a_log_needs_the_fits_outputs_and_compensation_in_its_unit(tmp_path):
    log = LOG.replace("u1}", "u1, unit: A, torque_constant_nm_a: 1, normalised: true}").replace(": none", ": nominal")
    again = _replaced(EXPERIMENT, "source: *source\n", log)
    told = "\n".join(_refused(_write(tmp_path, again)))
    assert "campaigns.fresh.estimate.compensation: S220" in told
    assert "fits.springs.validate_on: S203 `fresh` measures one, two.arm, but the fit reads one, two" in told


def test_logs_look_at_their_silent_lines_unless_told_otherwise(tmp_path):
    experiment = _replaced(EXPERIMENT, "{list_deg: [[10, 20], [-80, 40]]}", "{list_deg: [[10, 20]]}")
    experiment = _replaced(experiment, ", validate_on: fresh", "")
    for written, chosen in (("{compensation: none}", "none"), ("{pooled_lines: 1}", "auto"), (None, "auto")):
        old = "    estimate: {compensation: none}\n"
        log = _replaced(LOG, old, "" if written is None else f"    estimate: {written}\n")
        loaded = load_experiment(_write(tmp_path, _replaced(experiment, "source: *source\n", log)))
        assert loaded.experiment.campaigns["fresh"].estimate.compensation == chosen
        assert loaded.experiment.campaigns["measured"].estimate.compensation == "nominal"


def test_a_log_may_use_even_lines_too(tmp_path):
    experiment = _replaced(EXPERIMENT, "{list_deg: [[10, 20], [-80, 40]]}", "{list_deg: [[10, 20]]}")
    experiment = _replaced(experiment, "source: *source\n", LOG)
    experiment = _replaced(experiment, ", validate_on: fresh", "")
    full = "grid: full, detection_share: 0"
    load_experiment(_write(tmp_path, _replaced(experiment, "seed: 2", f"count: 99, {full}")))
    assert "contains 99 lines" in _refused(_write(tmp_path, _replaced(experiment, "seed: 2", f"count: 100, {full}")))[0]
    assert "odd lines" in _refused(_write(tmp_path, _replaced(experiment, "seed: 2", "count: 99")))[0]


@pytest.mark.parametrize(
    ("outputs", "words"),
    [
        ("[j1]", "S190"),
        ("[motors, tip]", "no output `tip`"),
        ("[motors, one.arm, one.arm]", "is there twice"),
    ],
)
def test_outputs_are_those_of_the_robot(tmp_path, outputs, words):
    robot = _replaced(ROBOT, "springs:", "sensors: [{name: nose, kind: tracker, axis: [0, 0, 1]}]\nsprings:")
    experiment = _replaced(EXPERIMENT, "    source: &source", f"    outputs: {outputs}\n    source: &source")
    assert any(words in line for line in _refused(_write(tmp_path, experiment, robot)))
    experiment = experiment.replace(outputs, "[motors, nose, one.arm]")
    (told,) = _refused(_write(tmp_path, experiment, robot))
    assert "`fresh` measures one, two, but the fit reads one, two, nose, one.arm" in told


def test_a_simulation_needs_a_controller(tmp_path):
    robot = _replaced(ROBOT, "controller: {sampling_period_s: 1.0e-3}\n", "")
    told = _refused(_write(tmp_path, robot=robot))
    assert [text.split(": ")[1] for text in told] == ["campaigns.measured.source.simulate"]
    assert "1 more place" in told[0]  # `fresh` has the same source, by its anchor


def test_a_free_damper_does_not_start_at_zero(tmp_path):
    robot = _replaced(ROBOT, "damping_nms_rad: 10", "damping_nms_rad: 0")
    told = _refused(_write(tmp_path, robot=robot))
    assert [text.split(": ")[1] for text in told] == ["fits.springs.free"] * 2
    fixed = _replaced(EXPERIMENT, "validate_on: fresh", "fixed: [g1.damping, g2.damping]")
    load_experiment(_write(tmp_path, fixed, robot))


def test_longer_circles_are_told_once(tmp_path):
    text = _replaced(EXPERIMENT, "{random: {count: 5, seed: 1}}", "{from: again}")
    text = _replaced(text, "designs:\n", "designs:\n  again: {campaign: measured, count: 3}\n")
    told = _refused(_write(tmp_path, text))
    assert len(told) == 1
    assert "candidates -> measured -> candidates" in told[0]


def test_all_errors_of_both_files_come_at_once_in_order(tmp_path):
    experiment = _replaced(EXPERIMENT, "seed: 2", "sed: 2")
    experiment = _replaced(experiment, "count: 3", "count: -3")
    robot = _replaced(_replaced(ROBOT, "gear_ratio: 100", "gear_ratio: much"), "place: transmission", "place: nowhere")
    path = _write(tmp_path, experiment, robot)
    told = _refused(path)
    assert [text.split(": ")[1] for text in told] == [
        "campaigns.fresh.excitation.sed",
        "designs.best.count",
        "joints[1].motor.gear_ratio",
        "springs[1].place",
    ]
    assert told[0].startswith(f"{path}:14: ")
    assert all(text.startswith(f"{tmp_path / 'robot.yaml'}:1") for text in told[2:])


def test_semantic_problems_of_both_files_come_at_once(tmp_path):
    experiment = _replaced(EXPERIMENT, "from: measured", "from: measure")
    robot = _replaced(ROBOT, "limits_deg: [-90, 90]", "limits_deg: [90, -90]")
    told = "\n".join(_refused(_write(tmp_path, experiment, robot)))
    assert "fits.springs.from" in told
    assert "joints[1].limits_deg" in told


def test_a_missing_or_broken_robot_is_told_with_the_rest(tmp_path):
    path = _write(tmp_path, _replaced(EXPERIMENT, "count: 3", "count: -3"), "a: [")
    told = "\n".join(_refused(path))
    assert f"{path}:3: robot: {tmp_path / 'robot.yaml'}:1: S338" in told
    assert "designs.best.count" in told
    (tmp_path / "robot.yaml").unlink()
    assert f"{path}:3: robot: {tmp_path / 'robot.yaml'}: S333" in _refused(path)[0]


def test_a_missing_experiment_is_told(tmp_path):
    with pytest.raises(SettingsError, match=r"absent\.yaml: S333"):
        load_experiment(tmp_path / "absent.yaml")


def test_a_fit_may_read_several_campaigns_and_say_what_its_parameters_share(tmp_path):
    said = "free: [stiffness, cubic], tied: {g2.cubic: g1.cubic}, bounds: {g1.cubic: [0, 1.0e+12]}"
    experiment = _replaced(EXPERIMENT, "from: measured, validate_on: fresh", f"from: [measured, fresh], {said}")
    fit = load_experiment(_write(tmp_path, experiment)).experiment.fits["springs"]
    assert fit.campaigns == ("measured", "fresh")
    assert fit.options().tied == {"g2.cubic": "g1.cubic"}
    one = load_experiment(_write(tmp_path, EXPERIMENT)).experiment.fits["springs"]
    assert one.campaigns == ("measured",)


def test_campaigns_of_one_fit_carry_the_same_payload(tmp_path):
    experiment = _replaced(EXPERIMENT, "from: measured, validate_on: fresh", "from: [measured, fresh]")
    experiment = _replaced(experiment, "  fresh:\n", "  fresh:\n    payload_kg: 3\n")
    with pytest.raises(SettingsError, match="S200"):
        load_experiment(_write(tmp_path, experiment))


@pytest.mark.parametrize("written", ["inputs: []", "inputs:", ""])
def test_a_list_of_channels_without_entries_says_what_to_fill_in(tmp_path, written):
    log = _replaced(LOG, "inputs: [{name: one, variable: u1}, {name: two, variable: u2}]", written)
    problems = _refused(_write(tmp_path, _replaced(EXPERIMENT, "source: *source\n", log)))
    (told,) = [one for one in problems if ".inputs: " in one]
    assert "campaigns.fresh.source.acquire.inputs: S38" in told
    assert "fill in one line `- {name: .., variable: ..}` for each. Signals that drive the robot" in told
    assert "tuple" not in told
