"""Responses of several campaigns as one."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import exact_frf, friction_frf, two_joint_robot, with_spring_factors
from robid.errors import DataError
from robid.frf.joined import join
from tolerances import IDENTITY

CONFIGURATIONS = np.array([[-0.3, 0.5], [0.4, -1.0]])
FREQUENCY_HZ = np.geomspace(2.0, 60.0, 7)


def test_friction_moves_to_where_the_first_campaign_subtracted_it_exactly():
    left_out = np.array([[0.05, -0.1], [0.4, 0.3]])
    first, second = (
        replace(friction_frf(two_joint_robot(), CONFIGURATIONS, FREQUENCY_HZ, scales), coefficient_offset=-scales)
        for scales in left_out
    )
    joined = join([first, second], ["low", "high"])
    size = np.abs(first.response).max()
    np.testing.assert_allclose(joined.response[2:], first.response, rtol=IDENTITY, atol=IDENTITY * size)
    size = np.abs(first.sensitivity).max()
    np.testing.assert_allclose(joined.sensitivity[2:], first.sensitivity, rtol=IDENTITY, atol=IDENTITY * size)
    np.testing.assert_array_equal(joined.response[:2], first.response)
    np.testing.assert_array_equal(joined.configurations, np.concatenate([CONFIGURATIONS, CONFIGURATIONS]))


def on_grid(lines, period_s, configurations=CONFIGURATIONS, std=0.01):
    """Exact responses at the lines of a period, each with a standard deviation of one in a hundred."""
    frf = exact_frf(two_joint_robot(), configurations, np.asarray(lines) / period_s)
    n_out, n_in = frf.response.shape[2:]
    size = np.abs(frf.response).mean(axis=(2, 3))
    return replace(
        frf,
        lines=np.asarray(lines),
        input_factor=np.broadcast_to(np.eye(n_in) + 0j, (*frf.response.shape[:2], n_in, n_in)),
        total_covariance=(std * size[..., None, None]) ** 2 * np.eye(n_out) + 0j,
        total_degrees_of_freedom=20.0,
    )


def test_campaigns_of_different_lines_have_the_lines_of_both():
    low, high = on_grid(np.arange(4, 40), 2.0), on_grid(np.arange(30, 200, 5), 3.0)
    joined = join([low, high], ["low", "high"])
    wanted = np.unique(np.round(np.concatenate([low.frequency_hz, high.frequency_hz]), 9))
    np.testing.assert_allclose(joined.frequency_hz, wanted, rtol=IDENTITY)
    np.testing.assert_allclose(joined.lines / 6.0, joined.frequency_hz, rtol=IDENTITY)
    variance = joined.element_variance()
    for rows, own in ((slice(0, 2), low), (slice(2, 4), high)):
        at = np.searchsorted(joined.frequency_hz, own.frequency_hz - 1e-9)
        np.testing.assert_array_equal(joined.response[rows][:, at], own.response)
        np.testing.assert_array_equal(variance[rows][:, at], own.element_variance())
        assert np.isinf(np.delete(variance[rows], at, axis=1)).all()
        assert np.isfinite(joined.response[rows]).all()
    assert "low 36 from 2 to 19.5 Hz, high 34 from 10 to 65 Hz" in joined.notes[-1]


def test_campaigns_of_the_same_lines_drop_none():
    one = on_grid(np.arange(4, 40), 2.0)
    assert join([one, one], ["a", "b"]).dropped is None


def test_lines_that_were_dropped_before_stay_dropped():
    low, high = on_grid(np.arange(4, 40), 2.0), on_grid(np.arange(30, 200, 5), 3.0)
    dropped = np.zeros((2, 36, 2), bool)
    dropped[1, 7, 0] = True
    joined = join([replace(low, dropped=dropped), high], ["low", "high"])
    at = np.searchsorted(joined.frequency_hz, low.frequency_hz[7] - 1e-9)
    assert joined.dropped[1, at].tolist() == [True, False]
    same = join([replace(low, dropped=dropped), low], ["a", "b"])
    assert same.dropped.sum() == 1


def test_arbitrary_signals_of_one_resolution_have_the_same_lines_however_long_their_logs_are():
    resolution_hz, own = 1 / (333 * 0.003), np.arange(5, 60)
    frfs = [on_grid(own * segments, segments / resolution_hz) for segments in (30, 31, 47)]
    assert not np.array_equal(frfs[0].frequency_hz, frfs[1].frequency_hz)  # they differ by rounding
    joined = join(frfs, ["a", "b", "c"])
    assert joined.dropped is None
    np.testing.assert_allclose(joined.frequency_hz, own * resolution_hz, rtol=1e-12)
    coarse = on_grid(np.arange(4, 20) * 37, 37 / (0.5 * resolution_hz))
    both = join([frfs[0], coarse], ["a", "b"])
    assert len(both.frequency_hz) == len(np.union1d(2 * own, np.arange(4, 20)))


@pytest.mark.parametrize("other", [np.arange(4, 40), np.arange(4, 40, 3)])
def test_lines_that_share_windows_stay_correlated_beside_others_that_do_not(other):
    first, second = on_grid(np.arange(4, 40), 2.0), on_grid(other, 2.0)
    first = replace(first, line_correlation=np.full((2, 36, 3), 0.4))
    second = replace(second, line_correlation=np.full((2, len(other), 2), 0.3))
    for beside in (second, replace(second, line_correlation=None)):
        found = join([first, beside], ["a", "b"]).line_correlation
        np.testing.assert_array_equal(found[:2, :30, :3], 0.4)
        step = other[1] - other[0]
        assert (found[2, 0, step - 1] == 0.3) == (beside is second)
        turned = join([beside, first], ["b", "a"]).line_correlation
        np.testing.assert_array_equal(found, turned[[2, 3, 0, 1]])


def test_lines_without_a_common_grid_are_refused():
    with pytest.raises(DataError, match=r"no common grid: `a` 2 s, `b` 2\.0371 s") as caught:
        join([on_grid(np.arange(4, 40), 2.0), on_grid(np.arange(4, 40), 2.0371)], ["a", "b"])
    assert "period_s" in caught.value.remedy


def test_a_fit_takes_of_each_campaign_the_lines_that_it_has():
    from robid.frf.residual import LOGARITHM
    from robid.models.elastic.fit.fitting import fit_elastic
    from robid.models.elastic.fit.options import ElasticOptions
    from robid.models.elastic.fit.weights import make_weights

    nominal = with_spring_factors(two_joint_robot(), 1.3)
    low, high = on_grid(np.arange(4, 60), 2.0), on_grid(np.arange(40, 400, 5), 3.0, CONFIGURATIONS + 0.2)
    joined = join([low, high], ["low", "high"])
    spoiled = joined.response.copy()
    spoiled[np.isinf(joined.element_variance())] *= -5.0  # what was never measured must not matter
    options = ElasticOptions(free=("stiffness", "damping"), starts=1)
    below = [make_weights(each, options.weights, LOGARITHM)[1] for each in (joined, low, high)]
    assert below[0] == below[1] + below[2]  # what was never measured does not lie below 10 dB
    fits = [fit_elastic(nominal, replace(joined, response=each), options, 0.0) for each in (joined.response, spoiled)]
    for fit in fits:
        true = {spring.name: spring.stiffness for spring in two_joint_robot().springs}
        found = dict(zip(fit.estimate.names, fit.estimate.value, strict=True))
        for name, value in true.items():
            assert found[f"{name}.stiffness"] == pytest.approx(value, rel=1e-3)
        assert fit.costs.told == low.response.size + high.response.size
    np.testing.assert_allclose(fits[0].estimate.value, fits[1].estimate.value, rtol=1e-6)
