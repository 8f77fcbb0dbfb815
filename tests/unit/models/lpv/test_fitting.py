"""What a position-dependent fit takes of responses: channels, variances, and where each of them was."""

from types import SimpleNamespace

import numpy as np
import pytest

from robid.errors import DataError
from robid.models.lpv.fitting import findings_of_scheduling, findings_of_signals, responses_of
from robid.signals.quantities import Channel

LOADED = SimpleNamespace(robot=SimpleNamespace(joints=[SimpleNamespace(name="turn"), SimpleNamespace(name="lift")]))


def frf():
    generator = np.random.default_rng(1)
    response = generator.standard_normal((3, 4, 2, 2)) + 1j
    return SimpleNamespace(
        response=response,
        element_variance=lambda: np.abs(response),
        frequency_hz=np.arange(1.0, 5.0),
        output_names=("turn", "tool"),
        input_names=("turn", "lift"),
        configurations=np.arange(6.0).reshape(3, 2),
        mean_output=np.array([[0.1, 7.0], [0.2, 8.0], [0.3, 9.0]]),
        sampling_period_s=1e-3,
    )


def settings(**changes):
    return SimpleNamespace(**{"inputs": (), "outputs": (), "scheduling": ("lift",), **changes})


def test_a_joint_or_the_mean_of_an_output_schedules():
    found = responses_of(frf(), LOADED, settings(scheduling=("lift", "tool")))
    np.testing.assert_array_equal(found.points, [[1, 7], [3, 8], [5, 9]])
    bare = frf()
    bare.mean_output = None
    with pytest.raises(DataError, match="do not say where `tool` was"):
        responses_of(bare, LOADED, settings(scheduling=("tool",)))


def test_channels_are_chosen_by_name():
    own = frf()
    found = responses_of(own, LOADED, settings(inputs=("lift",), outputs=("tool", "turn")))
    np.testing.assert_array_equal(found.response, own.response[:, :, [1, 0]][..., [1]])
    np.testing.assert_array_equal(found.variance, np.abs(found.response))
    with pytest.raises(DataError, match="D178 the response has no input `twist`"):
        responses_of(own, LOADED, settings(inputs=("twist",)))


def test_what_is_missing_is_left_out_and_an_unknown_variance_is_none():
    own = frf()
    own.response[1, 2, 0, 1] = np.nan
    found = responses_of(own, LOADED, settings())
    assert np.argwhere(np.isinf(found.variance)).tolist() == [[1, 2, 0, 1]]
    silent = frf()
    silent.element_variance = lambda: np.zeros(silent.response.shape)
    assert responses_of(silent, LOADED, settings()).variance is None


@pytest.mark.parametrize(("moved", "found"), [(0.1, []), (0.5, [False]), (3.0, [True])])
def test_an_output_that_schedules_must_stand_still_beside_its_range(moved, found):
    own = frf()
    own.motion_rms = np.array([[9.0, 0.01], [9.0, moved], [9.0, 0.02]])
    own.configurations = np.zeros((3, 2))
    findings = list(findings_of_scheduling(own, LOADED, settings(scheduling=("tool",))))
    assert [finding.decisive for finding in findings] == found
    assert all(f"tool moved by {moved / 2:.0%} (rms) of its range" in finding.message for finding in findings)
    assert not list(findings_of_scheduling(own, LOADED, settings(scheduling=("lift",))))


@pytest.mark.parametrize(("share", "decisive"), [(0.02, False), (0.2, True)])
def test_saturated_signals_of_a_fit_are_doubted_and_those_it_does_not_read_are_not(share, decisive):
    own = frf()
    own.input_channels = tuple(Channel(name, "torque", "N m", "motor") for name in own.input_names)
    own.measured_channels = (
        Channel("turn", "speed", "rad/s", "motor"),
        Channel("tool", "acceleration", "m/s^2", "tool"),
    )
    own.saturated_inputs, own.saturated_outputs = np.zeros((3, 2)), np.zeros((3, 2))
    own.saturated_inputs[1, 0] = own.saturated_outputs[2, 1] = share
    found = findings_of_signals(own, settings())
    assert [finding.message.partition(" saturates for")[0] for finding in found] == [
        "turn: torque",
        "tool: acceleration",
    ]
    assert all((finding.cause, finding.decisive) == ("saturation", decisive) for finding in found)
    assert all(f"{100 * share:.2g} % of the time" in finding.message for finding in found)
    (finding,) = findings_of_signals(own, settings(inputs=("lift",)))
    assert finding.message.startswith("tool")
    assert findings_of_signals(own, settings(inputs=("lift",), outputs=("turn",))) == ()
    own.saturated_inputs = own.saturated_outputs = None
    assert findings_of_signals(own, settings()) == ()
