"""Shapes that several effects share: limits with a rounded corner, so that derivatives exist
everywhere.
"""


def smaller(a, b, width):
    """The smaller of two, rounded where they are closer than `width`; below both, and smooth.

        (a + b - sqrt((a - b)^2 + width^2))/2

    Parameters
    ----------
    a, b : Expr or float
        In one unit.
    width : float
        In that unit.

    Returns
    -------
    Expr
    """
    import sympy

    return (a + b - sympy.sqrt((a - b) ** 2 + width**2)) / 2


def larger(a, b, width):
    """The larger of two, rounded where they are closer than `width`; above both, and smooth.

    Parameters
    ----------
    a, b, width
        As of `smaller`.

    Returns
    -------
    Expr
    """
    return -smaller(-a, -b, width)


def ramp(x, width, least=0):
    """A ramp: `least` up to there, x beyond, and 1 from 1 on; its corners are rounded over `width`.

    Parameters
    ----------
    x : Expr
        What rises from 0 to 1.
    width, least : float
        In the unit of x.

    Returns
    -------
    Expr
    """
    return smaller(1, larger(least, x, width), width)


def gate(x, width):
    """A smooth switch, the logistic function 1/(1 + exp(-x/width)): 0 well below x = 0, 1/2 there,
    1 well above, within 2 % of either from 4 widths on.
    """
    import sympy

    return 1 / (1 + sympy.exp(-x / width))


def seen_late(eq, u, time):
    """u as a control sees it through a fast filter: where it was `time` [s] ago, to first order.

    u (1 - time (dU/dt)/U)
    """
    return u * (1 - time * eq.U_rate / eq.U)


def bent(x, knots, bends, width):
    """A monotone curve through 0 that is x up to the first knot and bends at each.

    Parameters
    ----------
    x : Expr
        What is bent.
    knots : positive floats, ascending
        Where it bends, in the unit of x.
    bends : Expr for each knot
        The logarithm of the slope beyond it; without bends the curve is x itself.
    width : float
        Over which a corner is rounded, in the unit of x.

    Returns
    -------
    Expr
    """
    import sympy

    y, slope = x, 1
    for knot, bend in zip(knots, bends, strict=True):
        y += (sympy.exp(bend) - slope) * (larger(x - knot, 0, width) - larger(-knot, 0, width))
        slope = sympy.exp(bend)
    return y


def evaluate_law(law, x):
    """The values (n,) of a law of one variable at x (n,), for a page."""
    import sympy

    symbol = sympy.Symbol("x", real=True)
    return sympy.lambdify(symbol, sympy.sympify(law(symbol)), "numpy")(x) + 0 * x
