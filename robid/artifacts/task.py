"""The result of one task of a study: named arrays, each with its unit and axes.

Schema history:
    1.0: first version.
"""

from __future__ import annotations

from robid.artifacts.artifact import Kind

TASK = Kind("task", "1.0", "robid study")
