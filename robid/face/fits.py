"""Fits of data in memory, of whatever kind."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from robid.errors import DataError
from robid.face.arguments import Wanted, check_axes, in_order, shaped, wrong_type
from robid.face.parameters import Parameters
from robid.face.remedies import in_words_of_python
from robid.face.robots import RobotModel
from robid.frf.frf import Frf
from robid.models.residuals import RESIDUALS
from robid.models.values import FITS
from robid.signals.record import Record

if TYPE_CHECKING:
    from robid.results.finding import Finding
    from robid.results.fitted import Fitted
    from robid.results.grade import Grade
    from robid.results.residual import Residual


@dataclass(frozen=True)
class Fit:
    """A fit of data in memory."""

    found: Fitted  # All of it: `solution` and `validation` are those of its kind
    responses: Frf | None = None  # Responses that it was given; None for a kind that reads records

    @property
    def kind(self) -> str:
        """Its kind of model, as `elastic`."""
        return self.found.kind

    @cached_property
    def parameters(self) -> Parameters:
        """Its parameters with both intervals."""
        return Parameters(self.found.estimate)

    @property
    def grade(self) -> Grade | None:
        """How far to trust it; None without data that the fit never saw."""
        return self.found.held

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What speaks against it, the first to blame first."""
        return self.found.findings

    @property
    def sentence(self) -> str:
        """The grade, and why it is no better; without one, why there is none."""
        return self.found.sentence

    @cached_property
    def residual(self) -> Residual:
        """Its data less its model, and that whitened."""
        return RESIDUALS[self.kind](self.found.solution, self.responses)

    def __repr__(self) -> str:
        return f"{self.kind} fit, {self.parameters.counted}\n{self.parameters}\n{self.sentence}"


def fit_model(
    kind: Literal["elastic", "rigid", "external", "lpv", "transmission"],
    *data: Any,  # noqa: ANN401
    validate_on: Any = None,  # noqa: ANN401
    **options: Any,  # noqa: ANN401
) -> Fit:
    """Fits a model to data in memory, and grades it where there are data that the fit does not see.

    | kind | data | model |
    |---|---|---|
    | `elastic` | robot, responses | springs and dampers |
    | `rigid` | robot, one or several records | masses, inertias and friction |
    | `external` | one or several records, or responses | transfer functions from commands to motions |
    | `transmission` | robot, one or several records | stiffness, lost motion and transmission error of gears |
    | `lpv` | responses; `choose_on=` rows that only choose | one state-space model over positions |

    Args:
        kind: Kind of model.
        data: What the kind reads: a `RobotModel` where it needs one, then responses (`Frf`) or records (`Record`).
        validate_on: Data of the same sort that the fit does not see; without any, the fit has no grade and says so.
        options: Options of the kind's fit by name, as in an experiment file: `starts`, `free`, `order`; sections may be
            mappings. Besides, `delay_s` of elastic and rigid fits, the robot's when not given; `choose_on` of external
            and lpv fits; `scheduling` (columns of the configurations), `inputs`, `outputs` (names) and `basis` of lpv
            fits.

    Raises:
        SettingsError: If data are missing, of another type or in another order, or their arrays have other axes.
        DataError: If the kind is unknown, the data cannot be used as they are, or are those of `validate_on` too.
    """
    _check(kind, data, validate_on, options)
    if any(_same(each, other) for each in _flat(data) for other in _flat([validate_on])):
        what = "D500 the fit would be validated on data that it has read"
        raise DataError(what, where="fit_model", remedy="keep a part of the measurements for `validate_on`")
    plain = [each.description if isinstance(each, RobotModel) else each for each in data]
    robots = [each for each in data if isinstance(each, RobotModel)]
    if robots:
        options.setdefault("delay_s", robots[0].delay_s)
    options = {name: each.found if isinstance(each, Fit) else each for name, each in options.items()}
    responses = next((each for each in data if isinstance(each, Frf)), None)
    with in_words_of_python():
        return Fit(FITS[kind](*plain, validate_on=validate_on, **options), responses)


_ROBOT = Wanted("robot", RobotModel, "robid.load_robot(path)")
_RESPONSES = Wanted("responses", Frf, "robid.estimate_frf(record)")
_RECORD = Wanted("record", Record, "robid.make_record(...)")
_RECORDS = replace(_RECORD, name="records", several=True)
_READS = {
    "elastic": (_ROBOT, _RESPONSES),
    "rigid": (_ROBOT, _RECORDS),
    "external": (replace(_RECORDS, made_by="robid.make_record(...)` or, for responses, `robid.read_responses(...)"),),
    "lpv": (_RESPONSES,),
    "transmission": (_ROBOT, _RECORDS),
}
"""What each kind of model is fitted to; `external` besides to responses alone."""
_VALIDATES_ON = {
    "elastic": _RESPONSES,
    "rigid": _RECORDS,
    "external": _RECORD,
    "lpv": _RESPONSES,
    "transmission": _RECORDS,
}


def _check(kind: str, data: Sequence[object], validate_on: object, options: Mapping[str, object]) -> None:
    """Refuses data that are missing, of another type, in another order, or whose arrays have other axes."""
    if kind not in FITS:
        what, remedy = f"D293 there is no kind of model `{kind}`", f"it is {', '.join(FITS)}"
        raise DataError(what, where="fit_model", remedy=remedy)
    called = f"fit_model({kind})"
    rational = kind == "external" and any(isinstance(each, Frf) for each in data)
    in_order(data, (_RESPONSES,) if rational else _READS[kind], called)
    if validate_on is not None:
        wanted = _RESPONSES if rational else _VALIDATES_ON[kind]
        in_order((validate_on,), (replace(wanted, name="validate_on"),), called)
    if kind == "lpv" and "choose_on" not in options:
        what = "it needs `choose_on`: rows, from 0, of the positions that only choose the structure"
        raise wrong_type(what, called, "name some of them, as `choose_on=[2, 5]`")
    robots = [each for each in data if isinstance(each, RobotModel)]
    for each in _flat([*data, validate_on]):
        if isinstance(each, Frf | Record):
            check_axes(each, called)
            if robots and each.configurations is not None:
                shaped(each.configurations, "configurations", "n_conf n_joint", called, n_joint=len(robots[0].joints))


def _flat(data: Iterable[Any]) -> Iterator[Any]:
    for each in data:
        yield from each if isinstance(each, list | tuple) else (each,)


def _same(one: object, other: object) -> bool:
    """Whether two are the same measurement, by the values of their responses or samples."""
    for kind, name in ((Frf, "response"), (Record, "outputs")):
        if isinstance(one, kind) and isinstance(other, kind):
            return one is other or np.array_equal(getattr(one, name), getattr(other, name))
    return False
