"""Step responses, their figures and deviations, and root loci against python-control."""

import control
import numpy as np
import pytest

from robid.models.external.fit.graphs import Fitted, frequency_responses, root_loci, step_responses
from robid.models.external.fit.transfer import TransferMatrix
from tolerances import IDENTITY

COEFFICIENTS = np.array([-6.254, 6863.0, 1.032e4, 205.1, 7179.0, 1.032e4])  # channel B of Oliveira et al. (2019)


def fitted_of(coefficients, root=None, delay=3):
    model = TransferMatrix(
        inputs=("B",),
        outputs=("B",),
        numerator=coefficients[None, None, :3],
        denominator=np.concatenate([[1.0], coefficients[3:]]),
        delay_samples=delay,
        moving_average=1,
        sampling_period_s=0.012,
        hold="zoh",
    )
    return Fitted(model, np.zeros((6, 1)) if root is None else root)


def test_a_step_response_is_that_of_python_control_behind_the_delay():
    found = step_responses([fitted_of(COEFFICIENTS)])
    time = found.time_s[:, 0]
    late = np.maximum(time - 3 * 0.012, 0)
    system = control.TransferFunction(COEFFICIENTS[:3], np.concatenate([[1.0], COEFFICIENTS[3:]]))
    fine = np.linspace(0, late[-1], 20001)
    expected = control.step_response(system, fine).outputs
    np.testing.assert_allclose(found.value[:, 0], np.interp(late, fine, expected), atol=1e-6)
    assert found.undershoot[0] == pytest.approx(-expected.min() / found.value[-1, 0], rel=0.1)
    assert 0 < found.undershoot[0] < 0.01
    assert found.overshoot[0] == 0
    settled = system.dcgain()
    assert abs(found.value[-1, 0] / settled - 1) < 0.03, "it is shown until it has settled"


def test_deviations_are_those_of_drawn_coefficients():
    generator = np.random.default_rng(3)
    root = 1e-3 * np.diag(COEFFICIENTS) @ generator.standard_normal((6, 4))
    one = fitted_of(COEFFICIENTS, root)
    steps, responses = step_responses([one]), frequency_responses([one], 0.1)
    time, omega = steps.time_s[:, 0], 2 * np.pi * responses.frequency_hz
    drawn = [fitted_of(COEFFICIENTS + root @ generator.standard_normal(4)).model for _ in range(400)]
    std = np.std([each.step(time)[:, 0, 0] for each in drawn], axis=0)
    moving = std > 0.1 * std.max()
    # The deviation of a deviation from 400 draws is 3.5 %.
    np.testing.assert_allclose(steps.std[moving, 0], std[moving], rtol=0.15)
    spread = np.array([each.response(omega)[:, 0, 0] / responses.response[:, 0] for each in drawn])
    np.testing.assert_allclose(responses.relative_std[:, 0], np.std(np.abs(spread), axis=0), rtol=0.15)
    np.testing.assert_allclose(responses.phase_std[:, 0], np.std(np.angle(spread), axis=0), rtol=0.15)


def test_a_locus_begins_in_the_poles_and_holds_the_closed_loops():
    one = fitted_of(COEFFICIENTS)
    loci = root_loci([one])
    key = lambda roots: sorted(roots, key=lambda root: (root.real, root.imag))  # noqa: E731
    np.testing.assert_allclose(key(loci.roots[0, 0]), key(loci.poles[0]), rtol=1e-9)
    system = control.TransferFunction(COEFFICIENTS[:3], np.concatenate([[1.0], COEFFICIENTS[3:]]))
    for index in (20, 80, 159):
        expected = control.feedback(float(loci.gain[index]) / system.dcgain() * system, 1).poles()
        np.testing.assert_allclose(key(loci.roots[index, 0]), key(expected), rtol=1e-6)
    np.testing.assert_allclose(key(loci.zeros[0]), key(system.zeros()), rtol=IDENTITY * 1e3)


def test_an_integrator_and_few_zeros_have_graphs_too():
    integrator = TransferMatrix(
        inputs=("v",),
        outputs=("x",),
        numerator=np.array([[[5.0]]]),
        denominator=np.array([1.0, 5.0, 0.0]),
        delay_samples=0,
        moving_average=1,
        sampling_period_s=0.01,
        hold="zoh",
    )
    both = [Fitted(integrator, np.zeros((3, 1))), fitted_of(COEFFICIENTS)]
    steps, loci = step_responses(both), root_loci(both)
    assert np.isfinite(steps.value).all()
    assert loci.zeros.shape == (2, 2)
    assert np.isnan(loci.zeros[0]).all()
    assert np.isfinite(loci.roots[:, 0, :2]).all()
