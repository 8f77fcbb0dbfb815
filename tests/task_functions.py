"""A tiny study's function, a map without processes, and a progress that remembers."""

import numpy as np

from robid.artifacts.artifact import Dataset
from robid.errors import DataError
from robid.studies.study import Content

CALLS = []


def square(number):
    CALLS.append(number)
    if number < 0:
        raise DataError("a number below 0", where=str(number), remedy="take another")
    return Content({"square": Dataset(np.array(number**2), "m^2", ())})


def map_in_order(function, tasks, on_done=None):
    results = []
    for index, task in enumerate(tasks):
        results.append(function(task))
        if on_done is not None:
            on_done(index, results[-1])
    return results


class Told:
    def __init__(self):
        self.expected, self.advanced = None, 0

    def expect(self, total, unit, done=0):
        self.expected = (total, unit, done)

    def advance(self):
        self.advanced += 1
