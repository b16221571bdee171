"""What a term may follow, as expressions: each function is copied as it stands into the plugin file
of a proposal.

Every function takes the equations and its parameters by name and gives a real expression that is 0
before the event. Functions of time take the clock that they count by: 0 at the instant from which
it counts, less than 0 before.
"""

# of decisions; a dip is this deep; it ends when this share of it is back
SHARP, FALLEN, RISEN = 1e4, 0.02, 0.1


def step_at_zero(x):
    """0 below x = 0, 1 above."""
    import sympy

    return sympy.Max(0, sympy.Min(1, SHARP * x))


def round_corner(x, width):
    """The larger of x and 0, rounded where x is smaller than `width`."""
    import sympy

    return (x + sympy.sqrt(x**2 + width**2)) / 2


def step_at_instant(eq, clock, instant):
    """0 until the clock has reached an instant, 1 one sample later."""
    import sympy

    return sympy.Max(0, sympy.Min(1, (clock - instant) / eq.step + 1))


# Clocks


def of_record(eq):
    """Time since the first sample of the record."""
    return eq.t


def of_dip(eq):
    """Time since the first sample at which a dip is 2 % deep."""
    import sympy

    low = step_at_zero(1 - FALLEN - eq.U / eq.U0)
    fallen = eq.memory("time_since_dip", "t_d")
    eq.renews(fallen, (fallen + eq.step) * sympy.Max(low, sympy.Min(1, fallen / eq.step)), 0)
    return fallen - eq.step


def of_return(eq):
    """Time since the first sample at which a tenth of the dip is back."""
    import sympy

    u = eq.U / eq.U0
    lowest, back = eq.memory("voltage_lowest", r"\check u"), eq.memory("time_since_return", "t_b")
    eq.renews(lowest, sympy.Min(lowest, u), 1)
    risen = step_at_zero(u - lowest - RISEN * (1 - lowest)) * step_at_zero(1 - FALLEN - lowest)
    eq.renews(back, (back + eq.step) * sympy.Max(risen, sympy.Min(1, back / eq.step)), 0)
    return back - eq.step


# Functions of time, which the voltage does not explain


def step(eq, clock, instant):
    """A step at an instant."""
    return step_at_instant(eq, clock, instant)


def ramp(eq, clock, instant):
    """A straight line that begins at an instant."""
    import sympy

    return sympy.Max(0, clock - instant)


def decay(eq, clock, instant, time):
    """A step at an instant that decays."""
    import sympy

    return step_at_instant(eq, clock, instant) * sympy.exp(-sympy.Max(0, clock - instant) / time)


def ring(eq, clock, instant, time, frequency, phase):
    """An oscillation that begins at an instant and decays."""
    import sympy

    since = sympy.Max(0, clock - instant)
    turns = 2 * sympy.pi * frequency * since + phase
    return step_at_instant(eq, clock, instant) * sympy.exp(-since / time) * sympy.cos(turns)


# Functions of the voltage


def power(eq, exponent):
    """A power of the voltage, less 1."""
    return (eq.U / eq.U0) ** exponent - 1


def knee(eq, level):
    """What the voltage lacks to a level."""
    return round_corner(level - eq.U / eq.U0, 0.0025) - round_corner(level - 1, 0.0025)


def knee_squared(eq, level):
    """What the voltage lacks to a level, squared."""
    return round_corner(level - eq.U / eq.U0, 0.0025) ** 2 - round_corner(level - 1, 0.0025) ** 2


def below(eq, level):
    """1 while the voltage is below a level."""
    import sympy

    return 1 / (1 + sympy.exp((eq.U / eq.U0 - level) / 0.0025))


def rate(eq):
    """The slope of the voltage."""
    return eq.U_rate / eq.U0


def lag(eq, time):
    """The voltage as a first-order lag sees it, less 1."""
    x = eq.lag("voltage_late", "x")
    eq.moves(x, (eq.U / eq.U0 - x) / time, 1)
    return x - 1


def washout(eq, time):
    """The voltage less what a first-order lag sees of it."""
    x = eq.lag("voltage_slow", "x")
    eq.moves(x, (eq.U / eq.U0 - x) / time, 1)
    return eq.U / eq.U0 - x


def relay(eq, level, margin, delay, wait, ramp):
    """1 from when the voltage has been below a level for a delay; back along a ramp once it has
    been up for a while.
    """
    import sympy

    u = eq.U / eq.U0
    low, up, gone = (
        eq.memory("time_low", "t_-"),
        eq.memory("time_up", "t_+"),
        eq.memory("gone", "g"),
    )
    fallen, risen = (
        sympy.Max(0, sympy.Min(1, x / 0.005 + 0.5)) for x in (level - u, u - level - margin)
    )
    eq.renews(low, fallen * (low + eq.step), 0)
    eq.renews(up, risen * (up + eq.step), 0)
    goes = fallen * sympy.Max(0, sympy.Min(1, (low - delay) / eq.step + 1))
    returns = risen * sympy.Max(0, sympy.Min(1, (up - wait) / eq.step + 1))
    left = sympy.Max(0, gone - returns * eq.step / (ramp + eq.step))
    eq.renews(gone, sympy.Max(left, goes), 0)
    return gone


# Functions of the motor's states


def field(eq):
    """The square of the internal voltage over that before the event, less 1."""
    from sympy import conjugate, re

    E, E_0 = eq["E"], eq.evaluate_before(eq["E"])
    return re(E * conjugate(E)) / re(E_0 * conjugate(E_0)) - 1


def field_knee(eq, level):
    """What the square of the internal voltage, over that before the event, has beyond a level; less
    before.
    """
    from sympy import conjugate, re

    E, E_0 = eq["E"], eq.evaluate_before(eq["E"])
    square = re(E * conjugate(E)) / re(E_0 * conjugate(E_0))
    return round_corner(square - level, 0.01) - round_corner(1 - level, 0.01)


def slip(eq):
    """The slip, less that before the event."""
    return (eq.omega_s - eq.omega - eq.evaluate_before(eq.omega_s - eq.omega)) / eq.omega_n


def slip_squared(eq):
    """The square of the slip, less that before the event."""
    return (
        (eq.omega_s - eq.omega) ** 2 - eq.evaluate_before(eq.omega_s - eq.omega) ** 2
    ) / eq.omega_n**2


def current(eq):
    """The motor's current over that before the event, less 1."""
    import sympy
    from sympy import conjugate, re

    I_d = eq.expand(eq["stator_current"])
    I_0 = eq.evaluate_before(I_d)
    return sympy.sqrt(re(I_d * conjugate(I_d)) / re(I_0 * conjugate(I_0)) + 1e-12) - 1


def current_squared(eq):
    """The square of the motor's current over that before the event, less 1."""
    from sympy import conjugate, re

    I_d = eq.expand(eq["stator_current"])
    I_0 = eq.evaluate_before(I_d)
    return re(I_d * conjugate(I_d)) / re(I_0 * conjugate(I_0)) - 1


def constant(eq):
    """1."""
    return 1
