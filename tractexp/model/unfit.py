"""How an effect is refused for a model: by what it asks for and does not find."""

from tractexp.errors import UserError


class Unfit(UserError):
    """Why an effect makes no sense for a model: what it asks for is not there. Raised by what it asks `eq` for."""
