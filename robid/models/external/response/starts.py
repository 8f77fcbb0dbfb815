"""Where descents start: poles relocated by linear least squares, poles added where the residual is, poles removed.

One linear step serves both of the field's starts. `sum |A y - B|^2 / (sigma |A_old|)^2` is the step of Sanathanan and
Koerner; with A over A_old in a basis and its mean fixed to one instead of a coefficient, it is relaxed vector fitting,
whose poles move to the zeros of A. Here the basis is orthogonal on the lines instead of partial fractions of the old
poles.

Source:
    Sanathanan and Koerner (1963), "Transfer function synthesis as a ratio of two complex polynomials"; Gustavsen
    (2006), "Improving the pole relocating properties of vector fitting"; Deschrijver, Gustavsen and Dhaene (2007),
    "Advancements in iterative methods for rational approximation in the frequency domain".
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robid.arrays import ComplexArray, FloatArray
from robid.models.external.response.basis import orthogonalise
from robid.models.external.response.denominator import Denominator, denominator_of
from robid.models.external.response.lines import Lines
from robid.models.external.response.residual import Degrees, State, as_real, evaluate, project

_FIRST_DAMPING = 0.02
_REACH = 1e3  # over the highest line, beyond which a relocated pole is brought back
_SINGULAR = 1e-14  # of the largest, an eigenvalue that rounding makes
_DAMPINGS = (0.005, 0.05, 0.5)
_LAST = 1e-12  # of the largest, the least last coefficient: below it, a pole is at infinity
_NOTHING = 1e-100  # deviations, a response that is none
_NEAR = 0.1  # logarithm of two frequencies' ratio below which they count as one place


def spread_poles(lines: Lines, n_moving: int, integrators: int) -> Denominator:
    """Returns lightly damped pairs spread over the band, and a real pole amid it if their number is odd."""
    n_pair = n_moving // 2
    edges = np.geomspace(lines.x[0], lines.x[-1], 2 * n_pair + 1)
    places = edges[1::2] * (1j - _FIRST_DAMPING)
    real = np.full(n_moving % 2, -np.sqrt(lines.x[0] * lines.x[-1]))
    return denominator_of(np.concatenate([places, places.conj(), real]), integrators)


def relocate(lines: Lines, state: State) -> Denominator:
    """Moves all poles at once by linear least squares."""
    old = state.denominator
    s = 1j * lines.x
    A, _ = replace(old, integrators=0).evaluate(s)
    V, polynomials = orthogonalise(1 / np.maximum(np.abs(A), 1e-150)[None], lines.x, old.n_moving)
    # sigma(s) = sum_k b_k p_k(s) / A_old(s): its columns on the lines, times the data, must be what numerators can
    # follow.
    columns = V.one(0) * (np.abs(A) / A)
    data = state.model + state.residual
    M = as_real(project(state, data[:, None, :] * columns))
    # Relaxed: the mean of sigma is one. The least squares with this one constraint are (M M^T)^-1 l up to a factor.
    size = np.linalg.norm(M, axis=1)
    if size.min() < _NOTHING:
        return old
    values, vectors = np.linalg.eigh((M / size[:, None]) @ (M / size[:, None]).T)
    mean = vectors.T @ (columns.real.sum(axis=1) / size)
    b = vectors @ (mean / np.maximum(values, max(_SINGULAR * values[-1], 1e-150))) / size
    return _within_reach(lines, polynomials.roots(_ending(b)), old)


def _ending(b: FloatArray) -> FloatArray:
    """Scales coefficients and gives them a last one that roots can be found with."""
    scaled = b / max(np.abs(b).max(), 1e-150)
    scaled[-1] = np.copysign(max(abs(scaled[-1]), _LAST), scaled[-1])
    return np.asarray(scaled)


def _within_reach(lines: Lines, poles: ComplexArray, old: Denominator) -> Denominator:
    """Brings back poles that left for infinity."""
    highest = lines.x[-1]
    finite = poles[np.isfinite(poles)]
    far = np.abs(finite) > _REACH * highest
    finite[far] *= _REACH * highest / np.abs(finite[far])
    lost = np.full(old.n_moving - len(finite), -10.0 * highest)
    return denominator_of(np.concatenate([finite, lost]), old.integrators)


def relocated(
    lines: Lines, first: Denominator, delay: float, degrees: Degrees, rounds: int = 8, *, stable: bool = False
) -> State:
    """Relocates poles again and again, and returns the best on the way."""
    state = best = evaluate(lines, first, delay, degrees)
    for _ in range(rounds if first.n_moving else 0):
        denominator = relocate(lines, state)
        if stable:
            denominator = reflected(denominator)
        state = evaluate(lines, denominator, delay, degrees)
        if state.cost < best.cost:
            finished = best.cost - state.cost < 1e-3 * best.cost
            best = state
            if finished:
                break
    return best


def reflected(denominator: Denominator) -> Denominator:
    """Returns a denominator with its unstable poles reflected to the left."""
    poles = denominator.moving_poles()
    return denominator_of(-np.abs(poles.real) + 1j * poles.imag, denominator.integrators)


def grown(lines: Lines, state: State, count: int = 2) -> list[Denominator]:
    """Returns denominators with a pair more, where it would take most from the residual, the best first.

    A model of more poles is the present one plus partial fractions of the new ones, so that the gain of each place is
    that of two more columns an element, all numerators following.
    """
    centres = np.geomspace(lines.x[0] / 2, lines.x[-1] * 2, 64)
    places = np.concatenate([centres * complex(-zeta, np.sqrt(1 - zeta**2)) for zeta in _DAMPINGS])
    s = 1j * lines.x
    below = 1 / (s * s - 2 * places.real[:, None] * s + (np.abs(places) ** 2)[:, None])
    gains = _gains(lines, state, np.stack([below, below * s]))
    found: list[complex] = []
    for index in np.argsort(-gains):
        if all(abs(np.log(abs(places[index]) / abs(one))) > _NEAR for one in found):
            found.append(places[index])
        if len(found) == count:
            break
    poles = state.denominator.moving_poles()
    return [denominator_of(np.append(poles, [one, np.conj(one)]), state.denominator.integrators) for one in found]


def grown_by_one(lines: Lines, state: State) -> Denominator:
    """Returns a denominator with a real pole more, where it would take most from the residual."""
    places = np.geomspace(lines.x[0] / 10, lines.x[-1] * 10, 40)
    gains = _gains(lines, state, 1 / (1j * lines.x + places[:, None])[None])
    poles = np.append(state.denominator.moving_poles(), -places[np.argmax(gains)])
    return denominator_of(poles, state.denominator.integrators)


def _gains(lines: Lines, state: State, added: ComplexArray) -> FloatArray:
    """What each place's columns (n_column, n_place, n_freq) take from the cost, numerators following."""
    total = np.zeros(added.shape[1])
    late = np.exp(-1j * lines.turn * state.delay)
    flat = added.reshape(-1, added.shape[2])
    for element in range(lines.n_element):
        rows = flat * (lines.weights[element] * late * state.phase[min(element, len(state.phase) - 1)])
        left = rows.copy()
        for part, V in ((left.real, state.columns.even[element]), (left.imag, state.columns.odd[element])):
            part -= (part @ V.T) @ V
        left = left.view(float).reshape(*added.shape[:2], -1)
        r = state.residual[element].view(float)
        along = (left @ r).T
        gram = np.einsum("kpf,lpf->pkl", left, left)
        gram += np.eye(len(added)) * (1e-9 * np.trace(gram, axis1=1, axis2=2) + 1e-200)[:, None, None]
        total += np.einsum("pk,pk->p", along, np.linalg.solve(gram, along[:, :, None])[:, :, 0])
    return total


def without_each(denominator: Denominator) -> list[Denominator]:
    """Returns denominators without each real pole and each pair that moves."""
    poles = denominator.moving_poles()
    found = []
    for index, pole in enumerate(poles):
        if pole.imag < 0:
            continue
        gone = [index]
        if pole.imag > 0:
            gone.append(int(np.argmin(np.abs(poles - np.conj(pole)))))
        found.append(denominator_of(np.delete(poles, gone), denominator.integrators))
    return found
