"""Response of motors to their own torques for many parameter values: all lines at once, half of a symmetric matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from robid.arrays import BoolArray, ComplexArray, FloatArray
from robid.robot.elimination import eliminate, invert, outer_products
from robid.robot.linearize import LinearModel
from robid.robot.response import ElasticParameters, arm_dampers, fast_limit, mass_matrix
from robid.robot.sampling import Folding, hold_factor, make_folding

_ROUNDING = 1e-12


def is_collocated(model: LinearModel) -> bool:
    """Whether the outputs are the motors themselves, all sampled alike, so that the response is symmetric."""
    n_motor = model.n_motor
    if len(set(model.rates)) > 1:
        return False
    same = model.output.shape[1] == n_motor and (model.output == np.eye(n_motor, model.mass.shape[-1])).all()
    return bool(same) and not model.tilt.any()


def has_plain_inertias(model: LinearModel) -> bool:
    """Whether each link's inertia acts along one direction, as turns do and slides within one line."""
    products = model.link_inertia
    # A symmetric positive matrix has rank one where tr(P)^2 = tr(P^2).
    traces = np.trace(products, axis1=-2, axis2=-1) ** 2
    return bool((traces - (products**2).sum(axis=(-2, -1)) <= _ROUNDING * traces).all())


def motor_rows(model: LinearModel) -> dict[int, int]:
    """Output of each motor that is measured at itself: elements between two of these are reciprocal."""
    unit = np.eye(model.n_motor, model.mass.shape[-1])
    plain = np.asarray(~model.tilt.any(axis=(0, 2)))
    alike = (model.output[:, :, None] == unit).all(axis=(0, 3)) & plain[:, None]
    return {int(motor): int(row) for row, motor in np.argwhere(alike)}


@dataclass(frozen=True)
class _Timing:
    """What a delay makes of all frequencies."""

    delay_s: float
    factor: ComplexArray  # (n_line,) Acceleration per motion, lines with hold and delay
    folding: Folding | None
    by_delay: Folding | None


@dataclass
class _Solved:
    """One factorisation: response of the motors, at all frequencies (lines with their hold) and sampled; when."""

    parameters: ElasticParameters
    motors: ComplexArray | None
    fast: FloatArray
    seen: ComplexArray
    sampled: ComplexArray
    timing: _Timing
    whole: ComplexArray | None = None


class Collocated:
    """Evaluates the sampled response of one linearised robot again and again.

    Lines of all configurations stand last, configuration by configuration; where the motors' speeds or accelerations
    were sampled, the lines' images follow, and the folding's last frequency in every configuration. Springs come first
    and are eliminated without pivoting, which their dampers make safe. What is left is of the motors' size: with rotors
    and viscous friction on its diagonal it is the inverse of the response; where those are known, the motors are swept
    once beforehand and it is the response itself, negative (docs/methods, sec. 1).

    Args:
        model: Linearised robot whose outputs are its motors.
        frequency_hz (n_freq,): Frequencies [Hz].
        sampling_period_s: Period of the held torque, None for continuous time.
        used (n_conf, n_freq): Which lines to evaluate.
        kinds: Kinds of parameters that will vary.
    """

    def __init__(
        self,
        model: LinearModel,
        frequency_hz: FloatArray,
        sampling_period_s: float | None,
        used: BoolArray,
        kinds: tuple[str, ...],
    ) -> None:
        """Sets up what parameters do not change."""
        n = model.mass.shape[-1]
        self._model = model
        self._period = sampling_period_s
        # Where rotors and viscous friction stay, the motors' block of Z does too: it is eliminated once for all steps
        # of a fit.
        self._swept = set(kinds) <= {"stiffness", "damping", "delay"}
        self._configuration, line = np.nonzero(used)
        self._omega: FloatArray | ComplexArray = (2 * np.pi * frequency_hz)[line]
        self._lines, self._rate = slice(line.size), model.rates[:1]
        self._line_omega = self._omega[self._lines].real
        if sampling_period_s is not None:
            self._add_images(make_folding(self._line_omega, 0.0, sampling_period_s, self._rate, 1)[0])
        self._factor = np.ascontiguousarray(model.rest.factor[self._configuration].T)
        self._varies = bool((self._factor != 1).any())
        # Springs first, motors last: what is left after eliminating the springs is of the motors' size.
        self._order = np.r_[model.n_motor : n, : model.n_motor]
        self._rows, self._columns = np.triu_indices(model.n_motor)
        self._work = np.empty((n, n, self._omega.size), complex)
        self._factors = np.empty((n - model.n_motor, n, self._omega.size), complex)
        self._product = np.empty((n, self._omega.size), complex)
        self._whole = np.empty((n, model.n_motor, self._omega.size), complex)
        self._held: tuple[FloatArray, ...] = ()
        self._constant = np.empty(0, complex)
        self._fast = np.empty(0)
        self._solved: _Solved | None = None
        self._timing: _Timing | None = None
        self._buffer = np.empty((0, 0, 0), complex)

    def _add_images(self, folding: Folding) -> None:
        """Sets up the frequencies beside the lines, which those of the folding are."""
        if not folding.omega.size:
            return
        lines, n_conf = self._configuration, len(self._model.mass)
        repeats = folding.weight.shape[0]
        self._omega = np.concatenate([self._line_omega, folding.omega[:-1], np.repeat(folding.omega[-1], n_conf)])
        self._configuration = np.concatenate([lines, np.tile(lines, repeats), np.arange(n_conf)])

    def _folded(self, folding: Folding, values: ComplexArray) -> ComplexArray | float:
        """What values (..., n_line) at all frequencies fold down onto the lines, without the limit."""
        if not folding.omega.size:
            return 0.0
        n_line, shape = self._line_omega.size, folding.weight.shape[:2]
        images = values[..., n_line : n_line + folding.omega.size - 1]
        signed = np.where(folding.mirrored[:-1], images.conj(), images).reshape(*values.shape[:-1], *shape)
        last = values[..., -len(self._model.mass) :][..., self._configuration[self._lines]]
        tail = folding.tail[..., 0]
        return np.asarray((folding.weight[..., 0] * signed).sum(axis=-2) + tail[0] * last.real + tail[1] * last.imag)

    def response(self, parameters: ElasticParameters) -> ComplexArray:
        """Sampled response (n_pair, n_line), the upper triangle row by row."""
        self._hold(parameters)
        n_spring = len(self._factors)
        stiffness = parameters.stiffness[:, None] * self._factor
        # Z = -w^2 M + j w D + K + dg/dq; in spring coordinates only these diagonals vary (docs/methods, sec. 1).
        springs = np.asarray(stiffness + 1j * parameters.damping[:, None] * self._omega, complex)
        eliminate(self._constant, springs, self._work, self._factors, self._product)
        rest = self._work[n_spring:, n_spring:]
        if not self._swept:
            motors = np.arange(len(rest))
            rest[motors, motors] += 1j * parameters.viscous[:, None] * self._omega
        torque = None if self._swept else invert(rest)
        # The Schur complement of the springs is the inverse of the response; swept, it is minus the response itself.
        seen = -rest[self._rows, self._columns] if torque is None else torque[self._rows, self._columns]
        timing = self._timed(float(parameters.delay[0]))
        seen *= timing.factor
        sampled = seen[:, self._lines]
        if timing.folding is not None:
            sampled = sampled + timing.folding.fast[:, 0] * self._fast + self._folded(timing.folding, seen)
        self._solved = _Solved(parameters, torque, self._fast, seen, sampled, timing)
        return np.asarray(sampled)

    def derivatives(
        self,
        kinds: tuple[str, ...],
        masks: tuple[BoolArray, ...],
        scale: ComplexArray,
        beside: ComplexArray | FloatArray | None = None,
    ) -> ComplexArray:
        """Derivatives (n_param, n_pair, n_line) at the last response by plain values, valid until the next call.

        Args:
            kinds: Kinds of parameters, in the order wanted.
            masks: Which elements of each.
            scale (n_pair, n_line): Factor of each element.
            beside (n_pair, n_line): A further row to stand after them, as it is; none by default.

        Raises:
            ValueError: If there was no response before.
        """
        solved = self._last()
        if solved.whole is None:
            solved.whole = self._moved()
        shape = sum(int(mask.sum()) for mask in masks) + (beside is not None), len(scale), self._omega.size
        if self._buffer.shape != shape:
            self._buffer = np.zeros(shape, complex)
        # dG = w^2 x_o (dZ) x_i: a spring's dZ is one place, so its column is the outer product of its deflection's
        # response.
        held, folding = -solved.timing.factor, solved.timing.folding
        if folding is None or not folding.omega.size:
            self._fill_all(kinds, masks, scale * held, scale)
            found = self._buffer
        else:
            plain = np.ones_like(scale)
            self._fill_all(kinds, masks, np.broadcast_to(held, (len(scale), held.size)), plain)
            found = np.asarray((self._buffer[..., self._lines] + self._folded(folding, self._buffer)) * scale)
        if beside is not None:
            found[-1] = beside
        return found

    def _fill_all(
        self, kinds: tuple[str, ...], masks: tuple[BoolArray, ...], own: ComplexArray, scale: ComplexArray
    ) -> None:
        """Derivatives of all kinds, each at its place."""
        begin = 0
        outer: dict[bytes, slice] = {}
        for kind, mask in zip(kinds, masks, strict=True):
            rows = slice(begin, begin + int(mask.sum()))
            if kind == "delay":
                self._buffer[rows] = 0.0
                self._buffer[rows, :, self._lines] = scale * self._delay_slope()
            else:
                self._fill(rows, kind, mask, own, scale, outer)
            begin = rows.stop

    def _fill(
        self, rows: slice, kind: str, mask: BoolArray, own: ComplexArray, scale: ComplexArray, outer: dict[bytes, slice]
    ) -> None:
        """Outer products of one kind; a spring's damper takes over those of its stiffness."""
        out = self._buffer[rows]
        key = mask.tobytes()
        if kind == "damping" and key in outer:
            # A damper is j w times its spring: the outer product of the stiffness is used again.
            np.multiply(self._buffer[outer[key]], 1j * self._omega, out=out)
            if self._varies:
                out /= self._factor[mask][:, None]
            return
        outer_products(self._seen(kind)[mask], own, out)
        if kind == "stiffness":
            outer[key] = rows
            if self._varies:
                out *= self._factor[mask][:, None]
        elif kind.endswith("inertia"):
            # dZ of an inertia is -w^2 times its direction's outer product.
            out *= -(self._omega**2)
            if self._period is not None:
                out[..., self._lines] += scale * self._alias_slope(kind, mask)
        else:
            out *= 1j * self._omega

    def _seen(self, kind: str) -> ComplexArray:
        """How each element of a kind moves for unit torques (n_element, n_motor, n_line)."""
        whole, n_motor = self._last().whole, self._model.n_motor
        assert whole is not None
        n_spring = len(whole) - n_motor
        if kind in ("stiffness", "damping"):
            return whole[:n_spring]
        if kind == "arm_viscous":
            return np.asarray(np.einsum("la,aiL->liL", self._model.arm[:, self._order], whole, optimize=True))
        if kind != "link_inertia":
            return whole[n_spring:]
        # Inertia about one direction t enters as t t': the response of t' z is all that its derivative needs.
        turns = self._turns()[:, :, self._order][self._configuration]
        return np.asarray(np.einsum("Lla,aiL->liL", turns, whole, optimize=True))

    def _moved(self) -> ComplexArray:
        """Motion of all coordinates (n, n_motor, n_line), springs first, by back substitution; valid until the next.

        Motors that were swept are not among the unknowns: a unit torque of each stands in their place.
        """
        motors, factors, whole = self._last().motors, self._factors, self._whole
        n_spring, product = len(factors), self._product[: self._model.n_motor]
        if motors is not None:
            whole[n_spring:] = motors
        # Back substitution: x_s = -(Z_ss)^-1 Z_sm x_m, row by row from the eliminated triangle.
        for row in range(n_spring - 1, -1, -1):
            if motors is None:
                np.negative(factors[row, n_spring:], out=whole[row])
            else:
                whole[row] = 0.0
            for known in range(row + 1, n_spring if motors is None else len(whole)):
                np.multiply(factors[row, known], whole[known], out=product)
                whole[row] -= product
        return whole

    def _timed(self, delay_s: float) -> _Timing:
        """What does not change while the delay stays."""
        if self._timing is None or self._timing.delay_s != delay_s:
            folding = by_delay = None
            # Acceleration per torque: -w^2, times hold and delay at the lines; images have these in their weights.
            factor = np.asarray(-(self._omega**2), complex)
            factor[self._lines] *= hold_factor(self._line_omega, delay_s, self._period)
            if self._period is not None:
                folding, by_delay = make_folding(self._line_omega, delay_s, self._period, self._rate, 1)
            self._timing = _Timing(delay_s, factor, folding, by_delay)
        return self._timing

    def _last(self) -> _Solved:
        if self._solved is None:
            message = "derivatives are those of the last response, and there was none"
            raise ValueError(message)
        return self._solved

    def _turns(self) -> FloatArray:
        """Direction (n_conf, n_joint, n) whose outer product each link's inertia multiplies."""
        products = self._model.link_inertia
        # A column of t t' over the root of its largest diagonal element is t, up to its sign, which squares out.
        size = np.diagonal(products, axis1=-2, axis2=-1)
        largest = size.argmax(axis=-1)[..., None]
        root = np.sqrt(np.maximum(np.take_along_axis(size, largest, axis=-1), np.finfo(float).tiny))
        return np.asarray(np.take_along_axis(products, largest[..., None], axis=-2)[..., 0, :] / root)

    def _alias_slope(self, kind: str, mask: BoolArray) -> ComplexArray:
        """Derivative (n_element, n_pair, n_line) of what folds down from above."""
        model, parameters = self._model, self._last().parameters
        # The limit at infinite frequency is B' M^-1 B, whose derivative is -B' M^-1 (dM) M^-1 B.
        inverse = np.linalg.inv(mass_matrix(model, parameters))[:, : model.n_motor]
        if kind == "link_inertia":
            seen = np.einsum("cia,cla->cli", inverse, self._turns())
        else:
            seen = np.swapaxes(inverse[..., : model.n_motor], -1, -2)
        pairs = -(seen[..., self._rows] * seen[..., self._columns])[:, mask]
        folding = self._last().timing.folding
        assert folding is not None
        return np.asarray(folding.fast[:, 0] * np.moveaxis(pairs[self._configuration[self._lines]], 0, -1))

    def _delay_slope(self) -> ComplexArray:
        solved, rate = self._last(), -1j * self._line_omega
        folding, by_delay = solved.timing.folding, solved.timing.by_delay
        if folding is None or by_delay is None:
            return np.asarray(rate * solved.sampled)
        # The line itself turns by -j w; what folds down turns by its own images' frequencies, which `by_delay` holds.
        folded = folding.fast[:, 0] * solved.fast + self._folded(folding, solved.seen)
        slope = by_delay.fast[:, 0] * solved.fast + self._folded(by_delay, solved.seen)
        return np.asarray(rate * (solved.sampled - folded) + slope)

    def _hold(self, parameters: ElasticParameters) -> None:
        """Sets up everything but what varies; anew only when it did change."""
        held: tuple[FloatArray, ...] = (parameters.motor_inertia, parameters.link_inertia, parameters.arm_viscous)
        if self._swept:
            held = (*held, parameters.viscous)
        if self._held and all(map(np.array_equal, self._held, held)):
            return
        model, order = self._model, np.ix_(range(len(self._model.mass)), self._order, self._order)
        # Everything but springs, dampers and viscous friction: constant while its own parameters are.
        mass, gravity = mass_matrix(model, parameters)[order], model.gravity_stiffness[order]
        here = self._configuration
        constant: FloatArray | ComplexArray = gravity[here] - (self._omega**2)[:, None, None] * mass[here]
        if parameters.arm_viscous.any():
            own = arm_dampers(model, parameters)[np.ix_(self._order, self._order)]
            constant = constant + 1j * self._omega[:, None, None] * own
        if self._swept:
            constant = self._sweep(constant, parameters.viscous)
        self._constant = np.ascontiguousarray(constant.transpose(1, 2, 0))
        fast = fast_limit(model, parameters)[here[self._lines]]
        self._fast = np.ascontiguousarray(fast[:, self._rows, self._columns].T)
        self._held = held

    def _sweep(self, constant: FloatArray | ComplexArray, viscous: FloatArray) -> ComplexArray:
        """Eliminates the motors: `[[S, C], [C', A]]` becomes `[[S - C A^-1 C', C A^-1], [., -A^-1]]`."""
        n_spring = constant.shape[-1] - self._model.n_motor
        motors = constant[:, n_spring:, n_spring:] + 1j * self._omega[:, None, None] * np.diag(viscous)
        inverse, coupling = np.linalg.inv(motors), constant[:, :n_spring, n_spring:]
        seen = coupling @ inverse
        springs = constant[:, :n_spring, :n_spring] - seen @ np.swapaxes(coupling, -1, -2)
        return np.block([[springs, seen], [np.swapaxes(seen, -1, -2), -inverse]])
