"""A measured two-inertia drive through the whole chain, against the figures that come with its recording."""

import json
from pathlib import Path

import pytest

from robid.cli import run_command

CONFIG = Path(__file__).parents[2] / "configs/motor_bench.yaml"
# Relative to the torque constant; resonances in Hz.
REFERENCE = {
    "coupling.stiffness": (546.4, 0.01),
    "drive.motor_inertia": (4.780e-3, 0.01),
    "drive.link_inertia": (4.752e-3, 0.01),
}
MODES = {"antiresonance": 53.97, "resonance": 76.21}


def test_the_drive_is_that_of_its_reference(data_folder, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("ROBID_DATA", str(data_folder("motor_bench").parent))
    monkeypatch.chdir(tmp_path)
    assert run_command(["run", str(CONFIG)]) == 5, "the drive has more than two inertias and a spring"
    told = capsys.readouterr().out
    assert "Do not use: the error of the fit's own data costs" in told
    assert "dB" not in told.partition("Do not use")[2], "the responses are met in the median"
    summary = json.loads((tmp_path / "runs/motor_bench/summary.json").read_text())
    for name, (value, tolerance) in REFERENCE.items():
        assert summary[f"fits.two_mass.parameters.{name}.estimate"] == pytest.approx(value, rel=tolerance)
    for kind, hz in MODES.items():
        found = [
            v for key, v in summary.items() if f".{kind}" in key and key.endswith(".model_hz") and ".drive." in key
        ]
        assert min(abs(value / hz - 1) for value in found) < 0.003, (kind, found)


BEFORE = "stiffness, damping, viscous, motor_inertia, link_inertia, delay"
AFTER = f"{BEFORE}, arm_viscous"


@pytest.fixture(scope="module")
def with_and_without(data_folder, tmp_path_factory):
    """The drive fitted with and without friction of its load, on all lines and above 30 Hz; the summary."""
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("bench")
        patch.setenv("ROBID_DATA", str(data_folder("motor_bench").parent))
        patch.chdir(folder)
        text = CONFIG.read_text().replace("robots/", f"{CONFIG.parent}/robots/")
        begun = text.partition("fits:")[0] + "fits:\n"
        for name, free, cut in (
            ("before", BEFORE, 0), ("after", AFTER, 0), ("before_high", BEFORE, 30), ("after_high", AFTER, 30),
        ):  # fmt: skip
            weights = f"{{low_cut_hz: {cut}}}"
            begun += f"  {name}: {{family: elastic, from: estimation, free: [{free}], starts: 4, weights: {weights}}}\n"
        (folder / "bench.yaml").write_text(f"{begun}execution: {{backend: serial}}\n")
        assert run_command(["run", "bench.yaml"]) == 5
        return json.loads((folder / "runs/motor_bench/summary.json").read_text())


def estimate_of(summary, fit, name):
    return summary[f"fits.{fit}.parameters.{name}.estimate"]


def test_friction_of_the_load_takes_a_third_of_the_misfit_and_most_of_the_damper(with_and_without):
    """Without it the coupling's damper stands for it, and above 30 Hz the motor's friction drives."""
    summary = with_and_without
    cost = {
        fit: summary[f"fits.{fit}.estimation.average_configuration_cost"]
        for fit in ("before", "after", "before_high", "after_high")
    }
    assert cost["after"] < 0.72 * cost["before"]
    assert cost["after_high"] < 0.82 * cost["before_high"]
    damper = {fit: estimate_of(summary, fit, "coupling.damping") for fit in cost}
    assert damper["after"] < damper["before"] / 3
    assert damper["after_high"] < damper["before_high"] / 5
    viscous = {fit: estimate_of(summary, fit, "drive.viscous") for fit in cost}
    assert viscous["before_high"] < -0.03
    # With it, lines above 30 Hz say what all lines say.
    assert viscous["after_high"] == pytest.approx(viscous["after"], rel=0.2)
    rubs = [estimate_of(summary, fit, "drive.arm_viscous") for fit in ("after", "after_high")]
    assert rubs == pytest.approx([0.0765, 0.0793], rel=0.05)


def test_parts_of_the_log_have_their_resonances_within_each_others_intervals(data_folder, tmp_path, monkeypatch):
    """Four parts of four periods; and of the bumps above 180 Hz, which friction makes, none is a resonance."""
    monkeypatch.setenv("ROBID_DATA", str(data_folder("motor_bench").parent))
    monkeypatch.chdir(tmp_path)
    text = CONFIG.read_text().replace("robots/", f"{CONFIG.parent}/robots/")
    head, campaign = text.partition("fits:")[0].split("  estimation:\n")
    parts, fits = "", ""
    for part, dropped in enumerate((1, 5, 9, 13)):
        own = campaign.replace("periods: 19", "periods: 4").replace("drop_periods: 1", f"drop_periods: {dropped}")
        parts += f"  part_{part}:\n{own}"
        fits += f"  fit_{part}: {{family: elastic, from: part_{part}, free: [{AFTER}]}}\n"
    (tmp_path / "parts.yaml").write_text(f"{head}{parts}fits:\n{fits}execution: {{backend: serial}}\n")
    assert run_command(["run", "parts.yaml"]) == 5
    summary = json.loads((tmp_path / "runs/motor_bench/summary.json").read_text())
    for kind in MODES:
        place = f"resonances.configuration_1.drive.{kind}_1"
        rows = [
            [summary[f"fits.fit_{part}.{place}.peak{key}_hz"] for key in ("_lower", "", "_upper")] for part in range(4)
        ]
        for lower, _, upper in rows:
            assert all(lower <= peak <= upper for _, peak, _ in rows), rows
            assert upper - lower < 0.01 * upper
    assert not [key for key in summary if "resonance_2" in key]


def test_logs_of_one_place_are_pooled_whichever_fit_reads_them(data_folder, tmp_path, monkeypatch, capsys):
    """Parts of the log of which two have clocks that are off by 1 %: their resonances lie 0.8 Hz apart."""
    monkeypatch.setenv("ROBID_DATA", str(data_folder("motor_bench").parent))
    monkeypatch.chdir(tmp_path)
    text = CONFIG.read_text().replace("robots/", f"{CONFIG.parent}/robots/")
    head, campaign = text.partition("fits:")[0].split("  estimation:\n")
    campaign = campaign.replace("        time: {variable: time, unit: us}\n", "")
    parts = ""
    for name, dropped, slower in (("monday", 1, 0.99), ("tuesday", 5, 1.0), ("friday", 9, 1.01)):
        own = campaign.replace("periods: 19", "periods: 4").replace("drop_periods: 1", f"drop_periods: {dropped}")
        own = own.replace("period_s: 4.0e-4", f"period_s: {4e-4 * slower:.7g}").replace(
            "period_s: 1,", f"period_s: {slower},"
        )
        own = own.replace("low_hz: 11,", f"low_hz: {11 / slower},").replace(
            "high_hz: 250,", f"high_hz: {250 / slower},"
        )
        parts += f"  {name}:\n{own}"
    fits = "".join(
        f"  {name}: {{family: elastic, from: {read}, free: [{AFTER}]{rest}}}\n"
        for name, read, rest in (("first", "monday", ", validate_on: tuesday"), ("last", "friday", ""))
    )
    (tmp_path / "days.yaml").write_text(f"{head}{parts}fits:\n{fits}execution: {{backend: serial}}\n")
    assert run_command(["run", "days.yaml"]) == 5
    assert "measured intervals hold what monday, tuesday, friday scatter" in capsys.readouterr().out
    summary = json.loads((tmp_path / "runs/motor_bench/summary.json").read_text())
    for kind in MODES:
        place = f"resonances.configuration_1.drive.{kind}_1"
        first, last = (
            {key.rpartition(".")[2]: value for key, value in summary.items() if key.startswith(f"fits.{name}.{place}.")}
            for name in ("first", "last")
        )
        assert first["repeats"] == last["repeats"] == 3
        assert first["mean_peak_hz"] == pytest.approx(last["mean_peak_hz"], rel=1e-9)
        for one, other in ((first, last), (last, first)):
            assert one["peak_lower_hz"] < other["peak_hz"] < one["peak_upper_hz"]
