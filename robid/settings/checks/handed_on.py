"""What must hold of the names of fits that campaigns and other fits take something of."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TypeAlias

from robid.settings.experiment import Experiment
from robid.settings.fits import HandedOn
from robid.settings.problems import suggest
from robid.settings.yaml import FieldPath

_Found: TypeAlias = Iterator[tuple[FieldPath, str]]
_WHAT: Mapping[HandedOn, str] = {
    "friction": "Coulomb friction: name one of family `rigid` with `model: {friction: coulomb}` or `asymmetric`",
    "standard": "masses and inertias: name one of family `rigid` with `physical: true`",
}
_KEYS: Mapping[HandedOn, str] = {"standard": "rigid"}


def check_handed_on(experiment: Experiment) -> _Found:
    """Yields fits that are named but are not there, or do not hand on what is wanted of them."""
    for name, campaign in experiment.campaigns.items():
        wanted = campaign.estimate.friction_fit
        if wanted is not None:
            yield from _named(experiment, ("campaigns", name, "estimate", "compensation", "fit"), wanted, "friction")
    for name, fit in experiment.fits.items():
        for what, other in fit.takes.items():
            yield from _named(experiment, ("fits", name, _KEYS.get(what, what)), other, what)


def _named(experiment: Experiment, field: FieldPath, name: str, what: HandedOn) -> _Found:
    fit = experiment.fits.get(name)
    if fit is None:
        yield field, f"there is no fit `{name}`; {suggest(name, experiment.fits)}"
    elif what not in fit.hands_on:
        yield field, f"fit `{name}` of family `{fit.family}` hands on no {_WHAT[what]}"
