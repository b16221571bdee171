"""An exported load is played back: what its file says is simulated, and compared with the fit along
a dip.

The simulator of the format does it where that is installed; elsewhere ours, from the numbers read
back from the file. Both are driven by the same voltage, so that what differs is the export's:
rounding, bases, conventions, what the format lacks.
"""

from dataclasses import dataclass, replace

import numpy as np

from tractexp.errors import UserError
from tractexp.exchange.format import Format, Identified, Restored, Simulated
from tractexp.model.drive import Drive, Excitation

STEP, LENGTH = 1e-3, 1.2  # s
DEPTH = 0.4  # of the voltage before
# s: where the voltage falls and comes back, and how long either takes
FALL, RISE, EDGE = 0.2, 0.4, 0.05
STEPS_A_SAMPLE = 8  # Runge-Kutta steps a sample of another simulator's


@dataclass(frozen=True)
class Agreement:
    """How well an exported load agrees with the fit.

    Attributes
    ----------
    by : str
        What played it.
    off : (P, Q) [pu]
        How far it is off the fit at most.
    moved : (P, Q) [pu]
        How far the power moves in all.
    """

    by: str
    off: tuple[float, float]
    moved: tuple[float, float]

    @property
    def share(self) -> float:
        """The larger difference over what its power moves."""
        return max(
            off / moved if moved else 0.0 for off, moved in zip(self.off, self.moved, strict=True)
        )

    def describe_differences(self, scale: float, units: tuple[str, str]) -> str:
        """In a sentence, with powers times `scale` in `units`."""
        parts = [
            f"{power} differs by at most {scale * off:.2g} {unit} where it moves by"
            f" {scale * moved:.3g}"
            for power, off, moved, unit in zip("PQ", self.off, self.moved, units, strict=True)
        ]
        return (
            f"played back by {self.by} along a dip to {1 - DEPTH:.0%} of the voltage:"
            f" {', '.join(parts)}"
        )


def dip(step: float = STEP) -> np.ndarray:
    """The voltage (N,) of the dip along which exports are played, over that before it.

    Parameters
    ----------
    step : float [s]
        Between samples.
    """
    t = np.arange(round(LENGTH / step) + 1) * step
    fallen, back = (
        0.5 - 0.5 * np.cos(np.pi * np.clip((t - at) / EDGE, 0, 1)) for at in (FALL, RISE)
    )
    return 1 - DEPTH * (fallen - back)


def play_back_export(
    form: Format, text: str, load: Identified
) -> tuple[Agreement | None, list[str]]:
    """How well an export's text agrees with the fit, None where it cannot be played; and why, or
    why not elsewhere.
    """
    notes = []
    for play in (_play_in_other_simulator, _play_in_this_simulator):
        try:
            if (agreement := play(form, text, load)) is not None:
                return agreement, notes
        except UserError as error:
            notes.append(str(error))
    return None, notes


def _play_in_other_simulator(form: Format, text: str, load: Identified) -> Agreement | None:
    """In the simulator of the format; None where that is not at hand."""
    there = form.play_back_dip(text, load)
    return there and _measure_agreement(
        there.by, play_load(load, there, there.P[0], there.Q[0]), (there.P, there.Q)
    )


def _play_in_this_simulator(form: Format, text: str, load: Identified) -> Agreement:
    """In ours, by the numbers of the file."""
    restored = form.read_back(text, load)
    if restored is None:
        raise UserError(f"not played back: the format '{form.name}' reads nothing back")
    U, before = load.result.before["U0"] * dip(), load.result.before
    along = Simulated(
        "our own simulator, from the file's numbers,", STEP, U, np.zeros_like(U), U, U
    )
    fit = play_load(load, along, load.ratio * before["P0"], load.ratio * before["Q0"])
    return _measure_agreement(along.by, fit, _simulate_restored_load(restored, load, along))


def play_load(
    load: Identified, along: Simulated, P0: float, Q0: float
) -> tuple[np.ndarray, np.ndarray]:
    """P and Q (N,) [pu] of a load along a voltage, drawing P0 and Q0 before it."""
    U, flat = along.U, np.full(len(along.U), np.nan)
    one = Excitation(
        along.step,
        U,
        flat,
        flat,
        float(U[0]),
        P0,
        Q0,
        along.speed,
        float(along.speed[0]),
        load.omega_n,
    )
    drive, values = (
        Drive.from_events([one]),
        np.array([load.values[name] for name in load.model.names]),
    )
    if refusal := load.model.refusal(values, drive):
        raise UserError(f"not played back: {refusal}")
    answer = load.model.simulate(drive, values, STEPS_A_SAMPLE)
    return answer.P[0], answer.Q[0]


def _simulate_restored_load(
    restored: Restored, load: Identified, along: Simulated
) -> tuple[np.ndarray, np.ndarray]:
    """P and Q (N,) of what a file describes: its motor draws what it does, its static part what the
    file says.
    """
    result = replace(load.result, model=dict(restored.model), parameters=dict(restored.parameters))
    of_file = Identified(replace(result, own_base={}), load.bus, load.power, load.voltage)
    U0, flat = float(along.U[0]), np.full(2, float(along.U[0]))
    probe = Drive.from_events(
        [Excitation(along.step, flat, flat, flat, U0, 1.0, 0.0, omega_n=load.omega_n)]
    )
    at_rest = of_file.model.at_rest(
        np.array([of_file.values[name] for name in of_file.model.names]), probe
    )
    P0, Q0 = (
        at_rest.get(f"{x}_motor", 0.0) + static
        for x, static in zip("PQ", restored.static, strict=True)
    )
    return play_load(of_file, along, P0, Q0)


def _measure_agreement(
    by: str, fit: tuple[np.ndarray, np.ndarray], there: tuple[np.ndarray, np.ndarray]
) -> Agreement:
    """How far P and Q of a playback are from those of the fit, and how far those move."""
    off = [float(np.abs(a - b).max()) for a, b in zip(fit, there, strict=True)]
    moved = [float(np.ptp(a)) for a in fit]
    return Agreement(by, (off[0], off[1]), (moved[0], moved[1]))
