"""How often the structure of known systems was found."""

import numpy as np

from robid.studies.turk2018.synthetic import POSITIONS, count_structures, synthetic_systems


def kept(*names):
    found = np.zeros((4, 4), bool)
    for name in names:
        found["ABCD".index(name[0]), int(name[1]) - 1] = True
    return found


def test_structures_are_counted_by_their_blocks():
    runs = np.array([kept("A1", "B2"), kept(), kept("A1", "B2"), kept("A1", "B2", "D4")])
    assert count_structures(runs) == {"A1, B2": 2, "none": 1, "A1, B2, D4": 1}


def test_the_known_systems_have_the_structure_that_is_told():
    systems = synthetic_systems(POSITIONS, np.eye(3))
    powers = np.linalg.solve(POSITIONS ** np.arange(5), np.reshape(systems.A, (5, -1)))
    assert (np.abs(powers).max(axis=1) > 1e-9).tolist() == [True, True, False, False, False]
    powers = np.linalg.solve(POSITIONS ** np.arange(5), np.reshape(systems.B, (5, -1)))
    assert (np.abs(powers).max(axis=1) > 1e-9).tolist() == [True, False, True, False, False]
    assert np.ptp(systems.C, axis=0).max() == np.ptp(systems.D, axis=0).max() == 0
