"""The plan of an excitation in the terminal."""

from dataclasses import replace

import numpy as np

from robid.design.excitation.excitation import design_excitation
from robid.design.excitation.prediction import predict
from robid.report.experiment import plan_table
from terminals import screen
from two_drives import OPTIONS, STEP, make_loop


def planned():
    options = replace(OPTIONS, phase_iterations=0, rms=(5.0, 4.0))
    excitation = design_excitation(options, 2, 2, STEP)
    return predict(excitation, make_loop(excitation, static=[[0.0, 0.0], [3.0, -9.0]]), options, periods=4)


def printed(excitation, width=80):
    return screen(plan_table(excitation, ("shoulder", "elbow")), width)


def test_each_motor_shows_peaks_against_limits_and_its_weakest_line():
    excitation = planned()
    text, plan = printed(excitation, 100), excitation.plan
    rows = {line.split()[0]: line for line in text.splitlines()}
    for motor, name in enumerate(("shoulder", "elbow")):
        assert f"{plan.torque_peak[:, motor].max():.2g}/60" in rows[name]
        assert f"{plan.speed_peak[:, motor].max():.2g}/100" in rows[name]
        assert f"{excitation.crest_factor[..., motor].max():.2f}" in rows[name]
        assert f" {plan.snr_db[:, :, motor, motor].min():.0f} " in rows[name]
    assert "takes 32.0 s" in text
    assert "…" not in text


def test_the_weakest_pair_is_named():
    excitation = planned()
    snr_db = np.full_like(excitation.plan.snr_db, 50.0)
    snr_db[..., 1, 0] = 7.0
    text = printed(replace(excitation, plan=replace(excitation.plan, snr_db=snr_db)))
    assert "shoulder to elbow, 7 dB" in " ".join(text.split())


def test_an_older_plan_shows_what_it_has_and_a_log_shows_nothing():
    excitation = planned()
    old = replace(excitation.plan, snr_db=None, speed_crest=None, duration_s=None)
    text = printed(replace(excitation, plan=old))
    assert "SNR" not in text
    assert "/60" in text
    assert plan_table(replace(excitation, plan=None), ("shoulder", "elbow")) is None
