"""Remedies of errors in the words of Python, where their own are those of files."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from robid.errors import RobidError, codes_in

_CHANNELS = (
    "state what the arrays are: `input_quantity`, `output_quantity` and `linear` of `make_record`, in SI units, and"
    " `outputs` of `estimate_frf`"
)
REMEDIES = {
    "D013": 'give `estimator="logarithmic"`: a record of arrays has no reference',
    "D014": _CHANNELS,
    "D022": "leave out the periods or realizations that have them",
    "D129": "give the robot's joints as `names` of `make_record`, in the order of its columns: `names=robot.joints`",
    "D149": "give a record that has these channels",
    "D158": _CHANNELS,
    "D216": "give `frequency_hz` to `make_record`, and `configurations` where the arms rest; records of a single motion"
    " are for rigid and external fits",
}
"""By the code of the error."""
_BLAMED = ("correct the log's mapping", "convert the arrays to SI units and radians, with the signs of the robot file")


@contextmanager
def in_words_of_python() -> Iterator[None]:
    """Gives errors of the block the remedies that stand here, where there is one."""
    try:
        yield
    except RobidError as error:
        named = next(iter(codes_in(error.what)), "")
        remedy = REMEDIES.get(named, error.remedy)
        error.remedy = _BLAMED[1] if error.remedy == _BLAMED[0] else remedy
        raise
