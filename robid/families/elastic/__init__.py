"""The elastic family: springs and dampers from frequency responses.

Read `settings.py`, `fitting.py`, `truth.py`, then what goes out: `page/`, `exports.py` with `mechanics.py`.
"""

from __future__ import annotations

from robid.families.elastic.exports import EXPORTS
from robid.families.elastic.fitting import (
    fit,
    model_settings,
    phrase_of_model,
    validate,
    values_in,
    verdict_of_validation,
)
from robid.families.elastic.page.report import compare, report
from robid.families.elastic.settings import ElasticFit, problems
from robid.families.family import Family

ELASTIC = Family(
    name="elastic",
    settings=ElasticFit,
    reads=("frf",),
    problems=problems,
    decides=model_settings,
    fit=fit,
    validate=validate,
    seed=lambda settings: settings.seed if isinstance(settings, ElasticFit) else None,
    true_values=values_in,
    phrase=phrase_of_model,
    verdict=verdict_of_validation,
    report=report,
    compare=compare,
    exports=EXPORTS,
)
