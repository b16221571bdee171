"""An undervoltage relay and the contactors behind it, on the samples: what every effect that trips
has in common.
"""

from ._operators import gate

LEVEL, TIME = 0.0025, 0.2  # how sharp a relay is: in voltage over U_0, and in samples


def compute_open_share(eq, level, delay, wait, margin, ramp, stage=""):
    """The open share, 0 to 1: all once the voltage stayed below `level` for `delay`, until it
    stayed above for `wait`.

    Then it returns within `ramp`. Between samples the voltage is a line, so that the timers start
    where it crosses a level. `stage` ends the names of a second relay's states.
    """
    import sympy

    of = rf"\mathrm{{{stage.strip('_')}}}"
    # a symbol's only index, and one after another
    first, then = (f"_{{{of}}}", f",{of}") if stage else ("", "")
    u, last = eq.U / eq.U0, eq.memory(f"voltage_last{stage}", f"u_{{-{then}}}")
    below = eq.memory(f"time_below{stage}", f"t_{{b{then}}}")
    above = eq.memory(f"time_above{stage}", f"t_{{a{then}}}")
    tripped = eq.memory(f"tripped{stage}", f"g{first}")
    low = eq.define(f"voltage_low{stage}", gate(level - u, LEVEL), rf"\ell{first}")
    high = eq.define(f"voltage_back{stage}", gate(u - level - margin, LEVEL), f"b{first}")
    longer_low = below + eq.step * _share(level - last, level - u)
    longer_high = above + eq.step * _share(last - level - margin, u - level - margin)
    goes = eq.define(
        f"relay_goes{stage}", low * gate(longer_low - delay, TIME * eq.step), f"g_{{+{then}}}"
    )
    returns = eq.define(
        f"relay_returns{stage}", high * gate(longer_high - wait, TIME * eq.step), f"g_{{-{then}}}"
    )
    eq.renews(last, u, 1)
    eq.renews(below, low * longer_low, 0)
    eq.renews(above, high * longer_high, 0)
    remaining = sympy.Max(0, tripped - returns * eq.step / (ramp + eq.step))
    eq.renews(tripped, remaining + (1 - remaining) * goes, 0)
    return tripped


def _share(last, now):
    """The share of a step in which the line from `last` to `now` is positive, rounded where both
    are near 0.
    """
    import sympy

    return (1 + (last + now) / sum(sympy.sqrt(x**2 + LEVEL**2) for x in (last, now))) / 2


def stages(eq, first, last, delay, waits, margin, ramp, name):
    """The share, 0 to 1, that is open of equal stages.

    The relays have levels evenly spaced from `first` to `last`, one for each of `waits`, and open
    as in `compute_open_share`. `name` begins the ends of the names of their states.
    """
    steps = len(waits) - 1
    return sum(
        compute_open_share(
            eq, first + (last - first) * k / steps, delay, wait, margin, ramp, f"_{name}{k + 1}"
        )
        for k, wait in enumerate(waits)
    ) / (steps + 1)
