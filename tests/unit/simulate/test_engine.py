"""What every simulation does with the engine."""

import mujoco
import pytest

from robid.simulate.engine import quiet_mujoco

MODEL = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body><joint/><geom size='.1'/></body></worldbody></mujoco>")


def _seconds():
    data = mujoco.MjData(MODEL)
    for _ in range(20):
        mujoco.mj_step(MODEL, data)
    return data.timer[mujoco.mjtTimer.mjTIMER_STEP].duration


def test_the_engine_does_not_ask_for_the_time_while_it_is_quiet():
    assert _seconds() > 0
    with quiet_mujoco():
        assert _seconds() == 0
    assert _seconds() > 0


def test_an_error_gives_the_clock_back():
    with pytest.raises(KeyError), quiet_mujoco():
        raise KeyError
    assert _seconds() > 0
