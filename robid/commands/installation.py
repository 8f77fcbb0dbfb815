"""What is installed: packages that robid needs, and those that extras bring."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module, metadata
from importlib.util import find_spec
from typing import Annotated, Literal

from robid.arrays import Meaning
from robid.errors import RobidError
from robid.scaffold.examples import EXAMPLES, examples_folder

_MODULES = {"mujoco-core": "mujoco", "ruamel.yaml": "ruamel.yaml"}
"""Modules of packages that are called otherwise."""

_EXTRAS = {
    "control": (("control",), "models as objects of python-control"),
    "dask": (("distributed",), "work on many machines"),
    "fleet": (("pyarrow",), "tables of many robots"),
    "mdf": (("asammdf",), "logs in MDF"),
    "parquet": (("pyarrow",), "logs in Parquet and Arrow"),
    "ros": (("mcap", "rosbags"), "logs in MCAP and ROS bags"),
    "tdms": (("nptdms",), "logs in TDMS"),
    "uff": (("pyuff",), "responses as UFF58"),
}
_NEEDS = re.compile(r"([A-Za-z0-9._-]+)\s*>=\s*([0-9.]+)")


@dataclass(frozen=True)
class Check:
    """What a check found."""

    name: Annotated[str, Meaning("What was looked at.")]
    status: Annotated[Literal["ok", "failed", "absent"], Meaning("What was found; `absent` is what may be missing.")]
    text: Annotated[str, Meaning("What was found, in words.")]
    remedy: Annotated[str, Meaning("What to do.")] = ""


def installation() -> Iterator[Check]:
    """Looks at the packages and at what travels with robid."""
    try:
        requirements = metadata.requires("robid") or []
    except metadata.PackageNotFoundError:
        remedy = "install it: `pip install` of its wheel, or `make install` in a checkout"
        yield Check("robid", "failed", "S566 is not installed: nothing says which packages it needs", remedy)
        return
    for requirement in requirements:
        match = _NEEDS.match(requirement)
        if match and "extra ==" not in requirement:
            yield _package(match[1], match[2])
    for extra, (modules, gives) in _EXTRAS.items():
        yield _extra(extra, modules, gives)
    yield _examples()


def _package(name: str, least: str) -> Check:
    remedy = f"`pip install '{name}>={least}'`"
    try:
        import_module(_MODULES.get(name, name))
        found = metadata.version(name)
    except (ImportError, OSError) as error:
        return Check(name, "failed", f"S560 cannot be imported: {error}", remedy)
    if _numbers(found) < _numbers(least):
        return Check(name, "failed", f"S561 {found} is too old: robid needs {least}", remedy)
    return Check(name, "ok", found)


def _extra(extra: str, modules: tuple[str, ...], gives: str) -> Check:
    missing = [module for module in modules if find_spec(module) is None]
    name = f"extra {extra}"
    if missing:
        return Check(name, "absent", f"{gives}: without {', '.join(missing)}", f"`pip install 'robid[{extra}]'`")
    return Check(name, "ok", gives)


def _examples() -> Check:
    try:
        examples_folder()
    except RobidError as error:
        return Check("examples", "failed", error.what, error.remedy)
    return Check("examples", "ok", ", ".join(EXAMPLES))


def _numbers(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in re.findall(r"\d+", version)[:3])
