"""What an unknown effect could look like: a perturbation of one equation during one window of time.

It is no effect of the catalogue but a test of adequacy: if injected perturbations still help after
an effect was added, the effect is not the explanation. Source: score test of a variance component
(Lin 1997).
"""

from typing import TYPE_CHECKING

import numpy as np

from tractexp.inference.residual_statistics import list_windows
from tractexp.model.parts import OWN, Effect
from tractexp.parameter import Parameter

if TYPE_CHECKING:
    from tractexp.inference.context import Context

PUSHES = "injection"
SOURCE = "a unit push, for the tangent space only"
EDGE_SECONDS = 0.002  # s: how sharp a window starts and ends


class Injection(Effect):
    """Adds push_k [pu] to the k-th balance between `window_on` and `window_off` [s since the first
    sample].

    The balances are those of the flux's two axes, the speed, P and Q. Of waveforms the current's
    component along the voltage before the event stands for P, and that which lags it by a quarter
    of a cycle for Q: at that voltage they are the same.
    """

    name = PUSHES

    def __repr__(self) -> str:
        """ "Injection()": all injections are alike, and are stored under this name."""
        return "Injection()"

    order = 2
    parameters = (
        *(
            Parameter(
                0.0, (-1.0, 1.0), "pu", f"push into {what}", SOURCE, null=0.0, name=f"push_{what}"
            )
            for what in ("flux_d", "flux_q", "speed", "P", "Q")
        ),
        Parameter(0.0, (-1e3, 1e3), "s", "start of the window", SOURCE, name="window_on"),
        Parameter(1.0, (-1e3, 1e3), "s", "end of the window", SOURCE, name="window_off"),
    )

    def edit(  # type: ignore[override]
        self, eq, push_flux_d, push_flux_q, push_speed, push_P, push_Q, window_on, window_off
    ):
        """Add pushes to the balances of flux, speed, P and Q between two instants [s], each with an
        edge of `EDGE_SECONDS`.
        """
        from tractexp.model.equations import I, sympy

        ramp = lambda at: sympy.Max(0, sympy.Min(1, (eq.t - at) / EDGE_SECONDS))  # noqa: E731
        gate = ramp(window_on) - ramp(window_off)
        pushes = {"flux": push_flux_d + I * push_flux_q, "speed": push_speed}
        # of the motor itself: a twin that an effect adds follows it
        for state in eq.states.values():
            if state.writer == OWN and state.role in pushes:
                state.derivative += gate * pushes[state.role]
        if eq.waves:
            eq.draw(gate * (push_P - I * push_Q))
        else:
            eq.consume(gate * push_P, gate * push_Q)


PERTURBATIONS = tuple(p.name for p in Injection.parameters[:5])
PUSH = 1e-3  # how hard


def inject_perturbations(context: "Context", unit: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points with a perturbation of one balance in one window.

    Parameters
    ----------
    context : Context
        The records, whose windows are taken of all events together.
    unit : (D,)
        Coordinates of a fit.

    Returns
    -------
    (c, D) array
        The fit with one perturbation of `PUSH` each.
    (c,) ints
        Which balance is perturbed, as in `PERTURBATIONS`.
    """
    at = context.coordinates
    spans = sorted(
        {w for e in range(len(context.events)) for w in list_windows(context.problem, e)}
    )
    points = []
    groups = []
    for g, push in enumerate(PERTURBATIONS):
        for a, b in spans:
            point = at.place_values(unit, {"window_on": a, "window_off": b})
            point[at.column[push]] += PUSH / at.width(push)
            points.append(point)
            groups.append(g)
    return np.array(points), np.array(groups)
