"""Pairs of phases and what phase quantities follow from them."""

from collections.abc import Sequence

import numpy as np

from tractexp.extend import DATA, UserError, check_choice

PHASES = "abc"
PAIRS = ("ab", "bc", "ca", "ba", "cb", "ac")
TWO = tuple(sorted(PAIRS))  # of phases, whose currents are measured


def line(pair: str) -> np.ndarray:
    """Row (3,) that makes the line voltage of a pair from three phase voltages: ab is V_a - V_b."""
    row = np.zeros(3)
    row[PHASES.index(pair[0])], row[PHASES.index(pair[1])] = 1.0, -1.0
    return row


def check_pairs(pairs: Sequence[str], count: int, such: str) -> None:
    """Raise `UserError` for what are not so many pairs of phases, `such` as these, or two of the
    same phases.
    """
    where = "data.connection.pairs"
    if len(pairs) != count:
        what = {2: "two", 3: "three"}[count]
        raise UserError(f"{DATA.connection}.pairs={pairs} must be {what} pairs of phases, {such}")
    for pair in pairs:
        check_choice(where, pair, PAIRS)
    if len({frozenset(pair) for pair in pairs}) < len(pairs):
        raise UserError(
            f"{where}={[*pairs]} names a pair of phases twice; give different ones, e.g. [ab, bc]"
        )


def from_lines(pairs: Sequence[str]) -> np.ndarray:
    """The matrix (3, pairs) from line voltages to phase voltages without zero sequence."""
    inverse = np.linalg.pinv(np.array([line(pair) for pair in pairs]))
    return np.where(np.abs(inverse) < 1e-12, 0.0, inverse)


def from_two(phases: str) -> np.ndarray:
    """The matrix (3, 2) from currents of two phases to three without zero sequence."""
    return np.array(
        [[float(p == phase) if phase in phases else -1.0 for p in phases] for phase in PHASES]
    )
