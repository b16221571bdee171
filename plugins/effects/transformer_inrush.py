"""Inrush of transformers when the voltage recovers."""

from tractexp.model.parts import Effect
from tractexp.parameter import Parameter
from tractexp.plugin import plugin

SOURCE = "Blume et al. 1951, Transformer Engineering; decay of the flux offset after energization"
CYCLE = 0.02  # s: a rise of the voltage is what one cycle of it gains on the cycle before
STILL = 0.02  # of U_0: slower rises leave no offset in the flux; keeps noise of the voltage out
LOSS = 0.1  # active over reactive power of the inrush current


@plugin
class TransformerInrush(Effect):
    """A sudden rise of the voltage leaves an offset in the transformers' flux, whose magnetizing current decays.

        dx/dt = max(0, u - y - 0.02)/T_c - x/T_i,   T_c dy/dt = u - y,   u = U/U_0,   T_c = 20 ms
        Q -> Q + q_i x,   P -> P + 0.1 q_i x

    After a step up of the voltage by du, x is a little less than du and decays with T_i. At q_i = 0 the base model.

    Source: Blume et al. 1951: the offset decays with the circuit's L/R, a tenth to about a second.
    Departures: the current's dependence on the instant of recovery and its harmonics are left out; linear in the
    rise of the voltage.
    """

    inrush = Parameter(0.0, (0.0, 2.0), "pu", "reactive power after a rise by U_0", SOURCE, "q_i", null=0.0)
    inrush_time = Parameter(0.3, (0.03, 2.0), "s", "time constant of the decay", SOURCE, "T_i")

    grid = {"inrush_time": (0.05, 0.1, 0.3, 1.0)}
    relevant = {"inrush": 0.05}
    confused_with = ("exponential_recovery", "magnetic_saturation")

    def edit(self, eq):
        from tractexp.model.equations import sympy

        q, time = eq.declare(self.parameters)
        x, y = eq.state("inrush_flux", "x"), eq.state("cycle_voltage", "y")
        u = eq.U / eq.U0
        eq.moves(x, sympy.Max(0, u - y - STILL) / CYCLE - x / time, 0)
        eq.moves(y, (u - y) / CYCLE, 1)
        eq.consume(LOSS * q * x, q * x)
        eq.settled = False
