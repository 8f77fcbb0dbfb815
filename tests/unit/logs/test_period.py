"""The period of a signal, whatever was stated: real recordings, noise, and signals that have none."""

import numpy as np
import pytest
from scipy.io import loadmat

from robid.logs.period import measure_repetition


@pytest.fixture(scope="module")
def bench(data_folder):
    raw = loadmat(data_folder("motor_bench") / "MultisineTypeA.mat")
    return {name: raw[name].ravel().astype(float) for name in ("iq_adx", "iq_refx", "theta_mx")}


@pytest.mark.parametrize("name", ["iq_adx", "iq_refx", "theta_mx"])
@pytest.mark.parametrize("n_sample", [50000, 20000, 12500])
@pytest.mark.parametrize("lines", [np.arange(11, 251, 2), np.arange(22, 501), np.arange(11, 251)])
def test_a_period_stated_twice_too_long_is_told_as_it_is(bench, name, n_sample, lines):
    found = measure_repetition(bench[name][:n_sample], 5000, lines)
    # The angle wanders slowly.
    assert found.samples == pytest.approx(2500, abs=0.1 if name == "theta_mx" else 1e-3)
    assert not found.agrees(5000, lines)
    assert found.proposed(5000, lines) == 2500


@pytest.mark.parametrize("stated", [5000, 6000, 6241, 7000])
@pytest.mark.parametrize("name", ["qg", "qm", "vir"])
def test_a_trajectory_repeats_as_it_was_played(data_folder, name, stated):
    signal = loadmat(data_folder("emps") / "DATA_EMPS.mat")[name].ravel()
    lines = np.arange(1, 40)
    found = measure_repetition(signal, stated, lines)
    assert found.proposed(stated, lines) == 6240
    assert measure_repetition(signal, 6240, lines).agrees(6240, lines)


@pytest.mark.parametrize("stated", [8192, 8000, 4096, 16384])
def test_the_crane_repeats_every_8192_samples(data_folder, stated):
    log = loadmat(data_folder("crane") / "meas1.mat", squeeze_me=True, struct_as_record=False)["meas1"]
    for index in (0, 1, 3):
        found = measure_repetition(log.Y[index].Data, stated, np.arange(1, 401))
        assert found.samples == pytest.approx(8192, abs=0.01)


def test_several_periods_are_as_good_as_one_where_the_lines_fit():
    wave = np.tile(np.random.default_rng(1).normal(size=400), 12)
    even, every = np.arange(4, 200, 2), np.arange(4, 200)
    assert measure_repetition(wave, 800, even).agrees(800, even)
    assert measure_repetition(wave, 799, even).proposed(799, even) == 800
    assert measure_repetition(wave, 800, every).proposed(800, every) == 400


@pytest.mark.parametrize("noise", [0.5, 2.0, 3.0])
def test_a_period_is_found_under_noise(noise):
    generator = np.random.default_rng(2)
    wave = np.tile(generator.normal(size=500), 20)
    found = measure_repetition(wave + noise * generator.normal(size=wave.size), 500, np.arange(1, 200))
    assert found.agrees(500, np.arange(1, 200))


def test_the_deviation_of_a_period_is_that_of_repeated_measurements():
    generator = np.random.default_rng(3)
    lines = np.arange(3, 60)
    phases = generator.uniform(0, 2 * np.pi, len(lines))
    wave = np.cos(2 * np.pi * np.outer(np.arange(4000), lines) / 400.3 + phases).sum(axis=1)
    found = [
        measure_repetition(wave + wave.std() * 0.3 * generator.normal(size=wave.size), 400, lines) for _ in range(60)
    ]
    errors = np.array([each.samples - 400.3 for each in found])
    told = np.mean([each.std_samples for each in found])
    assert abs(errors.mean()) < 4 * told / np.sqrt(60)
    assert 0.6 < errors.std() / told < 1.6


@pytest.mark.parametrize("lines", [np.arange(2, 6), np.array([3, 5, 7]), np.arange(2, 12)])
def test_few_lines_and_periods_repeat_all_the_same(lines):
    phases = np.random.default_rng(0).uniform(0, 2 * np.pi, len(lines))
    wave = np.tile(np.cos(2 * np.pi * np.outer(np.arange(500), lines) / 500 + phases).sum(axis=1), 4)
    assert measure_repetition(wave, 500, lines).agrees(500, lines)


@pytest.mark.parametrize("kind", ["white", "smooth", "walk"])
def test_what_never_repeats_has_no_period(kind):
    generator = np.random.default_rng(4)
    for _ in range(30):
        signal = generator.normal(size=int(generator.integers(2000, 9000)))
        if kind == "smooth":
            signal = np.convolve(signal, np.ones(60), "same")
        signal = np.cumsum(signal) if kind == "walk" else signal
        stated = int(generator.integers(len(signal) // 20, len(signal) // 2))
        assert measure_repetition(signal, stated, np.arange(1, stated // 4)).samples is None
