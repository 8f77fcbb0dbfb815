"""Versions of what decides the numbers."""

from __future__ import annotations

import platform
from functools import cache

__version__ = "0.1.0"

_PACKAGES = ("numpy", "scipy", "mujoco-core", "nlopt", "h5py")


def package_versions() -> dict[str, str]:
    """Versions of Python, robid and the packages that decide its numbers."""
    return {"python": platform.python_version(), "robid": __version__, **{name: _version(name) for name in _PACKAGES}}


@cache
def _version(name: str) -> str:
    """What is installed of a package, looked up once: to read it takes some milliseconds."""
    from importlib import metadata

    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"
