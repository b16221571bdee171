"""What begins with a dip or after it, told from the voltage, sample by sample."""

from tractexp.extend import sites

from ._operators import gate, ramp

# how sharp a level is, and the voltage over U_0 below which a dip has begun
LEVEL, BEGUN = 0.0015, 0.96
CHANGE_CORNER = 0.02  # of a change: how rounded its corners are


def since(eq, returned, name):
    """The time [s] since the dip began, or since the voltage had come back from its lowest by more
    than half, where `returned` is asked for; 0 before.
    """
    import sympy

    u = eq.U / eq.U0
    lowest, time = eq.memory(f"lowest_{name}", r"u_{min}"), eq.memory(f"time_{name}", "t_d")
    eq.renews(lowest, sympy.Min(lowest, u), 1)
    begun = gate(BEGUN - lowest, LEVEL)
    over = begun * gate(u - (1 + lowest) / 2, LEVEL) if returned else begun
    eq.renews(time, time + eq.step * sympy.Max(over, gate(time - eq.step, 0.04 * eq.step)), 0)
    return time


def changes(eq, returned, name, more_P, more_Q, wait, duration, static):
    """Let P and Q change by shares of themselves within `duration` [s], `wait` [s] after the time
    of `since`.

    Where `static` is 1 all but the motors change.
    """
    time = since(eq, returned, name)
    begun, before = (ramp((t - wait) / duration, CHANGE_CORNER) for t in (time, 0))
    way = eq.define(f"changed_{name}", begun - before, "r")
    if eq.waves:
        places = ((sites.current, sites.motor_current, more_P),)
    else:
        places = ((sites.P, sites.P_motor, more_P), (sites.Q, sites.Q_motor, more_Q))
    for site, motor, size in places:
        there = motor in eq
        spared = static * eq[motor] if there else 0
        eq.edit(site, lambda drawn, size=size, spared=spared: drawn + size * way * (drawn - spared))
