"""Names a parameter, state or memory may not have: the generated kernel, or the equations, use them themselves."""

import keyword
import re

from tractexp.errors import UserError
from tractexp.model.drive import EVENT, INPUTS
from tractexp.model.sites import SITES

# The kernel's own variables, and its patterns of constants, signals, temporaries and stages.
TAKEN = frozenset(
    """
    n e h k l m i j p q P Q W x f g d r c J w_p w_q math np njit candidates event first inputs measured weights
    substeps sums miss outputs store signals block reachable unsettled moved factor shorter off settled keep
    """.split()  # noqa: SIM905
)
PATTERN = re.compile(r"[csx]\d+|k[1-4]_.*|_.*")
GIVEN = frozenset((*INPUTS, *EVENT, "P0", "Q0", "P_s0", "Q_s0", "eq", "u", *SITES))  # what the equations offer


def check_name(name: str, where: str = "a model") -> None:
    """Raise `UserError` for a name that the kernel, or the equations, could not tell from their own."""
    if name in TAKEN or PATTERN.fullmatch(name) or not name.isidentifier() or keyword.iskeyword(name):
        raise UserError(
            f"{where} cannot have a parameter, state or memory called '{name}': the kernel uses that name itself,"
            " or it is no Python name; choose a longer one"
        )
    if name in GIVEN:
        raise UserError(
            f"{where} cannot have a parameter, state or memory called '{name}': the equations give that name to"
            " something else; choose another one"
        )
