r"""The best linear network of a few poles from the recorded voltage to the recorded current: a
model without physics.

    i = G u + C du/dt + sum_k g_k s / (s - p_k) u

u and i deviate from their course before the dip, complex (`tractexp.domain.port`); G is how the
current follows a voltage that stays, C a capacitance, g_k what pole k adds at first and what dies
out with it. The zero sequence has the path of a resistance and an inductance, g / (s - p) u.
Between samples u is a straight line: so responses are exact. The poles are found by variable
projection (`tractexp.identification.projection`), their number by an information criterion of the
events that were fitted: events held out choose nothing, so that they judge.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.cache import store
from tractexp.domain import Domain, Playback
from tractexp.domain.port import Complex, Port
from tractexp.errors import UserError
from tractexp.identification.projection import Projection, compute_port_basis
from tractexp.record import Event

MOST_VECTOR_POLES = 4  # poles of the vectors
OF_ZERO = 1  # of the zero sequence
SAMPLES = 5  # for each unknown
LEAST_VOLTAGE_MOVE = 1e-6  # pu: a voltage that moves by less tells nothing
CRITERION = "the Bayesian information criterion"


@dataclass(frozen=True, eq=False)
class PoleNetwork:
    """A linear network.

    Attributes
    ----------
    poles : (n,) complex [rad/s]
        In the port's frame.
    coefficients : (k,) complex [pu]
        g_k, C, and G where the port leaves it open.
    """

    poles: Complex
    coefficients: Complex

    def response(self, port: Port) -> Complex:
        """The deviation (N,) [pu] of a port's current that it calculates."""
        return port.steady_response + compute_port_basis(port, self.poles) @ self.coefficients

    def squares(self, ports: Sequence[Port]) -> float:
        """The sum of squares that it leaves from the dips on [pu²]."""
        return sum(float(np.nansum(np.abs(rest) ** 2)) for rest in map(self.residual, ports))

    def residual(self, port: Port) -> Complex:
        """What it leaves of a port's current (n,) [pu] from the dip on; nan where that is not
        compared.
        """
        return (port.i - self.response(port))[port.start :]


@dataclass(frozen=True, eq=False)
class BlackBox:
    """A linear network for each port of a domain.

    Attributes
    ----------
    domain : Domain
        Whose ports they are.
    networks : tuple of LinearNetwork
        That of the vectors, and that of the zero sequence where there is one.
    turns : float [Hz]
        Frequency of the frame.
    chosen_by : str
        The criterion by which the number of poles was chosen.
    """

    domain: Domain
    networks: tuple[PoleNetwork, ...]
    turns: float  # Hz, of the frame
    chosen_by: str = ""

    @property
    def poles(self) -> list[dict[str, float]]:
        """`decay` [1/s], `frequency` [Hz] and `admittance` [pu] of each pole of the first network,
        that of space vectors; the slowest pole first.

        In waveforms the frequency is that in the phases, negative if the vector turns backwards;
        in phasors P and Q oscillate with it. The admittance is the size of the pole's part of the
        response at first, which decays.
        """
        poles = self.networks[0].poles
        # behind those of the poles stand those of the derivative and of a constant
        admittances = np.abs(self.networks[0].coefficients[: len(poles)])
        frequencies = (
            poles.imag / (2 * np.pi) + self.turns
            if self.turns
            else np.abs(poles.imag) / (2 * np.pi)
        )
        rows = zip((-poles.real).tolist(), frequencies.tolist(), admittances.tolist(), strict=True)
        return [
            dict(zip(("decay", "frequency", "admittance"), row, strict=True))
            for row in sorted(rows)
        ]

    def play(self, event: Event) -> Playback:
        """What it calculates of an event of its domain."""
        responses = [
            n.response(port)
            for n, port in zip(self.networks, self.domain.ports(event), strict=False)
        ]
        return self.domain.comparison(event, self.domain.outputs(event, responses))


def fit_black_boxes(
    domain: Domain, train: Sequence[Event], most: int = MOST_VECTOR_POLES
) -> list[BlackBox]:
    """The best networks of no pole, of one, and so on, for events together.

    Parameters
    ----------
    domain : Domain
        Whose ports are fitted.
    train : sequence of Event
        The events.
    most : int
        The largest number of poles of the vectors.

    Returns
    -------
    list of BlackBox

    Raises
    ------
    UserError
        Where the voltage does not move, or the samples are too few for a network without poles.
    """
    vectors, *zeros = zip(*map(domain.ports, train), strict=False)
    _refuse(vectors, ", ".join(e.record.name for e in train))
    zero = [fit_networks(ports, OF_ZERO)[-1] for ports in zeros]
    return [BlackBox(domain, (one, *zero), vectors[0].turns) for one in fit_networks(vectors, most)]


def choose_network(boxes: Sequence[BlackBox], train: Sequence[Event]) -> BlackBox:
    """The network of the least information criterion for the events that all were fitted to."""
    vectors = [box.networks[0] for box in boxes]
    ports = [boxes[0].domain.ports(event)[0] for event in train]
    by = compute_information_criterion(vectors, ports)
    return replace(boxes[int(np.argmin(by))], chosen_by=CRITERION)


def fit_networks(ports: Sequence[Port], most: int) -> list[PoleNetwork]:
    """The best networks of no pole, of one, and so on.

    They depend on the records alone, so that the store keeps them for the next model of these.

    Parameters
    ----------
    ports : sequence of Port
        Fitted together.
    most : int
        The largest number of poles; there are fewer where the samples do not allow so many.

    Returns
    -------
    list of LinearNetwork
    """

    def compute() -> tuple[Complex, ...]:
        return tuple(part for one in _fit(ports, most) for part in (one.poles, one.coefficients))

    parts = store.DESCENTS.arrays(
        store.compute_key(store.describe_environment(), "networks", ports, most), compute
    )
    return [PoleNetwork(*pair) for pair in zip(parts[::2], parts[1::2], strict=True)]


def _fit(ports: Sequence[Port], most: int) -> list[PoleNetwork]:
    """The networks of `fit_networks`, each from the poles of the one before."""
    fit = Projection.from_ports(ports)
    fits = [PoleNetwork(none := np.zeros(0, dtype=complex), fit.linear_part(none)[0])]
    while len(fits) <= most and _count_samples(ports) >= SAMPLES * count_unknowns(
        len(fits), ports[0]
    ):
        poles = fit.optimum(np.append(fits[-1].poles, fit.start(fits[-1].poles)))
        fits.append(PoleNetwork(poles, fit.linear_part(poles)[0]))
    return fits


def compute_information_criterion(
    networks: Sequence[PoleNetwork], ports: Sequence[Port]
) -> np.ndarray:
    """The Bayesian information criterion of networks.

    Samples count as much as the residual of the last network, which is correlated in time, allows.

    Parameters
    ----------
    networks : b networks
        Of more and more poles.
    ports : sequence of Port
        What they are fitted to.

    Returns
    -------
    (b,) array
        The least is the best.

    Notes
    -----
    Source: Schwarz 1978; Bayley and Hammersley 1946 (the effective number of samples).
    """
    squares = np.array([one.squares(ports) for one in networks])
    rests = [networks[-1].residual(port) for port in ports]
    in_turn = abs(sum(complex(np.nansum(rest[1:] * rest[:-1].conj())) for rest in rests))
    correlation = in_turn / max(float(squares[-1]), 1e-300)
    worth = _count_samples(ports) * (1 - correlation) / (1 + correlation)
    size = np.array([count_unknowns(len(one.poles), ports[0]) for one in networks])
    return worth * np.log(np.maximum(squares, 1e-300)) + size * np.log(max(worth, 1.0))


def count_unknowns(poles: int, port: Port) -> int:
    """The number of real unknowns of a network with so many poles."""
    linear = poles if port.series else poles + 1 + (port.steady is None)
    return 2 * (poles + linear)


def _count_samples(ports: Sequence[Port]) -> int:
    """Real values from the dips on."""
    return 2 * sum(int(np.count_nonzero(np.isfinite(port.i[port.start :]))) for port in ports)


def _refuse(ports: Sequence[Port], names: str) -> None:
    """Raise `UserError` for events of too few samples, or whose voltage does not move."""
    samples = _count_samples(ports)
    needed = SAMPLES * count_unknowns(0, ports[0])
    if samples < needed:
        raise UserError(
            f"{names}: {samples // 2} samples from the dip on are too few for a linear network,"
            " which needs"
            f" {-(-needed // 2)}; take a record that goes on longer, or of more samples in a second"
        )
    if max(float(np.abs(port.u[port.start :]).max()) for port in ports) < LEAST_VOLTAGE_MOVE:
        raise UserError(
            f"the voltage of {names} does not change, and a network is known by what a change does"
        )
