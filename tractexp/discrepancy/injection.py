"""What an unknown effect could look like: a push into one equation during one window of time.

Not an effect of the catalogue but the yardstick of adequacy: if pushes of no catalogued origin still help after an
effect was added, the effect is not the explanation. Source: score test of a variance component (Lin 1997).
"""

from tractexp.model.parts import Effect
from tractexp.parameter import Parameter

SOURCE = "a unit push, for the tangent space only"
EDGE = 0.002  # s: how sharp a window starts and ends


class Injection(Effect):
    """Adds push_k to the k-th balance between `window_on` and `window_off` [s since the first sample]."""

    name = "injection"

    def __repr__(self) -> str:
        return "Injection()"

    order = 2
    parameters = (
        *(
            Parameter(0.0, (-1.0, 1.0), "pu", f"push into {what}", SOURCE, null=0.0, name=f"push_{what}")
            for what in ("flux_d", "flux_q", "speed", "P", "Q")
        ),
        Parameter(0.0, (-1e3, 1e3), "s", "start of the window", SOURCE, name="window_on"),
        Parameter(1.0, (-1e3, 1e3), "s", "end of the window", SOURCE, name="window_off"),
    )

    def edit(self, eq):
        from tractexp.model.equations import I, sympy

        flux_d, flux_q, speed, P, Q, on, off = eq.declare(self.parameters)
        ramp = lambda at: sympy.Max(0, sympy.Min(1, (eq.t - at) / EDGE))  # noqa: E731
        gate = ramp(on) - ramp(off)
        for symbol, state in eq.states.items():
            if symbol.name == "E":
                state.derivative += gate * (flux_d + I * flux_q)
            elif symbol.name == "omega":
                state.derivative += gate * speed
        eq.consume(gate * P, gate * Q)
        eq.settled = False


PUSHES = tuple(p.name for p in Injection.parameters[:5])
