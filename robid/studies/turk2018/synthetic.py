"""Position-dependent systems of known structure, measured with noise, and how often exactly that is found."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import numpy as np

from robid.arrays import BoolArray, FloatArray
from robid.artifacts.artifact import Dataset
from robid.models.lpv.fit.fitting import LpvResult, estimate_lpv
from robid.models.lpv.fit.model import polynomial_basis
from robid.models.lpv.fit.options import LpvOptions
from robid.models.lpv.fit.responses import LocalResponses
from robid.models.lpv.fit.state_space import StateSpace, block_names, response, transform
from robid.pipeline.graph import Run
from robid.report.section import Section, Table
from robid.settings.robot_parts import plain_settings
from robid.studies.page import Asked, PartFound
from robid.studies.settings.parts import KnownStructureCase
from robid.studies.study import Content, Part, Results, Task, in_chunks

POSITIONS: FloatArray = np.array([-1.0, -0.5, 0.0, 0.5, 1.0])[:, None]
LEFT_OUT: FloatArray = np.array([[-0.25]])
FREQUENCY: FloatArray = np.linspace(0.002, 0.4, 200)
ORDER = 3
STRUCTURE = ("A1", "B2")
NOISE = 0.01  # of an output's rms: 40 dB

_A = (
    np.array([[0.9, 0.05, 0.0], [0.0, 0.9112, 0.3326], [0.03, -0.3326, 0.9112]]),
    np.array([[0.0, 0.02, 0.0], [0.0, 0.0, 0.06], [0.01, -0.06, 0.0]]),
)
_B = np.array([[0.5], [0.1], [0.4]]), np.array([[0.1], [-0.05], [0.2]])
_C = np.array([[1.0, 0.3, 0.1], [0.5, -0.4, 0.6]])
_D = np.array([[0.02], [0.05]])


def synthetic_systems(points: FloatArray, T: FloatArray) -> StateSpace:
    """Returns the system in the states `T x` at points (n_pos, 1).

    A is affine, B has one quadratic block, C and D are constant.
    """
    p = points[:, :, None]
    ones = np.ones_like(p)
    return transform(StateSpace(_A[0] + _A[1] * p, _B[0] + _B[1] * p**2, _C * ones, _D * ones), T)


def synthetic_responses(points: FloatArray, T: FloatArray, generator: np.random.Generator) -> LocalResponses:
    """Returns the system's responses at points (n_pos, 1) with noise of known variance."""
    exact = response(synthetic_systems(points, T), np.exp(2j * np.pi * FREQUENCY))
    power = NOISE**2 * np.mean(np.abs(exact) ** 2, axis=1, keepdims=True)
    variance = np.broadcast_to(power, exact.shape)
    error = generator.standard_normal((*exact.shape, 2)) @ np.array([1, 1j]) * np.sqrt(variance / 2)
    return LocalResponses(points, FREQUENCY, exact + error, variance, 1.0)


def fit_synthetic(seed: int, options: LpvOptions) -> LpvResult:
    """Fits one noisy draw, the system in a random basis; as many functions as positions, as in the paper."""
    generator = np.random.default_rng(seed)
    T = generator.standard_normal((3, 3))
    fitted, held_out = (synthetic_responses(points, T, generator) for points in (POSITIONS, LEFT_OUT))
    return estimate_lpv(fitted, held_out, polynomial_basis(POSITIONS, 4), options)


_ASKED = Asked(lower=0.95)


def _synthetic_tasks(_run: Run, case: KnownStructureCase, _earlier: Mapping[str, Results]) -> list[Task]:
    chunks = in_chunks(case.first_seed, case.runs, case.runs_per_task)
    options = plain_settings(LpvOptions(order=ORDER))
    return [Task(f"runs_{seeds.start}", {"seeds": [*seeds], "options": options}, (seeds,)) for seeds in chunks]


def find(seeds: range) -> Content:
    """Identifies some systems with the default options."""
    kept = np.array([fit_synthetic(seed, LpvOptions(order=ORDER)).kept for seed in seeds])
    return Content({"kept": Dataset(kept, "1", ("run", "matrix", "function"), "Blocks of A, B, C, D that were found")})


def _conclude_synthetic(_run: Run, _case: KnownStructureCase, results: Results) -> PartFound:
    kept = np.concatenate([one.datasets["kept"].values for one in results])
    found = count_structures(kept)
    share = found.get(", ".join(STRUCTURE), 0) / len(kept)
    figures = {"synthetic.runs": float(len(kept)), "synthetic.exact_structure_share": share}
    rows = tuple((name, str(count)) for name, count in found.items())
    table = Table(("Blocks found", "Runs"), rows, fit="compact")
    lead = (
        f"Three states, two outputs, A affine in the scheduling parameter, one quadratic block of B, constant C and D:"
        f" of 16 blocks {' and '.join(STRUCTURE)} are there. Each run has noise of 40 dB and another basis of states."
    )
    section = Section("Systems of known structure", lead, (table,))
    return PartFound(figures, {"synthetic.exact_structure_share": _ASKED}, (section,))


def count_structures(kept: BoolArray) -> dict[str, int]:
    """Counts the structures (n_run, 4, n_function) by the names of their blocks, the most frequent first."""
    return dict(Counter(", ".join(block_names(one)) or "none" for one in kept).most_common())


KNOWN_STRUCTURE = Part("synthetic", _conclude_synthetic, _synthetic_tasks, find)
