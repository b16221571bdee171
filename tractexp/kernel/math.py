"""Elementary functions on lanes: without a branch, without a call, the same bits in every lane.

Errors are relative unless said otherwise, and tested against the C library's. `n` is the
arithmetic, of lanes (`numbers.Numbers`) or of arrays (`arrays.Arrays`), and arguments and results
are its values.
"""

import math
from typing import Any

from tractexp.kernel.numbers import ORDERED

# 1.5 * 2**52: added, it rounds, and leaves the integer in the lowest bits
ROUNDING_ADDEND = 6755399441055744.0
ROUNDING_ADDEND_BITS = 0x4338000000000000  # its bits
# 1 + x and eight terms more, of the least relative error, 1.7e-14, between -ln(2)/2 and ln(2)/2
EXP = (
    2.749308719602412e-06,
    2.4880795102015093e-05,
    0.00019841538962672454,
    0.0013888811173253205,
    0.008333333095244361,
    0.0416666669620825,
    0.1666666666726472,
    0.49999999999664546,
    1.0,
    1.0,
)
ATANH = tuple(1.0 / k for k in range(17, 0, -2))
ROOT_HALF = 0x3FE6A09E667F3BCD  # bits of sqrt(1/2)
ONE = 1023 << 52  # bits of 1
# pi/2 in three parts, the first two of 33 bits: their products with whole numbers below 2**20 are
# exact
QUARTER = (1.5707963267341256, 6.077100506303966e-11, 2.0222662487959506e-21)
SINE = tuple((-1) ** k / math.factorial(2 * k + 1) for k in range(8, 0, -1))
COSINE = tuple((-1) ** k / math.factorial(2 * k) for k in range(8, 1, -1))


def exp(n: Any, x: Any) -> Any:
    """e^x, error below 2e-13 for |x| < 700, whose value it keeps beyond; 1 at 0; nan stays nan."""
    c = n.constant
    x = n.smaller(c(700.0), n.larger(c(-700.0), x))
    whole = n.multiply_add(x, c(1 / math.log(2)), c(ROUNDING_ADDEND), ORDERED)
    half = n.multiply(n.subtract(whole, c(ROUNDING_ADDEND), ORDERED), c(math.log(2)), ORDERED)
    power = n.polynomial(n.subtract(x, half, ORDERED), EXP, ORDERED)
    shift = n.integer("shl", n.as_bits(whole), n.whole(52))
    return n.multiply(power, n.of_bits(n.integer("add", shift, n.whole(ONE))), ORDERED)


def log(n: Any, x: Any) -> Any:
    """ln x, error below 1e-14 of the larger of 1 and itself; -709 at 0, nan stays nan. Of x < 0 it
    has no meaning.
    """
    c = n.constant
    bits = n.as_bits(x)
    two = n.integer("ashr", n.integer("sub", bits, n.whole(ROOT_HALF)), n.whole(52))
    # from sqrt(1/2) to sqrt(2)
    m = n.of_bits(n.integer("sub", bits, n.integer("shl", two, n.whole(52))))
    s = n.divide(n.subtract(m, c(1.0)), n.add(m, c(1.0)))
    odd = n.multiply(n.multiply(c(2.0), s), n.polynomial(n.multiply(s, s), ATANH))
    exponent = n.subtract(
        n.of_bits(n.integer("add", two, n.whole(ROUNDING_ADDEND_BITS))), c(ROUNDING_ADDEND), ORDERED
    )
    spoilt = n.subtract(x, x, ORDERED)  # nan of nan and infinity, else 0
    return n.add(n.multiply_add(exponent, c(math.log(2)), odd), spoilt, ORDERED)


def power(n: Any, x: Any, exponent: float) -> Any:
    """x^p of a number p by exp(p ln x): error below 2e-13 + 1e-14 p; nan where x < 0."""
    size = exp(n, n.multiply(n.constant(exponent), log(n, x)))
    return n.select(n.compare("olt", x, n.constant(0.0)), n.constant(math.nan), size)


def sin(n: Any, x: Any) -> Any:
    """sin x, absolute error below 1e-15 for |x| < 1e6."""
    return _wave(n, x, 0)


def cos(n: Any, x: Any) -> Any:
    """cos x, absolute error below 1e-15 for |x| < 1e6."""
    return _wave(n, x, 1)


def _wave(n: Any, x: Any, ahead: int) -> Any:
    """sin(x + ahead pi/2)."""
    c = n.constant
    shifted = n.multiply_add(x, c(2 / math.pi), c(ROUNDING_ADDEND), ORDERED)
    whole = n.subtract(shifted, c(ROUNDING_ADDEND), ORDERED)
    r = x
    for part in QUARTER:
        r = n.subtract(r, n.multiply(whole, c(part), ORDERED), ORDERED)
    square = n.multiply(r, r, ORDERED)
    sine = n.multiply_add(
        n.multiply(r, square, ORDERED), n.polynomial(square, SINE, ORDERED), r, ORDERED
    )
    bent = n.multiply_add(n.polynomial(square, COSINE, ORDERED), square, c(-0.5), ORDERED)
    cosine = n.multiply_add(bent, square, c(1.0), ORDERED)
    quarter = n.integer("add", n.as_bits(shifted), n.whole(ahead))
    odd = n.differ(n.integer("and", quarter, n.whole(1)), n.whole(0))
    sign = n.integer("shl", n.integer("and", quarter, n.whole(2)), n.whole(62))
    return n.of_bits(n.integer("xor", n.as_bits(n.select(odd, cosine, sine)), sign))


# numerator and denominator of (atan x - x)/x^3 in x^2 for |x| <= 0.66 (Moshier, Cephes)
ARCTANGENT = (
    (
        -0.8750608600031904,
        -16.157537187333652,
        -75.00855792314705,
        -122.88666844901361,
        -64.85021904942025,
    ),
    (
        1.0,
        24.858464901423062,
        165.02700983169885,
        432.88106049129027,
        485.3903996359137,
        194.5506571482614,
    ),
)
FURTHER = 2.414213562373095  # tan(3 pi/8)


def tan(n: Any, x: Any) -> Any:
    """tan x by its sine and cosine, error below 2e-15 / |cos x| for |x| < 1e6."""
    return n.divide(sin(n, x), cos(n, x))


def atan(n: Any, x: Any) -> Any:
    """The angle between -pi/2 and pi/2 whose tangent is x, error below 1e-15."""
    c, size = n.constant, n.size(x)
    far, near = n.compare("ogt", size, c(FURTHER)), n.compare("ole", size, c(0.66))
    middle = n.divide(n.subtract(size, c(1.0)), n.add(size, c(1.0)))
    y = n.select(far, n.divide(c(-1.0), size), n.select(near, size, middle))
    begin = n.select(far, c(math.pi / 2), n.select(near, c(0.0), c(math.pi / 4)))
    square = n.multiply(y, y)
    above, below = (n.polynomial(square, each) for each in ARCTANGENT)
    angle = n.add(begin, n.multiply_add(n.multiply(y, square), n.divide(above, below), y))
    return n.select(n.compare("olt", x, c(0.0)), n.negative(angle), angle)


def atan2(n: Any, y: Any, x: Any) -> Any:
    """The angle of the point (x, y) between -pi and pi, error below 1e-15; 0 of the origin."""
    zero, half = n.constant(0.0), n.constant(math.pi)
    slope = atan(n, n.divide(y, x))
    around = n.select(n.compare("olt", y, zero), n.subtract(slope, half), n.add(slope, half))
    angle = n.select(n.compare("olt", x, zero), around, slope)
    upright = n.select(n.compare("olt", y, zero), n.constant(-math.pi / 2), n.constant(math.pi / 2))
    level = n.select(n.compare("olt", x, zero), half, zero)
    angle = n.select(n.compare("oeq", x, zero), upright, angle)
    return n.select(n.compare("oeq", y, zero), level, angle)


def asin(n: Any, x: Any) -> Any:
    """The angle whose sine is x, error below 1e-15; nan where |x| > 1."""
    one = n.constant(1.0)
    return atan2(n, x, n.root(n.multiply(n.subtract(one, x), n.add(one, x))))


def acos(n: Any, x: Any) -> Any:
    """The angle whose cosine is x, absolute error below 1e-15; nan where |x| > 1."""
    return n.subtract(n.constant(math.pi / 2), asin(n, x))


def sinh(n: Any, x: Any) -> Any:
    """Half of e^x - e^-x, error below 2e-13 of the larger of 1 and itself."""
    half, grown = n.constant(0.5), exp(n, x)
    return n.multiply(half, n.subtract(grown, n.divide(n.constant(1.0), grown)))


def cosh(n: Any, x: Any) -> Any:
    """Half of e^x + e^-x, error below 2e-13."""
    half, grown = n.constant(0.5), exp(n, x)
    return n.multiply(half, n.add(grown, n.divide(n.constant(1.0), grown)))


def tanh(n: Any, x: Any) -> Any:
    """(e^2x - 1)/(e^2x + 1), absolute error below 2e-13."""
    one = n.constant(1.0)
    grown = exp(n, n.multiply(n.constant(2.0), n.smaller(n.constant(40.0), x)))
    return n.divide(n.subtract(grown, one), n.add(grown, one))
