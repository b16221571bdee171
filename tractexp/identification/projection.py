"""Variable projection: the poles of a network by nonlinear least squares, everything that is linear
projected out.

A pole more starts where one of a grid takes most of what the others leave. Bounds keep each where
it dies out, within the time that is recorded, and is no faster than the samples show.
Source: Golub and Pereyra 2003; Kaufman 1975 (the Jacobian).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from tractexp.domain.port import Complex, Port
from tractexp.inference.recursion import sum_with_decay

TRIED_DECAYS = 6  # of a pole that is tried, from the slowest to the fastest
# Hz against the frame, of a pole that is tried
FREQUENCIES = (0.0, 2.0, 5.0, 12.0, 25.0, 50.0, 100.0)
FASTEST, HIGHEST = 0.5, 0.25  # of the sampling rate: a decay [1/s], a frequency [Hz]
MOST_PROJECTION_STEPS = 40  # of the nonlinear least squares
PARALLEL = 1e-6  # of a response: where the others leave no more of it, it is theirs


@dataclass(frozen=True, eq=False)
class Projection:
    """Ports that are fitted together, at the R samples of all of them that are compared.

    Attributes
    ----------
    ports : sequence of Port
        Voltages and currents.
    current : (R,) complex [pu]
        Currents of all ports, without what is known of them.
    slowest : float [1/s]
        The least decay of a pole.
    rate : float [1/s]
        Samples per second.
    """

    ports: Sequence[Port]
    current: Complex  # (R,) of all ports, without what is known of it
    slowest: float  # 1/s
    rate: float  # samples per second

    @classmethod
    def from_ports(cls, ports: Sequence[Port]) -> "Projection":
        """The projection for some ports.

        The currents are less their steady response; decays lie between one in the longest time
        recorded and `FASTEST` of the sampling rate.
        """
        seconds = max((len(port.u) - port.start) * port.step for port in ports)
        current = _stack_ports(ports, lambda port: port.i - port.steady_response)
        return cls(ports, current, 1 / seconds, 1 / max(port.step for port in ports))

    def linear_part(self, poles: Complex) -> tuple[Complex, Complex, Complex]:
        """Fit the current by the responses of poles (n,) [rad/s], by linear least squares.

        Returns
        -------
        (k,) complex
            Coefficients of the responses.
        (R, k) complex
            An orthonormal basis of the responses, R samples of all ports.
        (R,) complex
            What they leave of the current.
        """
        responses = _stack_ports(self.ports, lambda port: compute_port_basis(port, poles))
        orthonormal, triangle = np.linalg.qr(responses)
        inside = orthonormal.conj().T @ self.current
        coefficients = np.linalg.lstsq(triangle, inside, rcond=None)[0]
        return coefficients, orthonormal, self.current - orthonormal @ inside

    @property
    def grid(self) -> list[complex]:
        """Poles [1/s] from which a search starts: decays in even ratios, each with every frequency
        that the samples can show.
        """
        decays = np.geomspace(self.slowest, FASTEST * self.rate, TRIED_DECAYS + 2)[1:-1].tolist()
        turns = (
            [0.0] if self.ports[0].series else [f for f in FREQUENCIES if f < HIGHEST * self.rate]
        )
        return [
            complex(-a, 2 * np.pi * f)
            for a in decays
            for f in sorted({*turns, *(-f for f in turns)})
        ]

    def start(self, poles: Complex) -> complex:
        """The pole of the grid that takes most of what other poles (n,) leave."""
        _, base, residual = self.linear_part(poles)

        def measure_correlation(pole: complex) -> float:
            response = _stack_ports(self.ports, lambda port: compute_response_of_pole(port, pole))
            apart = response - base @ (base.conj().T @ response)
            least = PARALLEL * np.linalg.norm(response) + np.finfo(float).tiny
            return float(abs(np.vdot(residual, apart)) / max(np.linalg.norm(apart), least))

        return max(self.grid, key=measure_correlation)

    def optimum(self, poles: Complex) -> Complex:
        """The poles that leave least, near given ones.

        Parameters
        ----------
        poles : (n,) complex [rad/s]
            Where the nonlinear least squares begin.

        Returns
        -------
        (n,) complex array [rad/s]
        """
        from scipy.optimize import least_squares

        n = len(poles)
        apart = 2 * np.pi * HIGHEST * self.rate
        lower = np.log(self.slowest)
        upper = np.log(FASTEST * self.rate)
        bounds = np.array(
            [[lower, upper]] * n + [[-apart, apart]] * (0 if self.ports[0].series else n)
        ).T
        first = np.concatenate([np.log(-poles.real), poles.imag])[: bounds.shape[1]]
        optimum = least_squares(
            lambda x: _stack_parts(self.linear_part(_decode_poles(x, n))[2]),
            np.clip(first, *bounds),
            lambda x: self.jacobian(_decode_poles(x, n)),  # pyright: ignore[reportArgumentType]
            bounds=bounds,
            x_scale="jac",
            method="dogbox",
            max_nfev=MOST_PROJECTION_STEPS,
        )
        return _decode_poles(optimum.x, n)

    def jacobian(self, poles: Complex) -> np.ndarray:
        """The derivatives (2 R, n or 2 n) of what is left, real parts above imaginary ones, by the
        logarithms of the decays and by the frequencies.
        """
        coefficients, base, _ = self.linear_part(poles)
        moved = _stack_ports(
            self.ports,
            lambda port: np.stack([differentiate_pole_response(port, p) for p in poles], axis=1),
        )
        moved = moved * coefficients[: len(poles)]
        moved = base @ (base.conj().T @ moved) - moved
        return _stack_parts(
            np.concatenate(
                [moved * poles.real] + ([1j * moved] if not self.ports[0].series else []), axis=1
            )
        )


def compute_port_basis(port: Port, poles: Complex) -> Complex:
    """The responses of the parts of a network to the voltage.

    Parameters
    ----------
    port : Port
        With N samples.
    poles : (n,) complex [rad/s]
        In the port's frame.

    Returns
    -------
    (N, k) complex array
        Of each pole, of the derivative and, where that is open, of a constant. Of a path in series
        those of its poles alone.
    """
    columns = [compute_response_of_pole(port, pole) for pole in poles]
    if not port.series:
        columns += [np.gradient(port.u, port.step), *([port.u] if port.steady is None else [])]
    return np.array(columns, dtype=complex).reshape(len(columns), len(port.u)).T


def compute_response_of_pole(port: Port, pole: complex) -> Complex:
    """The response (N,) of s / (s - p) to a port's voltage; of a path in series that of 1 / (s -
    p).
    """
    x = compute_pole_response(port.u, pole, port.step)
    return x if port.series else port.u + pole * x


def differentiate_pole_response(port: Port, pole: complex) -> Complex:
    """The derivative (N,) of the response of a pole by the pole."""
    x = compute_pole_response(port.u, pole, port.step)
    moved = compute_pole_response(x, pole, port.step)
    return moved if port.series else x + pole * moved


def compute_pole_response(u: Complex, pole: complex, step: float) -> Complex:
    """The response of 1 / (s - p) to a voltage, at rest at first.

    It is exact where the voltage is a straight line between samples.

    Parameters
    ----------
    u : (N,) complex
        The voltage.
    pole : complex [rad/s]
        p.
    step : float [s]
        Between samples.

    Returns
    -------
    (N,) complex array

    Examples
    --------
    >>> response = compute_pole_response(np.ones(3, dtype=complex), -2.0 + 0j, 0.5)
    >>> t = np.array([0.5, 1.0])
    >>> np.allclose(response[1:] - response[0] * np.exp(-2 * t), (1 - np.exp(-2 * t)) / 2)
    True
    """
    z = pole * step
    grown = np.expm1(z)
    last = (grown - z) / (pole * z)
    driven = last * u
    driven[1:] += (grown / pole - last) * u[:-1]
    return sum_with_decay(driven, np.exp(z))


def _stack_ports(ports: Sequence[Port], of: Callable[[Port], Complex]) -> Complex:
    """What `of` gives of each port, (N, ...), at the samples that are compared, one port after the
    other.
    """
    return np.concatenate([of(port)[np.isfinite(port.i)] for port in ports])


def _decode_poles(x: np.ndarray, n: int) -> Complex:
    """Poles (n,) of the logarithms of their decays and, where they may oscillate, their frequencies
    [rad/s].
    """
    return -np.exp(x[:n]) + 1j * (x[n:] if len(x) > n else np.zeros(n))


def _stack_parts(z: Complex) -> np.ndarray:
    """Real parts above imaginary ones."""
    return np.concatenate([z.real, z.imag])
