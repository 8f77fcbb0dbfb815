"""Families of models, known to the stages by this list alone. Read `family.py` for what one is, then `elastic/`."""

from __future__ import annotations

from collections.abc import Mapping

from robid.families.elastic import ELASTIC
from robid.families.family import Family

FAMILIES: Mapping[str, Family] = {family.name: family for family in (ELASTIC,)}
