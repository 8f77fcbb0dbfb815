"""A changed section makes exactly what depends on it stale."""

import re
import shutil
from pathlib import Path

import pytest

from robid.models.known import load_experiment
from robid.pipeline.graph import graph
from robid.settings.robot_parts import plain_settings, robot_settings

PLAYED = (
    *("inject", "rms", "amplitude", "phase_iterations", "phase_starts", "crest_at", "limit_share"),
    *(
        "max_excursion_deg",
        "max_excursion_m",
        "assumed_angle_noise_rad",
        "assumed_torque_noise_nm",
        "random_block_phases",
        "travel",
    ),
)
ESTIMATION = {"estimation/excitation.h5", "estimation/record.h5", "estimation/frf.h5"}
VALIDATION = {"validation/excitation.h5", "validation/record.h5", "validation/frf.h5"}
FIT = {"fits/elastic/model.h5", "fits/elastic/validation.h5", "report.html"}
CHECK = {"fits/elastic/validation.h5", "report.html"}
FRFS = {"estimation/frf.h5", "validation/frf.h5"}
RECORDS = {"estimation/record.h5", "validation/record.h5"}
ALL = {"designs/best.h5"} | ESTIMATION | VALIDATION | FIT

CASES = [
    ("small.yaml", "workers: 1", "workers: 2", set(), ""),
    ("small.yaml", "backend: serial", "backend: processes", set(), ""),
    ("small.yaml", "backend: serial", "backend: dask, scheduler: 'tcp://10.0.0.1:8786'", set(), ""),
    ("small.yaml", "starts: 2", "starts: 3", FIT, "fits.elastic.starts"),
    ("small.yaml", "compensation: nominal", "compensation: none", {"estimation/frf.h5"} | FIT, "estimate.compensation"),
    ("small.yaml", "rms: 6, seed: 1", "rms: 6, seed: 3", ALL - VALIDATION, "campaigns.estimation.excitation.seed"),
    ("small.yaml", "*excitation, seed: 2", "*excitation, seed: 3", VALIDATION | CHECK, "excitation.seed"),
    ("small.yaml", "*simulate, seed: 2", "*simulate, seed: 3", VALIDATION - {"validation/excitation.h5"} | CHECK, ""),
    ("small.yaml", "periods: 2", "periods: 3", ESTIMATION | FIT, "estimation.periods"),
    ("small.yaml", "count: 2}", "count: 3}", {"designs/best.h5"} | ESTIMATION | FIT, "designs.best.count"),
    ("small.yaml", "count: 6, seed: 1", "count: 6, seed: 2", {"designs/best.h5"} | ESTIMATION | FIT, ""),
    ("small.yaml", "[[20, 30]]", "[[20, 31]]", VALIDATION | CHECK, "configurations.list_deg[1][2]"),
    ("arm.yaml", "relative_std: 0.1", "relative_std: 0.2", FRFS | FIT, "robot.joints[1].motor.friction.relative_std"),
    (
        "arm.yaml",
        "inertia_kgm2: 0.002",
        "inertia_relative_std: 0.1\n      inertia_kgm2: 0.002",
        {"designs/best.h5"} | ESTIMATION | FIT,
        "inertia_relative_std",
    ),
    (
        "arm.yaml",
        "inertia_kgm2: 0.002",
        "torque_constant_nm_a: 0.1\n      inertia_kgm2: 0.002",
        FIT,
        "torque_constant_nm_a",
    ),
    (
        "arm.yaml",
        "joints:\n",
        "doubts: {com_m: 0.02}\njoints:\n",
        {"designs/best.h5"} | ESTIMATION | FIT,
        "robot.doubts.com_m",
    ),
    ("arm.yaml", "coulomb_nm: 0.2,", "coulomb_nm: 0.21,", RECORDS | FRFS | FIT, "friction.coulomb_nm"),
    ("arm.yaml", "damping_nms_rad: 80", "damping_nms_rad: 81", ALL, "robot.springs[1].damping_nms_rad"),
    ("arm.yaml", "integral_time_s: 0.1", "integral_time_s: 0.2", ESTIMATION | VALIDATION | FIT, "integral_time_s"),
    ("arm.yaml", ", assumed: [damping_nms_rad]", "", {"report.html"}, "robot.assumed"),
    ("arm.yaml", "two-joint arm\n", "another arm\n", {"report.html"}, "robot.name"),
]


# Records name the robot that they are of by its sum, which other rated torques change; nothing else in them does.
RATED = "max_torque_nm: 30\n", "max_torque_nm: 30\n      rated_torque_nm: 3\n", {"report.html"}, "rated_torque_nm"


@pytest.mark.parametrize(("file", "old", "new", "stale", "why"), [*CASES, ("arm.yaml", *RATED)])
def test_a_change_makes_exactly_what_depends_on_it_stale(done, file, old, new, stale, why):
    done.change(old, new, file)
    states = done.states()
    assert {output for output, (status, _) in states.items() if status == "stale"} == stale
    assert all(status in ("fresh", "stale") for status, _ in states.values())
    reasons = " | ".join(reason for _, reason in states.values())
    assert why in reasons
    if stale:
        assert "settings changed: " in reasons


ROBOT_CASES = [case for case in CASES if case[0] == "arm.yaml"]
QUICK = ("relative_std: 0.1", "coulomb_nm: 0.2,", "two-joint arm\n")


@pytest.mark.parametrize(
    "case", [case if case[1] in QUICK else pytest.param(case, marks=pytest.mark.slow) for case in ROBOT_CASES]
)
def test_what_stays_fresh_would_come_out_the_same(done, case):
    file, old, new, stale, _ = case
    done.change(old, new, file)
    assert done.robid("run", "small.yaml", "--run-dir", "other").code in (0, 5)
    before, after = done.contents(), done.contents(done.folder / "other")
    assert {path for path in after if path not in stale} == {path for path in before if path not in stale}
    assert {path: after[path] for path in after if path not in stale} == {
        path: before[path] for path in before if path not in stale
    }


NUMBER = re.compile(r"(?<![\w.])-?\d+(\.\d+)?(e[+-]?\d+)?(?![\w.])")


@pytest.mark.slow
@pytest.mark.parametrize("part", range(4))
def test_no_number_of_a_robot_changes_what_stays_fresh(done, part):
    file, before, tried = done.folder / "arm.yaml", done.contents(), 0
    text = file.read_text()
    numbers = [each for each in NUMBER.finditer(text) if each.start() > text.index("position_gain")]
    for each in numbers[part::4]:
        other = "2" if text[: each.start()].endswith("delay_samples: ") else f"{1.01 * float(each.group()) or 1e-3:.6g}"
        file.write_text(text[: each.start()] + other + text[each.end() :])
        fresh = {output for output, (status, _) in done.states().items() if status == "fresh"} & {*before}
        shutil.rmtree(done.folder / "other", ignore_errors=True)
        assert done.robid("run", "small.yaml", "--run-dir", "other").code in (0, 5)
        after = done.contents(done.folder / "other")
        where = text[max(each.start() - 40, 0) : each.end()]
        assert {path: after[path] for path in fresh} == {path: before[path] for path in fresh}, where
        tried += len(fresh) > 0
    assert tried > len(numbers) // 16


def test_run_makes_again_what_is_stale_and_nothing_else(done):
    before = done.files()
    done.change("*simulate, seed: 2", "*simulate, seed: 3")
    answer = done.robid("run", "small.yaml", "--json")
    made = {node["output"] for node in answer.json["nodes"] if node["outcome"] == "made"}
    assert made == {"validation/record.h5", "validation/frf.h5", "fits/elastic/validation.h5", "report.html"}
    after = done.files()
    changed = {path for path in before if before[path] != after[path]}
    assert {path.removeprefix(f"{done.runs}/") for path in changed} >= {"validation/record.h5", "summary.json"}
    assert not any("estimation" in path or "model" in path for path in changed)


def test_an_exchanged_input_makes_stale_what_read_it(done):
    assert done.robid("simulate-or-acquire", "small.yaml", "--campaign", "validation", "--force").code == 0
    assert set(done.states().values()) == {("fresh", "")}  # made again, but the same content
    (done.runs / "estimation" / "frf.h5").write_bytes((done.runs / "validation" / "frf.h5").read_bytes())
    assert done.states()["fits/elastic/model.h5"] == ("stale", "input estimation/frf.h5 will be made again")
    (done.runs / "estimation" / "truth.json").write_text('{"robot": {}}')
    assert done.states()["fits/elastic/validation.h5"][0] == "stale"


def test_a_missing_second_output_is_made_again(done):
    (done.runs / "summary.json").unlink()
    assert done.states()["report.html"] == ("missing", "summary.json is not there")
    assert done.robid("run", "small.yaml").code == 0
    assert (done.runs / "summary.json").exists()


def leaves(value, name):
    if isinstance(value, dict):
        return {leaf for key, inner in value.items() for leaf in leaves(inner, f"{name}.{key}")}
    if isinstance(value, list) and any(isinstance(inner, dict) for inner in value):
        return {leaf for inner in value for leaf in leaves(inner, f"{name}[]")}
    return {name}


@pytest.mark.parametrize("file", ["small.yaml", "bench.yaml"])
def test_every_setting_is_read_by_some_stage(file):
    loaded = load_experiment(Path(__file__).parent / file)
    read = {leaf for node in graph(loaded) for key, value in node.plan.settings.items() for leaf in leaves(value, key)}
    for section in ("campaigns", "designs", "fits"):
        for owner, content in plain_settings(getattr(loaded.experiment, section)).items():
            unread = leaves(content, f"{section}.{owner}") - read
            if owner == "candidates":  # only chosen from, never measured
                continue
            if file == "bench.yaml":  # was played by somebody else
                unread -= {f"campaigns.log.excitation.{key}" for key in PLAYED}
                unread -= {f"campaigns.log.{key}" for key in ("realizations", "experiments", "outputs")}
            assert unread == set()
    if file == "small.yaml":
        unread = leaves(plain_settings(loaded.robot), "robot") - read
        # What a rigid model brings reaches the stages as frames, links and limits.
        brought = {"robot.model", "robot.flange", "robot.total_mass_kg", "robot.locked"}
        # A joint whose torque is measured behind its gear has no motor, which is read.
        brought |= {"robot.joints[].torque_measured_at"}
        # Read where a file states it.
        brought |= {"robot.joints[].motor.torque_constant_nm_a", "robot.joints[].motor.rated_torque_nm"}
        # What only rigid models know is read by their fits, of which there is none here.
        of_rigid = {"robot.loop_links", "robot.joints[].counterbalance"}
        assert of_rigid <= leaves(robot_settings(loaded, "rigid")["robot"], "robot")
        of_poses = {"robot.pose_interface"}
        assert of_poses <= leaves(robot_settings(loaded, "pose")["robot"], "robot")
        assert {leaf for leaf in unread if not leaf.endswith("assumed")} == {
            "robot.schema_version"
        } | brought | of_rigid | of_poses
