"""An undervoltage relay and the contactors behind it, on the samples: what every effect that trips has in common."""

from ._operators import gate

LEVEL, TIME = 0.0025, 0.3  # how sharp a relay is: in voltage over U_0, and in samples


def opened(eq, level, delay, wait, margin, ramp, stage=""):
    """What is open, 0 to 1: all once the voltage stayed below `level` for `delay`, until it stayed above for `wait`.

    Then it returns within `ramp`. `stage` ends the names of a second relay's states.
    """
    import sympy

    u = eq.U / eq.U0
    of = rf"\mathrm{{{stage.strip('_')}}}"
    first, then = (f"_{{{of}}}", f",{of}") if stage else ("", "")  # a symbol's only index, and one after another
    below = eq.memory(f"time_below{stage}", f"t_{{b{then}}}")
    above = eq.memory(f"time_above{stage}", f"t_{{a{then}}}")
    tripped = eq.memory(f"tripped{stage}", f"g{first}")
    low = eq.define(f"voltage_low{stage}", gate(level - u, LEVEL), rf"\ell{first}")
    high = eq.define(f"voltage_back{stage}", gate(u - level - margin, LEVEL), f"b{first}")
    goes = eq.define(f"relay_goes{stage}", low * gate(below - delay, TIME * eq.step), f"g_{{+{then}}}")
    returns = eq.define(f"relay_returns{stage}", high * gate(above - wait, TIME * eq.step), f"g_{{-{then}}}")
    eq.renews(below, low * (below + eq.step), 0)
    eq.renews(above, high * (above + eq.step), 0)
    remaining = sympy.Max(0, tripped - returns * eq.step / (ramp + eq.step))
    eq.renews(tripped, remaining + (1 - remaining) * goes, 0)
    return tripped


def stages(eq, first, last, delay, waits, margin, ramp, name):
    """How much is open of equal stages, 0 to 1: relays with levels evenly from `first` to `last`, one for each of
    `waits`, as `opened` has them. `name` begins the ends of the names of their states.
    """
    steps = len(waits) - 1
    return sum(
        opened(eq, first + (last - first) * k / steps, delay, wait, margin, ramp, f"_{name}{k + 1}")
        for k, wait in enumerate(waits)
    ) / (steps + 1)
