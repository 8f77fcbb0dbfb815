"""The study of robust regression of Janot et al. (2009).

Read `check`, `section`, `seeded`; then its parts `haptic`, `branch`, `emps`, `tx40` and `kr300`; then `parts`.
"""

from __future__ import annotations

from robid.studies.janot2009.check import check_janot2009
from robid.studies.study import Procedure, Study


def _procedure() -> Procedure:
    from robid.studies.janot2009.parts import PARTS, prepare
    from robid.studies.joined import joined

    return joined(PARTS, prepare, "the verdict on least squares is right")


JANOT2009 = Study(check_janot2009, _procedure)
