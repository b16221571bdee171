"""Names a parameter, state or memory may not have: what is no name, and what the equations use
themselves.
"""

import keyword

from tractexp.errors import UserError
from tractexp.kernel.layout import EVENT, INPUTS
from tractexp.model.sites import SITES

# what the equations offer
GIVEN = frozenset((*INPUTS, *EVENT, "P0", "Q0", "P_s0", "Q_s0", "eq", "u", *SITES))


def check_name(name: str, where: str = "a model") -> None:
    """Raise `UserError` for a name that is none, or that the equations could not tell from their
    own.
    """
    if not name.isidentifier() or keyword.iskeyword(name) or name.startswith("_"):
        raise UserError(
            f"{where} cannot have a parameter, state or memory called '{name}': that is no name of"
            " Python's, or begins with an underscore; choose another one"
        )
    if name in GIVEN:
        raise UserError(
            f"{where} cannot have a parameter, state or memory called '{name}': the equations give"
            " that name to something else; choose another one"
        )
