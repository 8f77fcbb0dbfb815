import numpy as np
import pytest

from external_shots import CHANNELS, PERIOD_S, answer, sweep, transfer
from robid.models.external.fit.transfer import (
    TransferMatrix,
    build_cascade,
    delayed,
    discretise,
    find_stages,
    propagate,
)
from tolerances import IDENTITY

HARD = CHANNELS | {
    "integrator": ([2.0, 3.0], [1.0, 20.0, 0.0]),
    "triple pole": ([1.0, 3.0], np.poly([-5.0, -5.0, -5.0])),
    "pair twice": ([3.0, 1.0], np.real(np.poly([-3 + 4j, -3 - 4j, -3 + 4j, -3 - 4j]))),
    "slightly unstable": ([1.0, 3.0], np.poly([0.05, -5.0, -8.0])),
}


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("name", HARD)
def test_simulation_is_scipys(name, hold):
    model = transfer(*HARD[name], delay=3, average=4, hold=hold)
    command = sweep(5.0, 1500) + 0.3
    wanted = answer(model, command)
    np.testing.assert_allclose(model.simulate(command[:, None])[:, 0], wanted, atol=1e-9 * np.abs(wanted).max())


@pytest.mark.parametrize("hold", ["zoh", "foh"])
@pytest.mark.parametrize("name", CHANNELS)
def test_steady_period_has_the_sampled_response(name, hold):
    model = transfer(*CHANNELS[name], delay=3, average=4, hold=hold)
    command = np.random.default_rng(1).standard_normal((512, 1))
    found = np.fft.rfft(model.simulate(command, "periodic")[:, 0]) / np.fft.rfft(command[:, 0])
    omega = 2 * np.pi * np.fft.rfftfreq(512, PERIOD_S)
    np.testing.assert_allclose(found, model.sampled_response(omega)[:, 0, 0], atol=1e-9)


def test_period_of_an_integrator_moves_nowhere():
    model = transfer([1.0], [1.0, 0.0])
    command = np.random.default_rng(1).standard_normal((256, 1))
    moved = model.simulate(command - command.mean(), "periodic")[:, 0]
    wanted = PERIOD_S * np.cumsum(command - command.mean())
    np.testing.assert_allclose(moved[1:], wanted[:-1], atol=IDENTITY)


def test_slopes_of_an_integrator_are_those_of_a_very_slow_pole():
    command = np.random.default_rng(1).standard_normal((1, 256))
    command -= command.mean()
    integrator, slow = (
        propagate(
            discretise(build_cascade(find_stages(np.poly([-1.0, pole])), 2), 0.1, "zoh"), 0.1, command, "periodic"
        )
        for pole in (-1e-13, -1e-5)
    )
    without_levels = [each - each.mean(axis=-1, keepdims=True) for each in (integrator, slow)]
    np.testing.assert_allclose(without_levels[0], without_levels[1], atol=1e-3)


def test_response_and_step_of_a_lag():
    model = transfer([3.0], [1.0, 2.0], delay=5)
    omega, time = np.array([0.5, 4.0]), np.linspace(0.0, 3.0, 31)
    late = 5 * PERIOD_S
    wanted = 3 / (1j * omega + 2) * np.exp(-1j * omega * late)
    np.testing.assert_allclose(model.response(omega)[:, 0, 0], wanted, rtol=IDENTITY)
    risen = 1.5 * (1 - np.exp(-2 * np.maximum(time - late, 0)))
    np.testing.assert_allclose(model.step(time)[:, 0, 0], risen, atol=IDENTITY)
    assert model.static_gain == pytest.approx(np.array([[1.5]]))


def test_channels_of_a_matrix_do_not_mix():
    numerator = np.array([[[1.0, 2.0], [0.5, 1.0]], [[-1.0, 5.0], [3.0, 1.0]]])
    model = TransferMatrix(("a", "b"), ("c", "d"), numerator, np.array([1.0, 4.0, 9.0]), 1, 1, PERIOD_S, "zoh")
    commands = np.stack([sweep(2.0, 400), sweep(5.0, 400)], axis=1)
    found = model.simulate(commands)
    for output in range(2):
        parts = [
            answer(transfer(numerator[output, each], model.denominator, delay=1), commands[:, each]) for each in (0, 1)
        ]
        np.testing.assert_allclose(found[:, output], sum(parts), atol=IDENTITY)
    np.testing.assert_allclose(model.zeros(1, 1), [-1 / 3])


@pytest.mark.parametrize(
    ("start", "wanted"), [("rest", [0, 0, 0.5, 1.5]), ("free", [1, 1, 1, 1.5]), ("periodic", [2.5, 3.5, 2.5, 1.5])]
)
def test_what_came_before_the_first_sample(start, wanted):
    command = np.array([[1.0], [2.0], [3.0], [4.0]])
    np.testing.assert_allclose(delayed(command, 2, 2, start)[0], wanted)


def test_states_span_all_numerators():
    denominator = np.real(np.poly([-1.0, -30.0, -3 + 4j, -3 - 4j]))
    for copies, whole in ((1, denominator), (2, np.convolve(denominator, denominator))):
        cascade = build_cascade(find_stages(denominator), copies)
        polynomial = np.random.default_rng(copies).standard_normal(len(whole) - 1)
        weights = cascade.expand(polynomial)
        s = 2.0j
        states = np.linalg.solve(s * np.eye(len(cascade.b)) - cascade.A, cascade.b)
        wanted = np.polyval(polynomial, s) / np.polyval(whole, s)
        # A value is a small difference of large states.
        assert abs(weights @ states - wanted) < IDENTITY * np.abs(weights * states).max()
