"""What a person may give to a call, for type checkers and editors: imported by them alone, and
written in quotes, so that it costs nothing and restricts nothing where a program runs.
"""

from typing import TYPE_CHECKING, Protocol, TypeAlias

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import ArrayLike

    from tractexp.api.arguments import Choice
    from tractexp.api.compose import LoadModel
    from tractexp.model.model import Model
    from tractexp.record import Event, Record

Setting: TypeAlias = "bool | float | str | Path | Sequence[Setting] | Mapping[str, Setting] | None"


class Frame(Protocol):
    """A frame of pandas or polars."""

    @property
    def columns(self) -> object:
        """The names of its columns."""
        ...

    def __getitem__(self, key: str, /) -> object:
        """A column."""
        ...


# what `tractexp.read` takes, and one or several of it
Source: TypeAlias = "str | Path | Event | Record | Frame | Mapping[str, ArrayLike]"
Records: TypeAlias = "Source | Sequence[Source]"
# a name, a file, what `tractexp.compose` makes, or the parts by name
ModelGiven: TypeAlias = "str | Path | LoadModel | Model | Mapping[str, Setting]"
# of an optimizer or an objective: a name, or a mapping of `name` and settings
Chosen: TypeAlias = "str | Mapping[str, Setting] | Choice"
Several: TypeAlias = "Chosen | Sequence[Chosen] | Mapping[str, Chosen]"
