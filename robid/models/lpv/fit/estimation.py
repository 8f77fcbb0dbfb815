"""The whole fit: local models, one basis, interpolation, sparse fits, choice and intervals."""

from __future__ import annotations

from dataclasses import dataclass

from robid.arrays import BoolArray, FloatArray
from robid.models.lpv.fit.alignment import align_neighbours, middle_position
from robid.models.lpv.fit.bands import model_response, rescaled
from robid.models.lpv.fit.basis import Basis, different_positions
from robid.models.lpv.fit.blocks import spread
from robid.models.lpv.fit.local import LocalModels, fit_local_models
from robid.models.lpv.fit.model import LpvModel, Stability, add_integrators, check_stability
from robid.models.lpv.fit.options import LpvOptions
from robid.models.lpv.fit.path import Path, follow_path
from robid.models.lpv.fit.problem import Problem, solve
from robid.models.lpv.fit.responses import LocalResponses, make_problem, output_scales, remove_integrators
from robid.models.lpv.fit.smile import check_positions, interpolate
from robid.models.lpv.fit.sparse_basis import find_sparse_bases
from robid.models.lpv.fit.state_space import StateSpace
from robid.models.lpv.fit.uncertainty import ParameterUncertainty, ResponseUncertainty, parameter_uncertainty

_FIRST_STEPS = 10


@dataclass(frozen=True)
class LpvResult:
    """What a fit found.

    Attributes:
        local: The local models, outputs in units of `scales`, each in its balanced basis.
        smile: Their interpolation without integrators, in the outputs' own units.
        core: The chosen model without integrators, in the outputs' own units.
        model: The chosen model with its integrators.
        path: The regularisation path, outputs in units of `scales`.
        kept (4, n_function): Blocks of A, B, C and D that the chosen model has.
        scales (n_out,): Units of the outputs during the fit.
        parameters: How far the chosen model's parameters may be off, outputs in units of `scales`.
        stability: Of the chosen model over the range, integrators not counted.
        integrators: How often each output integrates.
    """

    local: LocalModels
    smile: LpvModel
    core: LpvModel
    model: LpvModel
    path: Path
    kept: BoolArray
    scales: FloatArray
    parameters: ParameterUncertainty
    stability: Stability
    integrators: tuple[int, ...]

    def uncertainty(self, points: FloatArray, frequency_hz: FloatArray) -> ResponseUncertainty:
        """Returns the response, integrators included, with its deviations.

        Args:
            points (n_pos, n_scheduling): Scheduling parameters.
            frequency_hz (n_freq,): Lines.

        Raises:
            DataError: If a point lies outside the range.
        """
        covariance = self.parameters.covariance
        return model_response(self.core, self.scales, covariance, self.integrators, points, frequency_hz)


def estimate_lpv(responses: LocalResponses, validation: LocalResponses, basis: Basis, options: LpvOptions) -> LpvResult:
    """Identifies one sparse model from frequency responses at several positions.

    Args:
        responses: What is fitted.
        validation: Responses at other positions, or of other realizations, that choose the structure.
        basis: The basis functions and their range.
        options: What to do.

    Raises:
        DataError: If there are too few positions or lines, a position lies outside the range, or a local model is
            unstable.

    Source:
        Turk et al. (2018), sec. II-C and III-B.
    """
    integrators = options.integrators or (0,) * responses.response.shape[2]
    reduced, held_out = remove_integrators(responses, integrators), remove_integrators(validation, integrators)
    scales = output_scales(reduced)
    problem, judge = (
        make_problem(one, basis, options.order, scales, weighted=options.weighted, window=options.weight_window)
        for one in (reduced, held_out)
    )
    check_positions(problem.values[different_positions(responses.points)])
    local = fit_local_models(problem)
    aligned = align_neighbours(local.systems, responses.points)
    path = follow_path(
        problem,
        judge,
        _starts(problem, aligned, responses, basis, options),
        basis.largest,
        options.path,
        options.sparsity,
    )
    variance = None if reduced.variance is None else reduced.variance / scales[:, None] ** 2
    free = spread(path.best.kept, problem.sizes)
    smile, core = (
        LpvModel(rescaled(parameters, problem.sizes, scales), problem.sizes, basis, responses.sampling_period_s)
        for parameters in (interpolate(aligned, problem.values), path.best.parameters)
    )
    return LpvResult(
        local=local,
        smile=smile,
        core=core,
        model=add_integrators(core, integrators),
        path=path,
        kept=path.best.kept,
        scales=scales,
        parameters=parameter_uncertainty(problem, path.best.parameters, free, variance),
        stability=check_stability(core),
        integrators=integrators,
    )


def _starts(
    problem: Problem, aligned: StateSpace, responses: LocalResponses, basis: Basis, options: LpvOptions
) -> tuple[FloatArray, ...]:
    """Begins fits without prices, from the interpolation in each basis in which few blocks vary.

    Only begins: with more positions than functions, a fit goes on for long and far from that basis for next to nothing.
    """
    fixed = middle_position(responses.points)
    bases = find_sparse_bases(aligned, problem.values, basis.largest, fixed=fixed, options=options.sparse_basis)
    guesses = (interpolate(one, problem.values) for one in bases)
    return tuple(solve(problem, guess, max_iterations=_FIRST_STEPS)[0] for guess in guesses)
