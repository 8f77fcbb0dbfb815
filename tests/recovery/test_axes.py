"""Linear axes and rigid joints, end to end: identifiable springs that are off by up to a factor of 2 come back."""

import json
from pathlib import Path

import pytest

from robid.cli import run_command

CONFIGS = Path(__file__).parents[2] / "configs"

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("name", "sliding", "n_spring"), [("gantry", {"gear_x", "gear_y"}, 5), ("kr300_rail", {"gear_rail"}, 14)]
)
def test_identifiable_springs_come_back_within_two_per_cent(tmp_path, name, sliding, n_spring):
    folder = tmp_path / "run"
    assert run_command(["run", str(CONFIGS / f"{name}.yaml"), "--run-dir", str(folder)]) == 0
    summary = json.loads((folder / "summary.json").read_text())
    start, end = "fits.elastic.parameters.", ".stiffness.truth"
    springs = [
        key.removeprefix(start).removesuffix(end) for key in summary if key.startswith(start) and key.endswith(end)
    ]
    assert len(springs) == n_spring

    def value(spring, key):
        return summary[f"{start}{spring}.stiffness.{key}"]

    identifiable = {spring for spring in springs if value(spring, "identifiable")}
    assert sliding <= identifiable
    assert len(identifiable) > 0.9 * n_spring
    errors = {spring: abs(value(spring, "estimate") / value(spring, "truth") - 1) for spring in identifiable}
    assert max(errors.values()) < 0.02
    assert (
        max(max(value(s, "truth") / value(s, "nominal"), value(s, "nominal") / value(s, "truth")) for s in springs)
        > 1.5
    )
