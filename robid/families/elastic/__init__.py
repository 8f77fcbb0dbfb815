"""The elastic family: springs and dampers from frequency responses. Read `settings.py` first."""

from __future__ import annotations

from robid.families.elastic.settings import ElasticFit, problems
from robid.families.family import Family

ELASTIC = Family(name="elastic", settings=ElasticFit, reads=("frf",), problems=problems)
