"""The load as it stands on its feeder, and its answer to one dip: the network solved at every
instant, SciPy DOP853.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from hidden_effects.devices import Device, Static
from hidden_effects.motor import Motor
from hidden_effects.recorder import Recorder
from hidden_effects.supply import Moment, Profile, Supply
from independent.source import Dip

MARGIN = 0.15  # s simulated before and after the record, for the recorder's windows
MOST = 100_000  # derivatives between two edges, twenty-five times what any law takes


@dataclass(frozen=True)
class Site:
    """Motors, static load and devices behind a feeder and a transformer, and the recorder at the
    bus.

    The power `S` [pu] at the bus before the event is given: the static load is what the other parts
    leave of it.
    """

    dip: Dip
    S: complex
    motors: tuple[Motor, ...]
    static: Static
    recorder: Recorder
    devices: tuple[Device, ...] = ()
    feeder: complex = 0j  # pu, series impedance
    # V of load over bus, and I of bus over load
    tap: Profile = field(default_factory=lambda: Profile(values=(1.0,)))
    # share of the whole load that relays hold open
    opened: Profile = field(default_factory=Profile)
    # share of the static load that is held open
    static_opened: Profile = field(default_factory=Profile)
    motors_opened: Profile = field(default_factory=Profile)  # share of the motors
    angle: float = 0.0  # rad, how far the voltage's angle jumps with the dip
    breaks: tuple[float, ...] = ()  # s, further instants at which something jumps

    def response(self) -> "Response":
        """The answer to the dip; raises `Stall` or `ValueError` when there is no steady state
        before it.
        """
        return Response(self)


class Response:
    """The solved event. `at(t)` gives bus voltage and current phasors; `lowest_speed` tells of a
    stall.
    """

    def __init__(self, site: Site):
        self.site, self.supply = site, Supply(site.dip)
        before = self.supply.at(-MARGIN)
        bus = before.U * site.tap(-MARGIN)
        load = bus - site.feeder * (site.S / bus).conjugate()
        self.parts, self.slices, begin = [], [], []
        rest = load * (site.S / bus)
        for part in (*site.motors, *site.devices):
            settled, states = part.settled(load)
            rest -= load * settled.flow(before, load, states)[0].conjugate()
            self._add(settled, states, begin)
        static, states = site.static.sized(rest, load).settled(load)
        self._add(static, states, begin)
        self.chord = self._chord(load, begin) if site.feeder else None
        self._solve(np.array(begin, dtype=complex))

    def _add(self, part: Device | Motor, states: list[complex], begin: list[complex]) -> None:
        self.parts.append(part)
        self.slices.append(slice(len(begin), len(begin) + len(states)))
        begin.extend(states)

    def _parts(self, now: Moment, V: complex, x: list[complex]) -> tuple[complex, list[complex]]:
        """Current and derivative of everything behind the feeder."""
        total, rates = 0j, []
        motors, last = len(self.site.motors), len(self.parts) - 1
        for k, (part, own) in enumerate(zip(self.parts, self.slices, strict=True)):
            current, moves = part.flow(now, V, x[own])
            if k < motors:
                current *= 1 - self.site.motors_opened(now.t)
            elif k == last:
                current *= 1 - self.site.static_opened(now.t)
            total += current
            rates += moves
        return total * (1 - self.site.opened(now.t)), rates

    def _chord(self, V: complex, x: list[complex]) -> tuple[complex, complex]:
        """The inverse of d(V + Z I(V))/dV before the event, as a r + b conj(r)."""
        now, Z, h = self.supply.at(-MARGIN), self.site.feeder, 1e-6
        along, across = (
            Z * (self._parts(now, V + d, x)[0] - self._parts(now, V - d, x)[0]) / (2 * h)
            for d in (h, 1j * h)
        )
        p, q = 1 + (along - 1j * across) / 2, (along + 1j * across) / 2  # Wirtinger derivatives
        scale = abs(p) ** 2 - abs(q) ** 2
        return p.conjugate() / scale, -q / scale

    def network(self, t: float, x: list[complex]) -> tuple[complex, complex, list[complex]]:
        """Bus voltage, bus current and the derivative of the states x at time t, the feeder solved
        by iteration.
        """
        now, site = self.supply.at(t), self.site
        bus = now.U + 0j
        if site.angle:
            bus *= complex(np.cos(site.angle * now.missing), np.sin(site.angle * now.missing))
        ratio = site.tap(t)
        V = source = bus * ratio
        if self.chord is None:
            current, rates = self._parts(now, V, x)
            return bus, current * ratio, rates
        for _ in range(200):
            current, rates = self._parts(now, V, x)
            left = source - V - site.feeder * current
            if abs(left) < 1e-12:
                # an ideal transformer neither gives nor takes power
                return bus, current * ratio, rates
            V += self.chord[0] * left + self.chord[1] * left.conjugate()
        raise ArithmeticError(f"the voltage behind the feeder collapses at t = {t:.4g} s")

    def _solve(self, begin: np.ndarray) -> None:
        from scipy.integrate import solve_ivp

        site = self.site
        first, last = -MARGIN, site.recorder.duration + MARGIN
        knots = {*self.supply.breaks, *site.tap.times, *site.opened.times, *site.breaks}
        knots |= {*site.static_opened.times, *site.motors_opened.times}
        self.edges = [first, *sorted(k for k in knots if first < k < last), last]
        self.pieces, x = [], begin
        for a, b in pairwise(self.edges):
            solved = solve_ivp(
                self._between(a, b), (a, b), x, "DOP853", dense_output=True, rtol=1e-9, atol=1e-11
            )
            if not solved.success:
                raise ArithmeticError(
                    f"the simulation stopped at t = {solved.t[-1]:.4g} s: {solved.message}"
                )
            self.pieces.append(solved.sol)
            x = solved.y[:, -1]
        speeds = [
            piece(piece.ts)[own.start + 1].real for piece in self.pieces for own in self._motors()
        ]
        self.lowest_speed = float(min(map(np.min, speeds)))

    def _between(self, a: float, b: float) -> Callable[[float, np.ndarray], list[complex]]:
        """The derivatives between two edges. `ArithmeticError` where a state chatters about a limit
        of a control.
        """
        calls = 0

        def derivative(t: float, x: np.ndarray) -> list[complex]:
            nonlocal calls
            calls += 1
            if calls > MOST:
                raise ArithmeticError(
                    f"the simulation chatters at t = {t:.4g} s: {MOST} derivatives do not suffice"
                )
            inside = min(max(t, a + 1e-10), b - 1e-10)  # a jump at an edge belongs to the neighbor
            return self.network(inside, x.tolist())[2]

        return derivative

    def _motors(self) -> list[slice]:
        return self.slices[: len(self.site.motors)]

    def states(self, t: np.ndarray) -> np.ndarray:
        """States (k, n) at times t (n,), in order of the parts."""
        piece = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, len(self.pieces) - 1)
        out = np.empty((self.slices[-1].stop, len(t)), dtype=complex)
        for k in np.unique(piece):
            out[:, piece == k] = self.pieces[k](t[piece == k])
        return out

    def at(self, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Bus voltage and current (n,) [pu] at times t (n,) [s], phasors in the frame of the
        recorded frequency.
        """
        states = self.states(t).T.tolist()
        pairs = [self.network(float(now), x)[:2] for now, x in zip(t, states, strict=True)]
        voltage, current = np.array(pairs).T
        return voltage, current
