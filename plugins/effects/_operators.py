"""Shapes that several effects share: limits with a rounded corner, so that derivatives exist
everywhere.
"""


def smaller(a, b, width):
    """The smaller of two, rounded where they are closer than `width`; below both, and smooth."""
    import sympy

    return (a + b - sympy.sqrt((a - b) ** 2 + width**2)) / 2


def larger(a, b, width):
    """The larger of two, rounded where they are closer than `width`; above both, and smooth."""
    return -smaller(-a, -b, width)


def ramp(x, width, least=0):
    """`least` up to there, x beyond, and 1 from 1 on: its corners rounded over `width`."""
    return smaller(1, larger(least, x, width), width)


def gate(x, width):
    """0 well below x = 0, 1 well above: a logistic step."""
    import sympy

    return 1 / (1 + sympy.exp(-x / width))


def seen_late(eq, u, time):
    """u as a control sees it through a fast filter: where it was `time` ago, to first order in
    `time`.
    """
    return u * (1 - time * eq.U_rate / eq.U)


def bent(x, knots, bends, width):
    """x, but with the slope exp(bend) beyond each knot and rounded there: monotone, and x itself
    without bends.

    0 at x = 0. `knots` ascend and are positive.
    """
    import sympy

    y, slope = x, 1
    for knot, bend in zip(knots, bends, strict=True):
        y += (sympy.exp(bend) - slope) * (larger(x - knot, 0, width) - larger(-knot, 0, width))
        slope = sympy.exp(bend)
    return y


def evaluate_law(law, x):
    """The values (n,) of a law at x (n,), for a page."""
    import sympy

    symbol = sympy.Symbol("x", real=True)
    return sympy.lambdify(symbol, sympy.sympify(law(symbol)), "numpy")(x) + 0 * x
