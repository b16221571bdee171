"""Shapes that several effects share: limits with a rounded corner, so that derivatives exist everywhere."""


def smaller(a, b, width):
    """The smaller of two, rounded where they are closer than `width`; below both, and smooth."""
    import sympy

    return (a + b - sympy.sqrt((a - b) ** 2 + width**2)) / 2


def larger(a, b, width):
    """The larger of two, rounded where they are closer than `width`; above both, and smooth."""
    return -smaller(-a, -b, width)


def gate(x, width):
    """0 well below x = 0, 1 well above: a logistic step."""
    import sympy

    return 1 / (1 + sympy.exp(-x / width))


def seen_late(eq, u, time):
    """u as a control sees it through a fast filter: where it was `time` ago, to first order in `time`."""
    return u * (1 - time * eq.U_rate / eq.U)
