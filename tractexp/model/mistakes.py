"""Mistakes in the equations of a part, told in a sentence to who wrote it."""

import re
import sys
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from tractexp.errors import Unfit
from tractexp.kernel.graph import collect_symbols
from tractexp.model.equations import Equations
from tractexp.model.parts import Effect, Measurement, Part
from tractexp.model.symbols import make_real_symbol
from tractexp.text.wording import join_words

# {what Python says where numbers are computed of symbols: how to mend it}
SYMBOLS_AS_NUMBERS: Mapping[str, str] = {
    r"loop of ufunc .* no callable (\w+) method": (
        "NumPy's {0} takes numbers, and what a part computes with are symbols; import sympy in the"
        " method and use SymPy's function"
    ),
    r"Cannot convert expression to float|must be real number": (
        "a number is asked for where there are symbols; import sympy in the method and use SymPy's"
        " functions, not those of math"
    ),
    r"cannot determine truth value of Relational": (
        "a comparison of symbols is neither true nor false; use sympy.Piecewise, sympy.Max or"
        " sympy.Min"
    ),
}


@contextmanager
def explain_symbols(part: Part) -> Iterator[None]:
    """Raise `Unfit`, with the line, where a method of a part computes with symbols as if they were
    numbers.
    """
    try:
        yield
    except TypeError as error:
        for pattern, sentence in SYMBOLS_AS_NUMBERS.items():
            if match := re.search(pattern, str(error)):
                raise Unfit(_locate(part, error) + sentence.format(*match.groups())) from error
        raise


def _locate(part: Part, error: BaseException) -> str:
    """The innermost line of a part's own file that an error went through, as "FILE, line N: "."""
    file = getattr(sys.modules.get(type(part).__module__), "__file__", None)
    frames = [f for f in traceback.extract_tb(error.__traceback__) if f.filename == file]
    return f"{file}, line {frames[-1].lineno}: " if frames else ""


def check_size_used(eq: Equations, effect: Effect) -> None:
    """Raise `Unfit` for an effect none of whose sizes is in an equation: it changes nothing.

    Of some of its parameters a model may have no use: of a share of motors where there is none, or
    of a reactive power in waveforms. One of the measurement changes no equation.
    """
    if isinstance(effect, Measurement):
        return
    used = set().union(*map(collect_symbols, eq.list_expressions()))
    sizes = [p.name for p in effect.parameters if p.null is not None]
    if not any(make_real_symbol(name) in used for name in sizes):
        raise Unfit(f"its size {join_words(sizes)} is in no equation, so that it changes nothing")
