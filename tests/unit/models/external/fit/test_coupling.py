"""The decoupling map: chance alone, a coupling whose crossing is known, and commands that move together."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from robid.errors import DataError
from robid.models.external.fit.coupling import Pairs, coherence_limit, map_coupling
from robid.models.external.fit.data import Shot
from robid.models.external.fit.etfe import Etfe, estimate_etfe, floors
from robid.models.external.fit.options import CouplingOptions
from robid.signals.waveforms import chirp

PERIOD_S, N_SAMPLE = 0.012, 5000
OPTIONS = CouplingOptions()
NAMES = ("X", "Z")
NOTHING = Etfe(np.zeros(0), np.zeros((0, 8, 1), complex), np.zeros((0, 8, 1)))
PAIRS = Pairs(NAMES, NAMES, np.full(2, 1e-5), np.full(2, 1e-5), np.eye(2, dtype=bool))


def shot_of(inputs, outputs, name="5 Hz", start="free"):
    return Shot(inputs, outputs, start, None, 1, PERIOD_S, name, place="home")


def mapped(shots, pairs=PAIRS, options=OPTIONS):
    floor = floors(shots, pairs.input_resolution)
    return map_coupling(shots, floor, estimate_etfe(shots, floor, 0.95), pairs, options)


def high_pass(command):
    """A coupling that grows with frequency."""
    return signal.lfilter([1.0, -1.0], [1.0, -0.5], command)


def moving(index, seed=0, noise=5e-6):
    inputs = np.zeros((N_SAMPLE, 2))
    inputs[:, index] = 2e-3 * chirp(0.01 * PERIOD_S, 5.2 * PERIOD_S, N_SAMPLE, peak=0.0)
    outputs = inputs + noise * np.random.default_rng([seed, index]).standard_normal((N_SAMPLE, 2))
    if index == 1:
        outputs[:, 0] += high_pass(inputs[:, 1])
    return shot_of(inputs, outputs)


def test_the_largest_coherence_of_unrelated_signals_exceeds_its_limit_as_often_as_it_says():
    options = CouplingOptions(level=0.1)
    names = tuple("abcdefgh")
    pairs = Pairs(names[:1], names, np.ones(1), np.ones(8), np.zeros((8, 1), bool))
    exceeded = []
    for seed in range(60):
        generator = np.random.default_rng(seed)
        shot = shot_of(*(generator.standard_normal((1000, count)) for count in (1, 8)))
        found = map_coupling([shot], np.zeros(1), NOTHING, pairs, options)
        exceeded.append(found.coherence[0, :, 0] > found.limit[0])
    # 480 trials: deviation 0.014
    assert np.mean(exceeded) == pytest.approx(options.level, abs=0.05)


def test_one_segment_says_nothing():
    assert coherence_limit(1.0, 10, 0.01) == pytest.approx(1.0)
    assert coherence_limit(16.0, 50, 0.01) < OPTIONS.coherence


def test_coherence_is_that_of_scipy():
    shot = moving(1)
    length = 2 * N_SAMPLE // (OPTIONS.segments + 1)
    _, expected = signal.coherence(
        shot.inputs[:, 1], shot.outputs[:, 0], fs=1 / PERIOD_S, nperseg=length, noverlap=length // 2
    )
    frequency, power = signal.welch(shot.inputs[:, 1], fs=1 / PERIOD_S, nperseg=length, noverlap=length // 2)
    excited = power > 1e-4 * power.max()
    found = mapped([shot])
    assert found.coherence[0, 0, 1] == pytest.approx(np.sqrt(expected[excited].max()))
    assert found.highest_hz[0] == frequency[excited][-1]


def test_a_coupling_crosses_where_it_does():
    found = mapped([moving(0), moving(1)])
    assert found.coupled.tolist() == [[[False, False], [False, False]], [[False, True], [False, False]]]
    frequency, response = signal.freqz([1.0, -1.0], [1.0, -0.5], 100000, fs=1 / PERIOD_S)
    crossing = frequency[np.argmax(np.abs(response) > OPTIONS.ratio)]
    assert found.crossing_hz[0, 1] == pytest.approx(crossing, rel=0.05)
    assert np.isinf(found.crossing_hz[1, 0])
    np.testing.assert_allclose(found.decoupled_up_to_hz, found.crossing_hz[0, 1])
    assert "X to Z" in found.sentence
    assert "matrix: full" in found.sentence


def test_resolutions_make_metres_and_radians_comparable():
    fine = replace(PAIRS, output_resolution=np.array([1e-4, 1e-5]))
    found = mapped([moving(0), moving(1)], fine)
    assert not found.coupled.any()
    assert found.ratio[1, 0, 1] == pytest.approx(0.1 * mapped([moving(0), moving(1)]).ratio[1, 0, 1])
    assert "No coupling" in found.sentence


def test_commands_that_move_alike_are_told_apart():
    generator = np.random.default_rng(5)
    one, other = (1e-3 * generator.standard_normal(N_SAMPLE) for _ in range(2))

    def run(follows):
        shots = []
        for sign in (1.0, -1.0):
            inputs = np.stack([one, 0.9 * one + sign * 0.4 * other], axis=1)
            outputs = inputs + 1e-6 * generator.standard_normal((N_SAMPLE, 2))
            outputs[:, 0] += follows * high_pass(inputs[:, 1])
            shots.append(shot_of(inputs, outputs))
        return mapped(shots)

    # What is not caused is not coupled, though commands and outputs are alike.
    assert not run(0.0).coupled.any()
    found = run(1.0)
    assert found.bands == ("5 Hz",)
    assert found.coupled[0].tolist() == [[False, True], [False, False]]


def test_more_segments_than_a_motion_has_room_for_are_refused_and_the_remedy_works():
    with pytest.raises(DataError, match="5000 segments of a motion of 5000 samples") as caught:
        mapped([moving(1)], options=replace(OPTIONS, segments=5000))
    assert caught.value.remedy == "ask for 1249 at most"
    assert np.isfinite(mapped([moving(1)], options=replace(OPTIONS, segments=1249)).coherence[0, 0, 1])
    with pytest.raises(DataError, match="1250 segments"):
        mapped([moving(1)], options=replace(OPTIONS, segments=1250))
