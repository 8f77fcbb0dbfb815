"""Remedies that a caller from Python gets name arguments, not sections of files."""

import re
from dataclasses import replace

import numpy as np
import pytest

import robid
from exact_systems import exact_frf, two_joint_robot
from message_codes import codes_written
from robid.errors import DataError
from robid.face.remedies import REMEDIES, in_words_of_python
from robid.results.finding import Finding, blamed

ARM = robid.RobotModel(two_joint_robot(), 1e-3)
LINES = np.array([3.0, 8.0, 20.0, 45.0])
MEASURED = exact_frf(ARM.description, [[0.1, 0.3]], LINES, declared_noise=0.01)
FILES = re.compile(r"`acquire`|`from`|mapping|campaign|import")


def channels(frf, **changed):
    return replace(frf, output_channels=tuple(replace(one, **changed) for one in frf.output_channels))


CALLS = {
    "D014": lambda: robid.fit_model("elastic", ARM, channels(MEASURED, quantity="speed", unit="rad/s")),
    "D129": lambda: robid.fit_model("elastic", ARM, replace(MEASURED, input_channels=MEASURED.input_channels[::-1])),
    "D216": lambda: robid.estimate_frf(robid.make_record(np.ones((30, 1)), np.ones((30, 1)), 1e-3)),
}


@pytest.mark.parametrize("code", CALLS)
def test_an_error_of_a_call_has_a_remedy_for_python(code):
    with pytest.raises(DataError) as refused:
        CALLS[code]()
    assert refused.value.codes[0] == code
    assert refused.value.remedy == REMEDIES[code]


def test_every_remedy_is_of_a_message_and_names_no_section_of_a_file():
    assert set(REMEDIES) <= set(codes_written())
    assert [code for code, remedy in REMEDIES.items() if FILES.search(remedy)] == []


def test_what_a_wrong_scale_explains_is_not_blamed_on_a_log():
    finding = Finding("torque_sign", "x", True, 2.0, scales=("a",))
    with pytest.raises(DataError) as refused, in_words_of_python():
        raise blamed(DataError("D131 nothing"), [finding])
    assert not FILES.search(refused.value.remedy)
