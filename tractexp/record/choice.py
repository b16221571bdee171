"""Several dips of one file, numbered in order of time: which are fitted and which held out."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

from tractexp.errors import UserError
from tractexp.record.reader import Events
from tractexp.record.record import Record


def chosen(where: str, tried: Mapping[int, Record | UserError], train: Sequence[int] | None,
           validate: Sequence[int] | None, notes: Sequence[str] = ()) -> Events:  # fmt: skip
    """The records of the dips asked for; by default the first that can be used is fitted and all others validate.

    `tried` are the dips by number: records, or why they cannot be used. `notes` are of the whole file: said once, on
    the first record. Raises `UserError`, naming the dips that can be used, for one that cannot.
    """
    usable = [number for number, made in tried.items() if isinstance(made, Record)]
    fitted = list(train or usable[:1] or [1])
    first, *rest = [_picked(where, number, tried) for number in fitted]
    notes = (*first.notes, *notes)
    if validate is not None:
        held = [_picked(where, number, tried) for number in validate]
        return Events([replace(first, notes=notes), *rest], held)
    others = [made for number, made in tried.items() if number not in fitted]
    notes += tuple(f"not used for validation: {made}" for made in others if isinstance(made, UserError))
    return Events([replace(first, notes=notes), *rest], [made for made in others if isinstance(made, Record)])


def check_numbers(train: Sequence[int] | None, validate: Sequence[int] | None) -> None:
    """Raise `UserError` for no dip to fit, and for one that is named twice."""
    if train is not None and not train:
        raise UserError("data.train is empty: name at least one dip by its number, e.g. data.train=[1]")
    given = [*(train or []), *(validate or [])]
    for number in given:
        if given.count(number) > 1:
            raise UserError(f"data.train and data.validate name dip {number} twice; a dip may serve only once")


def _picked(where: str, number: int, tried: Mapping[int, Record | UserError]) -> Record:
    usable = ", ".join(f"{n} at {r.t[0]:.3f} to {r.t[-1]:.3f} s" for n, r in tried.items() if isinstance(r, Record))
    made = tried.get(number, UserError(f"{where}: there is no dip {number}; {len(tried)} are found"))
    if isinstance(made, UserError):
        raise UserError(f"{made}; dips that can be used: {usable or 'none'}")
    return made
