"""Channels that cannot be fitted are refused by name, doubtful ones told."""

from dataclasses import replace

import numpy as np
import pytest

from robid.errors import DataError
from robid.models.external.fit.checks import Block, mixed_findings, signal_findings, unsteady_findings, usable_blocks
from robid.models.external.fit.data import Shot, quantum_of
from robid.models.external.fit.etfe import estimate_etfe, floors
from robid.models.external.fit.options import ExternalOptions
from robid.signals.waveforms import chirp

PERIOD_S, N_SAMPLE = 0.012, 3000
NAMES = ("X", "Y")
DEFAULTS = ExternalOptions()
BLOCKS = (Block("X", (0,), (0,)), Block("Y", (1,), (1,)))
COMMAND = 2e-3 * chirp(0.01 * PERIOD_S, 2 * PERIOD_S, N_SAMPLE, peak=0.0)


def shot_of(answer, command=COMMAND, step=0.0):
    inputs, outputs = np.zeros((len(command), 2)), np.zeros((len(command), 2))
    inputs[:, 0] = command
    outputs[:, 0] = np.round(answer / step) * step if step else answer
    return Shot(
        inputs, outputs, "free", None, 1, PERIOD_S, "slow", quantum=np.array([quantum_of(each) for each in outputs.T])
    )


def usable(shot, options=DEFAULTS, blocks=BLOCKS):
    shots = [shot]
    return usable_blocks(blocks, shots, floors(shots, np.full(2, 1e-5)), NAMES, options)


def test_a_channel_that_nobody_excited_is_left_out_and_told():
    kept, found = usable(shot_of(COMMAND))
    assert [block.name for block in kept] == ["X"]
    assert [(each.kind, each.channel) for each in found] == [("left_out", "Y")]
    with pytest.raises(DataError, match="command of Y never moves"):
        usable(shot_of(COMMAND), ExternalOptions(pairs=(("X", "X"), ("Y", "Y"))))
    whole = Block("matrix", (0, 1), (0, 1))
    kept, found = usable(shot_of(COMMAND), ExternalOptions(matrix="full"), (whole,))
    assert (kept[0].inputs, kept[0].outputs) == ((0,), (0,))
    assert len(found) == 2


def test_what_cannot_be_fitted_is_refused_by_name():
    with pytest.raises(DataError, match="X never moves although"):
        usable(shot_of(np.full(N_SAMPLE, 3.0)))
    with pytest.raises(DataError, match="D142"):
        usable(shot_of(COMMAND, np.zeros(N_SAMPLE)))
    with pytest.raises(DataError, match="D144"):
        usable(shot_of(COMMAND, step=2e-3))
    with pytest.raises(DataError, match="D145"):
        usable(shot_of(COMMAND[:30], COMMAND[:30]), ExternalOptions(poles=4))


def test_only_where_poles_were_asked_for_fewer_are_the_remedy():
    for options in (ExternalOptions(poles=4), DEFAULTS):
        with pytest.raises(DataError, match="D145") as told:
            usable(shot_of(COMMAND[:10], COMMAND[:10]), options)
        assert ("fewer poles" in told.value.remedy) == (options.poles is not None)


@pytest.mark.parametrize(("wander", "decisive"), [(None, []), (0.0, []), (0.02, [False]), (0.2, [True])])
def test_periods_that_lie_apart_are_told(wander, decisive):
    shot = shot_of(COMMAND)
    if wander is not None:
        shot = replace(shot, wander=wander * shot.outputs.std(axis=0))
    found = list(unsteady_findings(BLOCKS[0], [shot_of(COMMAND), shot], NAMES))
    assert [each.decisive for each in found] == decisive
    assert all("drop_periods" in each.message and each.kind == "unsteady" for each in found)


@pytest.mark.parametrize("step", [0.0, 1e-6, 1e-5, 2e-4])
def test_sound_motions_raise_no_doubt(step):
    late = np.concatenate([np.zeros(8), COMMAND[:-8]])
    noise = 0.3 * step * np.random.default_rng(1).standard_normal(N_SAMPLE)
    for answer in (COMMAND, 0.5 * late, late + noise):
        found = list(signal_findings(BLOCKS[0], [shot_of(answer, step=step)], NAMES))
        assert [each.kind for each in found if each.kind == "stuck"] == []
        assert bool(found) == (step == 2e-4), "fewer than 20 steps"


@pytest.mark.parametrize("step", [0.0, 1e-6, 1e-5])
def test_saturation_is_seen(step):
    found = list(signal_findings(BLOCKS[0], [shot_of(np.clip(COMMAND, -1e-3, 1e-3), step=step)], NAMES))
    assert [(each.kind, each.decisive) for each in found] == [("stuck", True)]
    assert "slow" in found[0].message


def test_the_grid_of_a_converter_is_found():
    generator = np.random.default_rng(2)
    signal = generator.standard_normal(2000)
    assert quantum_of(signal) == 0.0
    for step in (1e-3, 0.05, 0.7):
        stored = np.float32(np.round(signal / step) * step).astype(float)
        assert quantum_of(stored) == pytest.approx(step, rel=1e-3)


def test_commands_that_reach_another_output_are_told():
    generator = np.random.default_rng(4)
    told = generator.standard_normal((2, 1500, 2))
    told[1, :, 1] *= -1
    told *= 1e-3

    def findings(share):
        shots = []
        for inputs in told:
            outputs = inputs.copy()
            outputs[:, 0] += share * inputs[:, 1]
            shots.append(Shot(inputs, outputs, "free", None, 1, PERIOD_S, "both", place="home"))
        floor = floors(shots, np.full(2, 1e-5))
        return list(mixed_findings(BLOCKS[0], shots, floor, estimate_etfe(shots, floor, 0.95)))

    assert findings(0.01) == []
    (found,) = findings(0.5)
    assert (found.kind, found.channel) == ("mixed", "X")
    # Of two parts of size 1 and 0.5.
    assert found.strength * 0.05 == pytest.approx(0.5 / np.hypot(1, 0.5), rel=0.05)
    assert "matrix: full" in found.message
