"""The families that there are, known to the stages by this list alone."""

from __future__ import annotations

from collections.abc import Mapping

from robid.models.elastic.family import ELASTIC
from robid.models.external.family import EXTERNAL
from robid.models.family import Family
from robid.models.lpv.family import LPV
from robid.models.rigid.family import RIGID

FAMILIES: Mapping[str, Family] = {family.name: family for family in (ELASTIC, RIGID, EXTERNAL, LPV)}
