"""What a sentence asks to free can be estimated: names that the fit takes, and none where it would refuse."""

import pytest

from exact_systems import two_joint_robot
from robid.models.elastic.fit.nuisance.listing import estimated_nuisances, list_nuisances
from robid.models.elastic.fit.nuisance.wording import remedy
from robid.models.elastic.fit.options import ElasticOptions
from robid.robot.parameters import ELASTIC

NEVER = "gear_1.hysteresis_never"


def nuisances(*names, options=None):
    every = {nuisance.name: nuisance for nuisance in list_nuisances(two_joint_robot(), options or ElasticOptions())}
    return [every[name] for name in names]


@pytest.mark.parametrize(
    ("named", "free"),
    [
        (["gear_1.hysteresis_early"], ("gear_1.hysteresis",)),
        (["gear_2.hysteresis_late", "gear_2.hysteresis_early"], ("gear_2.hysteresis",)),
        (["gear_2.hysteresis_late", "gear_1.hysteresis_late"], ("gear_2.hysteresis", "gear_1.hysteresis")),
        (["gear_2.hysteresis_late", "gear_1.load_stiffness"], ("gear_2.hysteresis",)),
        (["gear_1.load_stiffness", "gear_2.hysteresis_late"], ("cubic",)),
        ([NEVER], ()),
    ],
)
def test_hysteresis_is_estimated_by_gear(named, free):
    found = remedy(nuisances(*named), swings_known=True)
    assert found == free
    assert remedy(nuisances(*named), swings_known=False) == ()
    of_kinds = [name for name in free if name in ELASTIC]
    assert len(estimated_nuisances(two_joint_robot(), ElasticOptions(free=found))) == len(free) - len(of_kinds)


def test_springs_that_are_held_are_estimated_as_kinds():
    without = ElasticOptions(free=("viscous", "stiffness"), fixed=("gear_1.stiffness",))
    found = remedy(nuisances("gear_2.damping", "gear_1.stiffness", options=without), swings_known=True)
    assert found == ("damping", "stiffness")


def test_viscous_friction_is_estimated_as_a_kind():
    without = ElasticOptions(free=("stiffness", "damping"))
    found = remedy(nuisances("elbow.viscous", "elbow.friction_loss", options=without), swings_known=True)
    assert found == ("viscous",)
    assert remedy(nuisances("elbow.friction_loss"), swings_known=True) == ()
