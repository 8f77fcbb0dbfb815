"""Responses of several campaigns as one."""

from dataclasses import replace

import numpy as np

from exact_systems import friction_frf, two_joint_robot
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
