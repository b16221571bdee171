"""What happens in each phase by itself, written with the space vector and the zero sequence of
three phases.
"""


def phases_of(eq, vector, zero):
    """The three phases of a space vector in the turning frame and of a zero sequence."""
    return [eq.parts(eq.turn * (vector * _rotate_phase(-k)))[0] + zero for k in range(3)]


def vector_of(eq, phases):
    """The space vector in the turning frame of three phases, and their zero sequence."""
    from sympy import Rational, conjugate

    still = Rational(2, 3) * sum(_rotate_phase(k) * x for k, x in enumerate(phases))
    return conjugate(eq.turn) * still, sum(phases) / 3


def beyond(x, knee):
    """By how much x lies beyond +-knee."""
    import sympy

    return sympy.Max(0, x - knee) - sympy.Max(0, -x - knee)


def detect_departure(eq, level):
    """1 in a moment at which the voltage is off by more than `level` of that before the event, else
    0.
    """
    import sympy

    off = eq.recorded_voltage - eq.U0
    square = sum(part**2 for part in eq.parts(off))
    # all of it 5 % farther
    return sympy.Min(1, sympy.Max(0, 10 * (square / (level * eq.U0) ** 2 - 1)))


def _rotate_phase(k):
    """exp(j k 120 degrees)."""
    from sympy import I, Rational, sqrt

    k = k % 3
    return (1, Rational(-1, 2) + I * sqrt(3) / 2, Rational(-1, 2) - I * sqrt(3) / 2)[k]
