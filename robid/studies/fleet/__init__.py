"""The study of fleets: faults among many logged robots, and the speed of `robid reprocess`.

Read `check`, `robots`, `faults`; then its parts `logs`, `whole`, `speed` and `scheduler`; then `parts`.
"""

from __future__ import annotations

from robid.studies.fleet.check import check_fleet
from robid.studies.study import Procedure, Study


def _procedure() -> Procedure:
    from robid.studies.fleet.parts import PARTS, prepare
    from robid.studies.joined import joined

    return joined(PARTS, prepare, "faults are found in a large fleet, and cores are used")


FLEET = Study(check_fleet, _procedure)
