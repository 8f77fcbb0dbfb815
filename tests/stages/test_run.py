import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from robid.artifacts.kinds import FRF, RECORD, frf_from_artifact, record_from_artifact
from robid.artifacts.store import read_artifact
from robid.artifacts.truth import read_truth
from robid.models.elastic.fitting import true_values
from robid.models.known import load_experiment
from tolerances import RECOVERY_SIGMA

OUTPUTS = {
    "designs/best.h5",
    "estimation/excitation.h5",
    "estimation/record.h5",
    "estimation/frf.h5",
    "validation/excitation.h5",
    "validation/record.h5",
    "validation/frf.h5",
    "fits/elastic/model.h5",
    "fits/elastic/validation.h5",
}


def test_a_run_makes_everything_and_recovers_the_springs(done):
    assert set(done.contents()) == OUTPUTS
    summary = json.loads((done.runs / "summary.json").read_text())
    assert all(isinstance(value, int | float) for value in summary.values())
    truth = json.loads((done.runs / "estimation" / "truth.json").read_text())
    stiffness = {spring["name"]: spring["stiffness"] for spring in truth["robot"]["springs"]}
    for name in ("gear_turn", "gear_lift"):
        prefix = f"fits.elastic.parameters.{name}.stiffness"
        assert summary[f"{prefix}.truth"] == stiffness[name] != summary[f"{prefix}.nominal"]
        assert summary[f"{prefix}.estimate"] == pytest.approx(stiffness[name], rel=0.02)
    assert summary["fits.elastic.springs.worst_error"] < 0.02
    modes = [key for key in summary if ".resonances.configuration_1." in key and key.endswith(".model_hz")]
    assert modes
    for key in modes:
        ends = summary[key.replace("model_hz", "model_lower_hz")], summary[key.replace("model_hz", "model_upper_hz")]
        assert ends[0] < summary[key] < ends[1]
    assert (done.runs / "report.html").read_text().count("<html") == 1


def test_sensors_are_recorded_estimated_and_fitted(shop):
    sensors = (
        "sensors: [{name: tip_z, kind: tracker, axis: [0, 0, 1]}, {name: felt, kind: accelerometer, axis: [0, 1, 0]}]"
    )
    shop.change("payload:", f"{sensors}\npayload:", "arm.yaml")
    for old in ("    source:\n", "    source: {"):
        shop.change(old, f"    outputs: [motors, lift.arm, tip_z, felt]\n{old}")
    answer = shop.robid("run", "small.yaml")
    assert answer.code == 0, answer.err
    frf = frf_from_artifact(read_artifact(shop.runs / "validation/frf.h5", FRF))
    assert frf.output_names == ("turn", "lift", "lift.arm", "tip_z", "felt")
    summary = json.loads((shop.runs / "summary.json").read_text())
    assert summary["fits.elastic.springs.worst_error"] < 0.02


def test_a_stated_truth_is_simulated_and_told_by_the_names_of_the_fit(shop):
    def recorded():
        for stage in ("design-excitation", "simulate-or-acquire"):
            answer = shop.robid(stage, "small.yaml", "--campaign", "validation", "--force")
            assert answer.code == 0, answer.err
        folder = shop.runs / "validation"
        record = record_from_artifact(read_artifact(folder / "record.h5", RECORD))
        nominal = load_experiment(shop.folder / "small.yaml").robot.to_robot()
        true = read_truth(folder / "truth.json", folder / "record.h5")
        return record, true, true_values(nominal, true)

    stated = "rotor_inertia_factor: {turn: 1.1}, mass_factor: {payload: 2}"
    tilt = "springs: [{name: tilt, place: base, axis: [1, 0, 0], stiffness_nm_rad: 1.0e+6, damping_nms_rad: 300}]"
    _, _, plain = recorded()
    shop.change("truth: {", f"truth: {{{stated}, {tilt}, ")
    shop.change("friction: lugre", "friction: stribeck")
    right, true, values = recorded()
    assert true.robot.springs[-1].name == "tilt"
    assert set(values) == set(plain) - {"turn.shape", "lift.shape"}
    changed = {name for name, value in values.items() if value != plain[name]}
    assert changed == {"turn.motor_inertia", "lift.link_inertia", "payload.mass"}
    assert values["turn.motor_inertia"] == pytest.approx(1.1 * 0.002)
    shop.change("truth: {", "truth: {reversed_torque: [turn], torque_constant_factor: {lift: 0.8}, ")
    wrong, _, _ = recorded()
    np.testing.assert_array_equal(wrong.outputs, right.outputs)
    np.testing.assert_allclose(wrong.inputs, right.inputs * [-1.0, 1.25], rtol=1e-6, atol=1e-6)


def test_the_number_of_steps_is_said_and_is_what_decides(shop):
    def simulated(*force):
        answer = shop.robid("simulate-or-acquire", "small.yaml", "--campaign", "validation", *force)
        assert answer.code == 0, answer.err
        truth = json.loads((shop.runs / "validation/truth.json").read_text())
        return answer, truth["steps_per_sample"], shop.contents()["validation/record.h5"]

    assert shop.robid("design-excitation", "small.yaml", "--campaign", "validation").code == 0
    answer, steps, content = simulated()
    assert f"{steps} RK4 step" in answer.flat + " ".join(answer.out.split())
    for number, is_same in ((steps, True), (steps + 1, False)):
        shop.change("seed: 2}}", f"seed: 2, steps_per_sample: {number}}}}}")
        assert shop.states()["validation/record.h5"][0] == "stale"
        answer, stated, again = simulated("--force")
        assert (stated, again == content) == (number, is_same)
        assert "(as stated)" in answer.flat + " ".join(answer.out.split())
        shop.change(f"seed: 2, steps_per_sample: {number}}}}}", "seed: 2}}")


def test_a_breakaway_level_that_is_left_out_is_the_coulomb_level(shop):
    for _ in range(2):
        shop.change(" static_nm: 0.24,", "", "arm.yaml")
    for stage in ("design-excitation", "simulate-or-acquire", "estimate-frf"):
        answer = shop.robid(stage, "small.yaml", "--campaign", "validation")
        assert answer.code == 0, answer.err
    frf = frf_from_artifact(read_artifact(shop.runs / "validation/frf.h5", FRF))
    assert np.isfinite(frf.response).all()
    assert np.isfinite(frf.sensitivity).all()
    content = shop.contents()["validation/record.h5"]
    for _ in range(2):
        shop.change("coulomb_nm: 0.2, stribeck", "coulomb_nm: 0.2, static_nm: 0.2, stribeck", "arm.yaml")
    assert shop.robid("simulate-or-acquire", "small.yaml", "--campaign", "validation", "--force").code == 0
    assert shop.contents()["validation/record.h5"] == content


def test_friction_identified_at_the_silent_lines(shop):
    for _ in range(2):
        shop.change("{compensation: nominal}", "{compensation: silent_lines, silent_configurations: 1}")
    shop.change("friction_relative: 0.1", "friction_relative: 0.4")
    shop.change("period_s: 0.5", "period_s: 1")
    answer = shop.robid("run", "small.yaml")
    assert answer.code == 0, answer.err
    frf = frf_from_artifact(read_artifact(shop.runs / "estimation/frf.h5", FRF))
    found = dict(zip(frf.law_names, zip(frf.law_values, frf.law_std, strict=True), strict=True))
    true = read_truth(shop.runs / "estimation/truth.json", shop.runs / "estimation/record.h5").robot
    for joint in true.joints:
        value, std = found[f"{joint.name}.coulomb_nm"]
        assert joint.motor.friction.coulomb_nm != pytest.approx(0.2, rel=0.01)
        assert abs(value - joint.motor.friction.coulomb_nm) < RECOVERY_SIGMA * std
        assert std < 0.03
    assert any("silent lines of 1 configuration: they explain at least" in note for note in frf.notes)
    summary = json.loads((shop.runs / "summary.json").read_text())
    assert summary["fits.elastic.springs.worst_error"] < 0.02


def test_fewer_experiments_than_motors_run_to_the_end(shop):
    for _ in range(2):
        shop.change("{compensation: nominal}", "{compensation: nominal, estimator: local_periodic}")
    shop.change(
        "    realizations: 2\n    periods: 2\n    source:\n",
        "    realizations: 2\n    experiments: 1\n    periods: 2\n    source:\n",
    )
    shop.change(
        "    realizations: 2\n    periods: 2\n    source: {",
        "    realizations: 2\n    experiments: 1\n    periods: 2\n    source: {",
    )
    shop.change("count: 14", "count: 17, spacing: linear")
    answer = shop.robid("run", "small.yaml")
    assert answer.code in (0, 5), answer.err
    frf = frf_from_artifact(read_artifact(shop.runs / "estimation/frf.h5", FRF))
    assert np.isfinite(frf.response).all()
    assert read_artifact(shop.runs / "estimation/record.h5", RECORD).datasets["inputs"].values.shape[:3] == (2, 2, 1)


def test_too_few_silent_lines_are_a_data_error(shop):
    shop.change("count: 14", "count: 34, grid: full, detection_share: 0")
    shop.change("{compensation: nominal}", "{compensation: silent_lines}")
    answer = shop.robid("run", "small.yaml")
    assert answer.code == 4
    assert "D024" in answer.flat
    assert "`compensation: nominal`" in answer.flat


@pytest.mark.parametrize(
    ("lines", "used", "note"),
    [
        ("count: 14, period_s: 1", "silent_lines", "they explain at least"),
        ("count: 34, period_s: 0.5, grid: full, detection_share: 0", "nominal", "(`nominal`): D"),
    ],
)
def test_auto_takes_the_silent_lines_where_it_can_and_says_what_it_took(shop, lines, used, note):
    shop.change("{compensation: nominal}", "{compensation: auto, silent_configurations: 1}")
    shop.change("period_s: 0.5, low_hz: 4, high_hz: 80, count: 14", f"low_hz: 4, high_hz: 80, {lines}")
    shop.change("{from: best}", "{list_deg: [[20, 30]]}")
    for stage in ("design-excitation", "simulate-or-acquire", "estimate-frf"):
        answer = shop.robid(stage, "small.yaml", "--campaign", "estimation")
        assert answer.code == 0, answer.err
    frf = frf_from_artifact(read_artifact(shop.runs / "estimation/frf.h5", FRF))
    assert frf.compensation == used
    assert any(note in one for one in frf.notes)
    assert (note in answer.flat) == (used == "nominal")


@pytest.mark.parametrize(("compensation", "code"), [("auto", 0), ("silent_lines", 4)])
def test_silent_lines_that_determine_no_law_are_no_defect(shop, monkeypatch, compensation, code):
    def fail(*_):
        raise np.linalg.LinAlgError

    monkeypatch.setattr("robid.pipeline.estimate_frf.start_laws", fail)
    shop.change("{compensation: nominal}", f"{{compensation: {compensation}}}")
    shop.change("{from: best}", "{list_deg: [[20, 30]]}")
    for stage in ("design-excitation", "simulate-or-acquire"):
        assert shop.robid(stage, "small.yaml", "--campaign", "estimation").code == 0
    answer = shop.robid("estimate-frf", "small.yaml", "--campaign", "estimation")
    assert answer.code == code
    assert "D195" in answer.flat


def test_a_run_ends_with_table_verdict_and_report(done):
    answer = done.robid("run", "small.yaml")
    assert answer.code == 0
    for text in ("gear_turn", "kN m/rad", "2 of 2 springs identified within ±", "runs/small/report.html"):
        assert text in answer.out


def test_a_bootstrap_stands_beside_the_intervals(done):
    done.change("starts: 2", "starts: 2, bootstrap: 25")
    answer = done.robid("run", "small.yaml")
    assert answer.code == 0, answer.err
    assert "bootstrap over realizations gives intervals" in answer.flat + answer.out
    assert ">Bootstrap</a></th>" in (done.runs / "report.html").read_text()
    summary = json.loads((done.runs / "summary.json").read_text())
    spring = "fits.elastic.parameters.gear_lift.stiffness"
    assert summary[f"{spring}.bootstrap_lower"] < summary[f"{spring}.estimate"] < summary[f"{spring}.bootstrap_upper"]
    assert 0 < summary[f"{spring}.realization_relative_std"] < 0.1
    assert 0 <= summary["fits.elastic.model_error.share_above"] <= 1
    assert 0 <= summary["fits.elastic.coverage_bootstrap"] <= 1
    assert summary["fits.elastic.undetermined"] == 0


def test_a_second_run_does_nothing(done):
    before = done.files()
    answer = done.robid("run", "small.yaml", "--json")
    assert answer.code == 0
    assert {node["outcome"] for node in answer.json["nodes"]} == {"fresh"}
    assert done.files() == before
    assert set(done.states().values()) == {("fresh", "")}


def test_serial_and_processes_give_the_same_content(done):
    answer = done.robid("run", "small.yaml", "--run-dir", "other", "--backend", "processes", "--workers", "2")
    assert answer.code == 0, answer.err
    assert done.contents(done.folder / "other") == done.contents()


def test_one_line_per_node_where_there_is_no_terminal(shop):
    answer = shop.robid("run", "small.yaml")
    told = [line for line in answer.err.splitlines() if not line.startswith("warning: Predicts")]
    assert len(told) == len(OUTPUTS) + 1
    assert "estimation/record.h5  made: 2 configurations, 2 realizations of 2 experiments" in answer.err


def test_log_level_warning_says_warnings_alone(done):
    done.change("workers: 1", "workers: 1, log_level: warning")
    told = done.robid("run", "small.yaml").err.splitlines()
    assert len(told) == 1
    assert told[0].startswith("warning: Predicts")
    assert "measure 2 more configurations" in told[0]


@pytest.mark.parametrize(("number", "code"), [(signal.SIGKILL, -signal.SIGKILL), (signal.SIGINT, 130)])
def test_a_stopped_run_resumes_and_gives_the_same_content(shop, number, code):
    shop.change("count: 2}", "count: 3}")
    shop.change("periods: 2", "periods: 30")
    command = [sys.executable, "-m", "robid", "run", "small.yaml"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = subprocess.Popen(command, env=environment, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    parts = shop.runs / "estimation" / "record.h5.parts"
    deadline = time.monotonic() + 60
    while not list(parts.glob("*.part")):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.005)
    process.send_signal(number)
    _, err = process.communicate(timeout=60)
    assert process.returncode == code, err
    assert not (shop.runs / "estimation" / "record.h5").exists()
    if number == signal.SIGINT:
        assert err.decode().strip().endswith("the same command goes on from there")
    answer = shop.robid("simulate-or-acquire", "small.yaml", "--campaign", "estimation")
    assert answer.code == 0, answer.err
    assert "of 3 configurations are there from an earlier run" in answer.err
    assert not parts.exists()
    for stage in ("design-configs", "design-excitation", "simulate-or-acquire"):
        own = () if stage == "design-configs" else ("--campaign", "estimation")
        assert shop.robid(stage, "small.yaml", "--run-dir", "other", *own).code == 0
    record = "estimation/record.h5"
    assert shop.contents()[record] == shop.contents(shop.folder / "other")[record]


def test_a_killed_fit_goes_on_with_the_starts_that_are_left_and_gives_the_same_content(done):
    done.change("starts: 2", "starts: 60, agreeing_starts: 0")
    command = [sys.executable, "-m", "robid", "fit", "small.yaml"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    model = done.runs / "fits" / "elastic" / "model.h5"
    parts = model.with_name("model.h5.parts")
    model.unlink()

    def kill_after(count, *options):
        process = subprocess.Popen(
            [*command, *options], env=environment, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL
        )
        deadline = time.monotonic() + 60
        while len(list(parts.glob("*.part"))) < count:
            assert process.poll() is None
            assert time.monotonic() < deadline
            time.sleep(0.005)
        process.kill()
        process.communicate(timeout=60)
        return len(list(parts.glob("*.part")))

    ended = kill_after(2)
    assert ended < 60
    answer = done.robid("fit", "small.yaml")
    assert answer.code in (0, 5), answer.err
    assert f"{ended} of 60 starts are there from an earlier run" in answer.err
    assert not parts.exists()
    resumed = done.contents()["fits/elastic/model.h5"]
    assert done.robid("fit", "small.yaml", "--force").code == answer.code
    assert done.contents()["fits/elastic/model.h5"] == resumed
    # With other settings nothing of an earlier run counts.
    kill_after(1, "--force")
    model.unlink()
    done.change("starts: 60, agreeing_starts: 0", "starts: 5")
    answer = done.robid("fit", "small.yaml")
    assert "from an earlier run" not in answer.err
    assert not parts.exists()


def test_a_fit_that_has_not_converged_is_saved_and_exits_5(shop):
    shop.change("starts: 2", "starts: 2, max_iterations: 1")
    answer = shop.robid("run", "small.yaml")
    assert answer.code == 5
    assert "has not converged (iteration_limit)" in answer.err
    assert "Do not use: the fit has not converged" in answer.out
    assert "fits/elastic/model.h5" in shop.contents()
    assert "fits/elastic/validation.h5" not in shop.contents()
    assert (shop.runs / "report.html").exists()
    before = shop.files()
    again = shop.robid("run", "small.yaml")
    assert again.code == 5
    assert shop.files() == before
    assert shop.states()["report.html"][0] == "fresh"
    assert shop.states()["fits/elastic/validation.h5"][0] == "missing"


@pytest.mark.parametrize(
    "places", [pytest.param("{list_deg: [[-99.6, 82.8], [13.9, -46.1]]}", marks=pytest.mark.slow), "{from: best}"]
)
def test_a_cubic_gear_is_fitted_to_two_amplitudes(shop, places):
    shop.change("friction: lugre}", "stiffening_1_rad2: 2.0e+4}")
    shop.change("compensation: nominal", "compensation: none")
    shop.change("friction_relative: 0.1", "friction_relative: 0")
    shop.change("count: 14, rms: 6,", "count: 14, rms: 25,")
    shop.change("configurations: {from: best}", f"configurations: {places}")
    campaign = f"configurations: {places}, realizations: 2, periods: 2, source: {{simulate: *simulate}}"
    low = f"  low: {{{campaign}, excitation: {{<<: *excitation, rms: 8}}, estimate: {{compensation: none}}}}"
    shop.change("designs:\n", f"{low}\ndesigns:\n")
    kinds = "[stiffness, damping, viscous, delay, cubic]"
    shop.change(
        "from: estimation,", f"from: [estimation, low], free: {kinds}, tied: {{gear_lift.damping: gear_turn.damping}},"
    )
    answer = shop.robid("run", "small.yaml")
    assert answer.code in (0, 5), answer.err
    summary = json.loads((shop.runs / "summary.json").read_text())
    for gear in ("gear_turn", "gear_lift"):
        found = {
            key: summary[f"fits.elastic.parameters.{gear}.cubic.{key}"] for key in ("estimate", "truth", "covered")
        }
        assert found["covered"] == 1
        if summary[f"fits.elastic.parameters.{gear}.cubic.identifiable"]:
            assert found["estimate"] == pytest.approx(found["truth"], rel=0.1)
    assert summary["fits.elastic.parameters.gear_turn.cubic.identifiable"] == 1
    assert summary["fits.elastic.cubic.max_relative_error"] < 0.1
    assert "estimation + low" in (shop.runs / "report.html").read_text()
    answer = shop.robid("export", "small.yaml", "--format", "csv")
    assert answer.code == 0, answer.err
    assert "gear_lift.damping" in (shop.runs / "fits/elastic/export/parameters.csv").read_text()
