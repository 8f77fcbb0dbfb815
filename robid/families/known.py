"""The families that there are, known to the stages by this list alone."""

from __future__ import annotations

from collections.abc import Mapping

from robid.families.elastic import ELASTIC
from robid.families.external import EXTERNAL
from robid.families.family import Family
from robid.families.lpv import LPV
from robid.families.rigid import RIGID

FAMILIES: Mapping[str, Family] = {family.name: family for family in (ELASTIC, RIGID, EXTERNAL, LPV)}
