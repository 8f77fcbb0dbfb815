"""Options from Python: sections as mappings, values of their declared type and within their limits."""

from dataclasses import dataclass
from typing import Literal

import pytest

from robid.arrays import group, option
from robid.design.configurations.options import DesignOptions
from robid.errors import DataError
from robid.frf.options import EstimateOptions
from robid.models.elastic.fit.options import ElasticOptions
from robid.models.external.fit.options import ExternalOptions
from robid.models.lpv.fit.options import LpvOptions
from robid.models.rigid.fit.options import RigidFitOptions
from robid.results.options import options_from


@dataclass(frozen=True)
class Inner:
    """A section."""

    kind: Literal["one", "two"] = option("one", "")


@dataclass(frozen=True)
class Outer:
    """Options."""

    count: int = option(1, "", ge=1)
    share: float = option(0.5, "", gt=0, lt=1)
    names: tuple[str, ...] = option((), "")
    ends: tuple[float, float] = option((0.0, 1.0), "")
    limit: float | None = option(None, "")
    yes: bool = option(True, "")
    inner: Inner = group(Inner, "")


def test_values_as_an_experiment_file_has_them_become_options():
    given = {"count": 3, "share": 0.25, "names": ["a"], "ends": [1, 2.0], "limit": 2, "inner": {"kind": "two"}}
    assert options_from(Outer, given, "call") == Outer(3, 0.25, ("a",), (1, 2.0), 2, inner=Inner("two"))


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("count", 0), ("count", 2.5), ("count", "2"), ("count", True), ("share", 1.0), ("share", None)),
        *(("names", "axis_1"), ("names", [1]), ("ends", [1.0]), ("limit", "x"), ("yes", "no"), ("inner", "one")),
    ],
)
def test_a_value_that_an_option_cannot_have_is_refused_by_its_name(name, value):
    with pytest.raises(DataError) as refused:
        options_from(Outer, {name: value}, "call")
    assert refused.value.codes == ("D291",)
    assert f"`{name}`" in str(refused.value)


def test_a_section_refuses_with_its_place():
    with pytest.raises(DataError, match="call, inner") as refused:
        options_from(Outer, {"inner": {"kid": "two"}}, "call")
    assert refused.value.codes == ("D290",)


@pytest.mark.parametrize(
    "kind", [DesignOptions, EstimateOptions, ElasticOptions, ExternalOptions, LpvOptions, RigidFitOptions]
)
def test_defaults_of_every_algorithm_are_values_that_its_options_may_have(kind):
    whole = kind()
    assert options_from(kind, {name: getattr(whole, name) for name in kind.__dataclass_fields__}, "call") == whole
