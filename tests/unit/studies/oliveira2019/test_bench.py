"""The paper's plants against a fine integration and their closed forms."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from robid.settings.yaml import load_yaml
from robid.studies.oliveira2019.bench import Bench, Plant, bench_of, plants_of
from robid.studies.settings.parts import PlantsCase

ROOT = Path(__file__).parents[4]
PAPER = load_yaml(ROOT / "data/oliveira2019.yaml").data
PLANTS = {plant.name: plant for plant in plants_of(PAPER)}
BENCH = bench_of(PAPER, PlantsCase())


def test_plants_are_those_of_the_paper():
    assert "".join(PLANTS) == "XYZRABC"
    assert PLANTS["X"].amplitude[0.10] == pytest.approx(0.6)
    assert PLANTS["C"].amplitude[2.08] == pytest.approx(np.deg2rad(1))
    assert PLANTS["R"].resolution == pytest.approx(1e-5)
    assert PLANTS["A"].resolution == pytest.approx(np.deg2rad(0.001))
    assert (PLANTS["R"].unit, PLANTS["A"].unit) == ("m", "rad")
    assert np.roots(PLANTS["C"].numerator)[0] == pytest.approx(55.25, abs=0.01)  # its undershoot
    for plant in PLANTS.values():
        assert plant.numerator[-1] / plant.denominator[-1] == pytest.approx(1, abs=0.05)


def test_a_chirp_rises_in_frequency_and_falls_in_amplitude():
    plant, period = PLANTS["Z"], BENCH.sampling_period_s
    command = BENCH.command(plant, 5.2)
    time = np.arange(len(command)) * period
    length = len(command) * period
    wave = np.sin(2 * np.pi * 0.01 * time + np.pi / length * 5.19 * time**2)
    np.testing.assert_allclose(command, 2e-3 * (1 - time / length) * wave, atol=1e-12)
    assert command[0] == 0


@pytest.mark.parametrize("name", ["X", "C"])
def test_answers_are_those_of_a_fine_integration(name):
    plant = PLANTS[name]
    bench = Bench(0.012, 0.6, 0.5, 1, 4, 4, 0.0)
    command = bench.command(plant, 5.2)
    numerator, denominator = np.array(plant.numerator), np.array(plant.denominator)
    held = np.concatenate([np.zeros(7), command])
    order = len(denominator) - 1
    chain = np.eye(order, k=1)
    chain[-1] = -denominator[:0:-1]
    push = np.eye(order)[-1]
    look = np.concatenate([numerator[::-1], np.zeros(order - len(numerator))])
    state, expected = np.zeros(order), []
    for sample in range(len(command)):
        expected.append(look @ state)
        value = held[sample : sample + 4].mean()  # four commands, the last four samples ago
        solved = solve_ivp(
            lambda _, x, value=value: chain @ x + push * value, (0, 0.012), state, "DOP853", rtol=1e-10, atol=1e-18
        )
        state = solved.y[:, -1]
    found = bench.answer(plant, command)
    assert np.max(np.abs(found - expected)) < 1e-7 * np.max(np.abs(expected))
    assert not found[:5].any()


def test_noise_is_added_before_quantising_and_repeats_differ():
    plant, answer = PLANTS["B"], np.full(200_000, 0.1)
    measured = BENCH.measure(plant, answer, np.random.default_rng(1))
    assert measured.shape == (4, 200_000)
    counts = measured / plant.resolution
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    assert np.std(measured - answer) == pytest.approx(plant.resolution * np.sqrt(13 / 12), rel=0.01)
    assert np.corrcoef(measured)[0, 1] == pytest.approx(0, abs=0.02)


def test_responses_are_those_of_long_sines():
    plant, frequency = PLANTS["Z"], 20 / (250 * 0.012)
    bench = Bench(0.012, 0.012 * 2500, 0.5, 1, 4, 4, 0.0)
    wave = np.exp(2j * np.pi * frequency * 0.012 * np.arange(2500))
    answer = bench.answer(plant, wave.real) + 1j * bench.answer(plant, wave.imag)
    found = np.mean(answer[-250:] / wave[-250:])
    np.testing.assert_allclose(bench.response(plant, np.array([frequency]))[0], found, rtol=1e-9)


def test_the_transfer_functions_own_response_has_the_delay_alone():
    frequency = np.array([0.01, 1.0, 5.2])
    plant = Plant("Z", (2.0,), (0.5, 1.0), {}, 1e-5)
    expected = 2 / (1 + 0.5j * 2 * np.pi * frequency) * np.exp(-2j * np.pi * frequency * 0.048)
    np.testing.assert_allclose(BENCH.continuous(plant, frequency), expected)
