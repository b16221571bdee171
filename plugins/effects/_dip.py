"""How long ago the dip began, and how long ago the voltage returned: told from the voltage, sample by sample."""

from tractexp_plugins.effects._operators import gate

LEVEL, BEGUN = 0.0015, 0.96  # how sharp a level is, and the voltage over U_0 below which a dip has begun


def since(eq, returned, name):
    """Time [s] since the dip began, or since the voltage had `returned` from its lowest by more than half; 0 before."""
    import sympy

    u = eq.U / eq.U0
    lowest, time = eq.memory(f"lowest_{name}", r"u_{min}"), eq.memory(f"time_{name}", "t_d")
    eq.renews(lowest, sympy.Min(lowest, u), 1)
    begun = gate(BEGUN - lowest, LEVEL)
    over = begun * gate(u - (1 + lowest) / 2, LEVEL) if returned else begun
    eq.renews(time, time + eq.step * sympy.Max(over, gate(time - eq.step, 0.04 * eq.step)), 0)
    return time
