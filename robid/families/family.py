"""What a family of models is: everything that carries it from the experiment file to the page, as a value."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from robid.settings.experiment import Experiment
from robid.settings.fits import FitSettings, Read
from robid.settings.robot import RobotFile
from robid.settings.yaml import FieldPath


@dataclass(frozen=True)
class Family:
    """A kind of model.

    Attributes:
        name: What `family` says in an experiment file.
        settings: Type of its fits; its `family` is a literal of the name.
        reads: What of a campaign a fit reads.
        problems: Finds what is wrong with one of its fits for a robot, by the fit's name: fields below the fit and
            messages.
    """

    name: str
    settings: type[FitSettings]
    reads: tuple[Read, ...]
    problems: Callable[[Experiment, str, RobotFile], Iterator[tuple[FieldPath, str]]]
