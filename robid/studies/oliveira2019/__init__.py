"""The study of external dynamics of Oliveira et al. (2019).

Read `check`, `section`; then its parts `plants`, `synthetic`, `arm` and `emps`; then `parts`.
"""

from __future__ import annotations

from robid.studies.oliveira2019.check import check_oliveira2019
from robid.studies.study import Procedure, Study


def _procedure() -> Procedure:
    from robid.studies.joined import joined
    from robid.studies.oliveira2019.parts import PARTS, prepare

    return joined(PARTS, prepare, "commands explain positions as well as is promised")


OLIVEIRA2019 = Study(check_oliveira2019, _procedure)
