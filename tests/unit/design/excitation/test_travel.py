"""A travel beneath an excitation: its reference, what it asks of the motors, and its limits."""

from dataclasses import replace

import numpy as np
import pytest

from exact_systems import ball_screw
from robid.design.excitation.excitation import Excitation, design_signal
from robid.design.excitation.lines import check_signal
from robid.design.excitation.loop import nominal_loop
from robid.design.excitation.options import MultisineOptions, Travel
from robid.design.excitation.prediction import predict, travel_demand, with_travel
from robid.errors import SettingsError
from robid.robot.description import StiffnessLaw
from robid.simulate.experiment import SimulatedExperiment, simulate, with_settled_steps
from robid.simulate.options import Controller, SimulateOptions

CONTROLLER = Controller(sampling_period_s=2.5e-4, position_gain_1_s=12.0, speed_bandwidth_hz=25.0, integral_time_s=0.4)
OPTIONS = MultisineOptions(
    period_s=2.0, low_hz=10, high_hz=100, count=20, inject="torque", rms=0.05, phase_iterations=0, detection_share=0
)
MIDDLE = np.array([[0.05]])
ROBOT = ball_screw(1)


def designed(travel):
    lines = np.arange(21, 190, 8)
    loop = nominal_loop(ROBOT, CONTROLLER, MIDDLE, lines / OPTIONS.period_s)
    excitation = design_signal(OPTIONS, 1, 1, 2.5e-4, loop)
    loop = loop.at(excitation.frequency_hz)
    return with_travel(excitation, travel, ROBOT, MIDDLE), loop


def test_its_reference_is_that_of_the_motors():
    excitation, _ = designed(Travel(joint="rail", amplitude_m=0.2, line=2))
    assert isinstance(excitation, Excitation)
    wanted = 125.7 * 0.2 * np.sin(2 * np.pi * 2 * np.arange(8000) / 8000)
    np.testing.assert_allclose(excitation.travel[:, 0], wanted, atol=1e-9)
    plain, _ = designed(None)
    np.testing.assert_array_equal(excitation.reference, plain.reference)
    assert plain.travel is None


def test_the_plan_counts_speed_and_torque_and_no_excursion():
    travelling, loop = designed(Travel(joint="rail", amplitude_m=0.2))
    plain, _ = designed(None)
    plans = [predict(each, loop, OPTIONS).plan for each in (travelling, plain)]
    demand = travel_demand(travelling.travel, loop, 0)
    rigid = np.pi * 0.2 * 125.7  # rad/s, where the loop follows at all
    assert 0.8 * rigid < np.abs(demand[0]).max() < 1.3 * rigid
    assert plans[0].speed_peak[0, 0] > np.abs(demand[0]).max()
    assert plans[0].torque_peak[0, 0] > plans[1].torque_peak[0, 0] + 0.5 * np.abs(demand[1]).max()
    np.testing.assert_allclose(plans[0].excursion_peak, plans[1].excursion_peak, rtol=1e-12)


def test_the_simulated_slide_goes_where_the_plan_says():
    excitation, loop = designed(Travel(joint="rail", amplitude_m=0.02))
    demand = travel_demand(excitation.travel, loop, 0)
    run = SimulatedExperiment(
        robot=ROBOT,
        controller=CONTROLLER,
        options=SimulateOptions(transient_periods=2),
        reference=0 * excitation.reference,
        inject="torque",
        excited_lines=excitation.excited_lines,
        detection_lines=excitation.detection_lines,
        periods=1,
        outputs=("rail.arm",),
        travel=excitation.travel,
    )
    record = simulate(run, MIDDLE[0], 0)
    speed = np.gradient(record.outputs[0, 0, 0, 0, :, 0], 2.5e-4)
    assert np.abs(speed - demand[0, :, 0])[5:-5].max() < 0.01 * np.abs(demand[0]).max()
    torque = record.inputs[0, 0, 0, 0, :, 0]
    assert np.abs(torque - demand[1, :, 0]).max() < 0.02 * np.abs(demand[1]).max()
    place = record.outputs[0, 0, 0, 0, :, 1] + record.output_offset[0, 1]
    assert place.mean() == pytest.approx(0.05, abs=1e-3)


def test_steps_are_those_of_the_whole_way():
    stiff = StiffnessLaw(0, "compliance", np.array([1.0, 3.2]))
    plain, _ = designed(None)
    counts = []
    for amplitude in (0.0, 0.34):
        run = SimulatedExperiment(
            robot=ball_screw(2, stiff),
            controller=CONTROLLER,
            options=SimulateOptions(),
            reference=plain.reference,
            inject="torque",
            excited_lines=plain.excited_lines,
            detection_lines=plain.detection_lines,
            periods=1,
            travel=125.7 * amplitude * np.sin(2 * np.pi * np.arange(8000) / 8000)[:, None] if amplitude else None,
        )
        counts.append(with_settled_steps(run, MIDDLE)[1].count)
    assert counts[1] > counts[0], counts


def test_joint_limits_hold():
    with pytest.raises(SettingsError) as error:
        designed(Travel(joint="rail", amplitude_m=0.36))
    assert "would travel from -0.31 to 0.41 m, beyond its limits of -0.4 and 0.4 m" in str(error.value)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (replace(OPTIONS, travel=Travel(joint="rail")), "needs one amplitude"),
        (replace(OPTIONS, travel=Travel(joint="rail", amplitude_m=0.1, amplitude_deg=3.0)), "needs one amplitude"),
        (replace(OPTIONS, travel=Travel(joint="rail", amplitude_m=0.1, line=500)), "lower travel.line"),
        (replace(OPTIONS, travel=Travel(joint="rail", amplitude_m=0.1), limit_share=0.5), "instead of limit_share"),
    ],
)
def test_what_cannot_be_made_is_refused(options, message):
    with pytest.raises(SettingsError) as error:
        check_signal(options, 2.5e-4)
    assert message in str(error.value)
