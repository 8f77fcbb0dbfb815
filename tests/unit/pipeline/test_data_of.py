"""Where the configurations of a fit come from."""

from types import SimpleNamespace

import numpy as np
import pytest

from robid.pipeline.fit import data_of
from sample_reports import arm_report


@pytest.mark.parametrize(("chosen", "expected"), [(None, None), ((3, 0), (3, 0))])
def test_each_configuration_knows_its_campaign_and_its_place_there(chosen, expected):
    frf = arm_report().fit.frf
    first, second = frf.select([0, 1]), frf.select([2, 0])
    fit = SimpleNamespace(campaigns=("day", "night"), configurations=chosen)
    loaded = SimpleNamespace(experiment=SimpleNamespace(fits={"arm": fit}))
    data = data_of(loaded, "arm", [first, second])
    every = [("day", 0), ("day", 1), ("night", 0), ("night", 1)]
    assert [*zip(data.origins, data.rows, strict=True)] == [every[index] for index in expected or range(4)]
    sources = {"day": first, "night": second}
    for index, (campaign, row) in enumerate(zip(data.origins, data.rows, strict=True)):
        np.testing.assert_array_equal(data.response.configurations[index], sources[campaign].configurations[row])
