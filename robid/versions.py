"""Versions of what decides the numbers."""

from __future__ import annotations

import platform

__version__ = "0.1.0"

_PACKAGES = ("numpy", "scipy", "mujoco-core", "nlopt", "h5py")


def package_versions() -> dict[str, str]:
    """Versions of Python, robid and the packages that decide its numbers."""
    from importlib import metadata

    versions = {"python": platform.python_version(), "robid": __version__}
    for name in _PACKAGES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = "not installed"
    return versions
