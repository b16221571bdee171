"""Where a term may act, as edits of the equations: each function is copied as it stands into a
proposal's plugin file.

Every function takes the equations, the signal g (real, 0 before the event) and its sizes by name.
"""

from tractexp.extend import sites


def power_P(eq, g, size):
    """P -> P + k g."""
    eq.consume(size * g, 0)


def power_Q(eq, g, size):
    """Q -> Q + k g."""
    eq.consume(0, size * g)


def power(eq, g, size_P, size_Q):
    """P -> P + k_P g, Q -> Q + k_Q g."""
    eq.consume(size_P * g, size_Q * g)


def whole(eq, g, size):
    """P -> P (1 + k g), Q -> Q (1 + k g)."""
    for site in (sites.current,) if eq.waves else (sites.P, sites.Q):
        eq.edit(site, lambda drawn: drawn * (1 + size * g))


def static(eq, g, size):
    """P_s -> P_s (1 + k g), Q_s -> Q_s (1 + k g)."""
    for site in (sites.P_static, sites.Q_static):
        eq.edit(site, lambda drawn: drawn * (1 + size * g))


def static_P(eq, g, size):
    """P_s -> P_s (1 + k g)."""
    eq.edit(sites.P_static, lambda drawn: drawn * (1 + size * g))


def static_Q(eq, g, size):
    """Q_s -> Q_s (1 + k g)."""
    eq.edit(sites.Q_static, lambda drawn: drawn * (1 + size * g))


def motor(eq, g, size):
    """P_d -> P_d (1 + k g), Q_d -> Q_d (1 + k g)."""
    for site in (sites.motor_current,) if eq.waves else (sites.P_motor, sites.Q_motor):
        eq.edit(site, lambda drawn: drawn * (1 + size * g))


def torque(eq, g, size):
    """T_L -> T_L + k g."""
    eq.edit(sites.load_torque, lambda T: T + size * g)


def coupling(eq, g, size):
    """c -> c (1 + k g)."""
    eq.edit(sites.coupling, lambda c: c * (1 + size * g))


def decay(eq, g, size):
    """tau' -> tau'/(1 + k g)."""
    import sympy

    eq.edit(sites.time_constant, lambda tau: tau / sympy.Max(0.05, 1 + size * g))


def magnetizing(eq, g, size):
    """c -> c/(1 + k g), tau' -> tau'/(1 + k g)."""
    import sympy

    for site in (sites.coupling, sites.time_constant):
        eq.edit(site, lambda x: x / sympy.Max(0.05, 1 + size * g))


def resistance(eq, g, size):
    """Z' -> Z' + k g."""
    eq.edit(sites.stator_impedance, lambda Z: Z + size * g)


def reactance(eq, g, size):
    """Z' -> Z' + j k g."""
    from sympy import I

    eq.edit(sites.stator_impedance, lambda Z: Z + I * size * g)


def angle(eq, g, size):
    """V -> V (1 + j k g)."""
    from sympy import I

    eq.edit(sites.motor_voltage, lambda V: V * (1 + I * size * g))


def voltage(eq, g, size):
    """V -> V (1 + k g), u -> u (1 + k g)."""
    for site in (sites.motor_voltage, sites.static_voltage):
        eq.edit(site, lambda V: V * (1 + size * g))
