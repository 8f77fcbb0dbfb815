"""The study of position-dependent dynamics of Turk et al. (2018).

Read `check`, `section`; then its parts `known_structure` and `synthetic`, `local` and `moving`; then `parts`.
"""

from __future__ import annotations

from robid.studies.study import Procedure, Study
from robid.studies.turk2018.check import check_turk2018


def _procedure() -> Procedure:
    from robid.studies.joined import joined
    from robid.studies.turk2018.parts import PARTS, prepare

    return joined(PARTS, prepare, "one sparse model knows the ball screw wherever its slide is")


TURK2018 = Study(check_turk2018, _procedure)
