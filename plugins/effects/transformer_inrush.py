"""Inrush of transformers when the voltage recovers."""

from tractexp.extend import Effect, Parameter, plugin

SOURCE = "Blume et al. 1951, Transformer Engineering; decay of the flux offset after energization"
# s, or one sample where those are longer: a rise is what the voltage gains on itself so long ago
CYCLE = 0.003
# of U_0 per s: slower rises leave no offset in the flux; keeps noise of the voltage out
STILL = 0.3
SHALLOW = 0.05  # of U_0: the least dip a rise is referred to


@plugin
class TransformerInrush(Effect):
    """A sudden rise of the voltage leaves an offset in the transformers' flux, which drives their
    cores past the knee.

        dx/dt = max(0, (u - y)/T_c - 0.3) (1 - u_low)^(g - 1) - x/T_i,   T_c dy/dt = u - y,
        T_c = 3 ms
        Q -> Q + q_i u^2 e^(3/2) (1 - 0.15 e),   P -> P + r_i (the same),
        e = max(0, 1 - (1 + m - x)/u),   u = U/U_0

    After a step up of the voltage by du, x is a little less than du^g and decays with T_i. While
    the peak of the flux is beyond the knee, m above that before, by the share e of the voltage, the
    core draws reactive power. u_low is the lowest voltage so far. At q_i = 0 the base model,
    whatever the rest.

    Source: Blume et al. 1951: two-slope core, the offset decays with the circuit's L/R, a tenth to
    about a second.
    Departures: the offset's dependence on the instant of recovery is g alone (1: as the rise; 0:
    the same after any dip); harmonics are left out; the two-slope core's fundamental acos(r) - r
    sqrt(1 - r^2), r = 1 - e, is its first two terms.
    """

    inrush = Parameter(
        0.0,
        (0.0, 5.0),
        "pu",
        "reactive power at an excess flux of 1 pu",
        SOURCE,
        "q_i",
        null=0.0,
        power_exponent=1,
    )
    inrush_time = Parameter(0.3, (0.03, 2.0), "s", "time constant of the decay", SOURCE, "T_i")
    knee_margin = Parameter(0.1, (0.0, 0.6), "pu", "flux before to knee", SOURCE, "m")
    offset_exponent = Parameter(
        1.0, (0.0, 1.5), "1", "how the offset grows with the rise", SOURCE, "g"
    )
    inrush_loss = Parameter(0.05, (0.0, 0.3), "1", "active over reactive power", SOURCE, "r_i")

    places, kind = ("bus",), "lag"
    phasors_only = (
        "in waveforms the flux itself is there, and transformer_saturation says what it draws"
    )
    grid = {
        "inrush_time": (0.1, 0.3, 1.0),
        "knee_margin": (0.02, 0.2),
        "offset_exponent": (0.0, 1.0),
    }
    relevant = {"inrush": 0.05}
    confused_with = ("exponential_recovery", "magnetic_saturation")

    def edit(self, eq, inrush, inrush_time, knee_margin, offset_exponent, inrush_loss):
        import sympy

        x, y = eq.lag("inrush_flux", "x"), eq.lag("cycle_voltage", "y")
        u, lowest = eq.U / eq.U0, eq.memory("lowest_voltage", r"u_{low}")
        eq.renews(lowest, sympy.Min(lowest, u), 1)
        scale = sympy.exp((offset_exponent - 1) * sympy.log(sympy.Max(SHALLOW, 1 - lowest)))
        cycle = sympy.Max(CYCLE, eq.step)
        eq.moves(x, sympy.Max(0, (u - y) / cycle - STILL) * scale - x / inrush_time, 0)
        eq.moves(y, (u - y) / cycle, 1)
        excess = sympy.Max(0, 1 - (1 + knee_margin - x) / u)
        drawn = inrush * u**2 * excess * sympy.sqrt(excess) * (1 - 0.15 * excess)
        eq.consume(inrush_loss * drawn, drawn)
