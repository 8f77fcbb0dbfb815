import numpy as np
import pytest

from robid.studies.frf.study import (
    Compared,
    bias_figures,
    default_sentence,
    estimator_figures,
    following_default,
)

GROUPS = (1, 50, 4, 2, 2)


def estimates(std, seed):
    generator = np.random.default_rng(seed)
    noise = generator.standard_normal(GROUPS) + 1j * generator.standard_normal(GROUPS)
    return 1 + std * noise / np.sqrt(2)


def figures(ratio, half_width):
    ends = {"over_default_lower": ratio - half_width, "over_default_upper": ratio + half_width}
    return {"over_default": ratio, **ends}


def estimator(name, ratio, half_width=0.01):
    return Compared(name, np.ones(1), figures(ratio, half_width))


def test_figures_of_a_known_spread():
    reference = np.ones((1, *GROUPS[2:]), complex)
    quiet, loud = estimates(0.01, 1), estimates(0.03, 2)
    loud[..., 0, 1] = 1 + 10 * (loud[..., 0, 1] - 1)
    found = estimator_figures("loud", loud, np.full(GROUPS, 0.03**2), reference, quiet).figures
    assert found["diagonal.median_error"] == pytest.approx(0.03, rel=0.15)
    assert found["off_diagonal.q90_error"] == pytest.approx(0.3, rel=0.25)
    assert found["diagonal.std_ratio"] == pytest.approx(1, rel=0.15)
    assert found["over_default_lower"] < found["over_default"] < found["over_default_upper"]
    assert found["over_default_lower"] > 2
    assert found["refused"] == 0


def test_refused_groups_are_counted():
    one = estimates(0.01, 1)
    one[0, 3] = np.nan
    found = estimator_figures("one", one, np.ones(GROUPS), np.ones((1, *GROUPS[2:]), complex), one)
    assert found.figures["refused"] == 1
    assert found.figures["median_error"] == pytest.approx(0.01, rel=0.15)


def test_bias_is_the_distance_to_the_truth():
    truth = np.full((2, 3, 2, 2), 2 + 1j)
    whole = truth * np.array([[1.02, 1.1], [1.1, 0.98]])
    found = bias_figures("none", whole, np.stack([whole, whole], axis=1), truth)
    assert found.figures["median_diagonal"] == pytest.approx(0.02)
    assert found.figures["median_off_diagonal"] == pytest.approx(0.1)
    np.testing.assert_allclose(found.error_hz, 0.02)


def test_a_default_changes_only_where_another_is_surely_and_markedly_closer():
    own = estimator("a", 1.0, 0.0)
    assert following_default([own, estimator("b", 0.9)], "a") == "b"
    assert following_default([own, estimator("b", 0.9, 0.2)], "a") == "a"
    assert following_default([own, estimator("b", 0.985, 0.001)], "a") == "a"
    assert following_default([own, estimator("b", 0.9), estimator("c", 0.8)], "a") == "c"
    assert default_sentence([own, estimator("b", 0.8), estimator("c", 0.7, 0.4)], "a").startswith("Estimator b should")
    refused = estimator("d", float("nan"))
    assert following_default([own, refused], "a") == "a"
    assert default_sentence([own, refused], "a").endswith("nothing else was compared.")
    assert "the best other, b, is 0.980" in default_sentence([own, estimator("b", 0.98)], "a")
