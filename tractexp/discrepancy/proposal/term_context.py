"""A context in which terms are simulated and fitted: the investigation's, with the library in place
of the catalogue.

A term is a candidate like any other. All of a kind share one kernel, in which parameters choose
what acts.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from tractexp.discrepancy.proposal.effect import Library
from tractexp.discrepancy.proposal.library import (
    ANSWER,
    TIMED,
    Size,
    Term,
    name_shape,
    name_size,
    pick_of,
)
from tractexp.inference.catalogue import Candidate, Catalogue
from tractexp.inference.context import Context
from tractexp.inference.free_set import FreeSet
from tractexp.inference.kernels import Family, Key
from tractexp.model.model import Model
from tractexp.model.parts import Effect
from tractexp.parameter import Parameter

KINDS = (ANSWER, TIMED)
Setting = Mapping[str, float]  # the parameters of a signal by their own names


class Terms(Family):
    """A base model with the library: terms, named `kind:balance:signal[:clock]`, by the kernel of
    their kind.
    """

    def with_effects(self, names: Iterable[str]) -> Model:
        """The model with the libraries that hold these terms."""
        return super().with_effects({find_kind(n) for n in names})

    def key(self, names: Iterable[str], beside: str = "") -> Key:
        """The key of that model: terms of one kind share it."""
        load = {*names, beside} - {"", *self.catalogue.of_measurement}
        return frozenset(map(find_kind, load)), frozenset()


def find_kind(name: str) -> str:
    """The library's effect that a term belongs to; of any other effect its own name."""
    return name.partition(":")[0]


def list_sizes(chosen: Term) -> list[tuple[Size, str]]:
    """The sizes of a term, and what the library calls each."""
    return [
        (size, name_size(chosen.signal.kind, chosen.balance, size)) for size in chosen.balance.sizes
    ]


def list_shapes(chosen: Term) -> dict[str, str]:
    """The parameters of a term's signal by their own names, and what the library calls each."""
    return {s.name: name_shape(chosen.signal, s) for s in chosen.signal.shapes}


def build_term_context(original: Context) -> Context:
    """The same events, base model and faults of the measurement with the library."""
    faults = tuple(c for c in original.catalogue.candidates if c.measurement)
    whole = tuple(
        Candidate(kind, effect, (), ({},)) for kind, effect in ((k, Library(k)) for k in KINDS)
    )
    catalogue = Catalogue((*faults, *whole), {})
    return original.rebuild(catalogue, original.records, original.effort, Terms)


def add_terms(context: Context, chosen: Sequence[Term]) -> Context:
    """A context of the library on which these terms are candidates, each with its own parameters
    free.
    """
    there = {c.name for c in context.catalogue.candidates}
    more = tuple(_build_candidate(context, t) for t in dict.fromkeys(chosen) if t.name not in there)
    catalogue = replace(context.catalogue, candidates=(*context.catalogue.candidates, *more))
    return replace(
        context, catalogue=catalogue, coordinates=replace(context.coordinates, catalogue=catalogue)
    )


def _build_candidate(context: Context, chosen: Term) -> Candidate:
    """A term as a candidate: its sizes are those of its balance, its shapes those of its signal."""
    declared = {p.name: p for p in context.problem.parameters}
    sizes = tuple(declared[label] for _, label in list_sizes(chosen))
    shapes = tuple(declared[label] for label in list_shapes(chosen).values())
    relevant = {label: size.relevant for size, label in list_sizes(chosen)}
    return Candidate(chosen.name, _Part(chosen.name, (*sizes, *shapes), relevant), sizes, ({},))


class _Part(Effect):
    """One term within the library: what a fit needs to know of it."""

    def __init__(self, name: str, parameters: tuple[Parameter, ...], relevant: dict[str, float]):
        """A part with a name, parameters and relevant sizes, in place of a plugin."""
        self.name, self.parameters, self.relevant = name, parameters, relevant  # type: ignore[misc]

    def edit(self, eq: object, **parameters: object) -> None:  # type: ignore[override]
        """The library's kernel has it."""


def place(
    at: FreeSet, unit: np.ndarray, chosen: Term, setting: Setting, sizes: Sequence[float]
) -> np.ndarray:
    """Coordinates (D,) with a term of these sizes and this setting."""
    moved = unit.copy()
    for picked in (chosen.signal, chosen.clock) if chosen.clock else (chosen.signal,):
        label = pick_of(chosen.signal.kind, picked.name)
        moved[at.column[label]] = at.to_unit(label, 1.0)
    for name, label in list_shapes(chosen).items():
        moved[at.column[label]] = np.clip(at.to_unit(label, setting[name]), 0.0, 1.0)
    for (_, label), size in zip(list_sizes(chosen), sizes, strict=True):
        moved[at.column[label]] = np.clip(at.to_unit(label, size), 0.0, 1.0)
    return moved


def read_values(at: FreeSet, unit: np.ndarray, chosen: Term) -> dict[str, float]:
    """Sizes and setting of a term at coordinates (D,), by their own names."""
    sizes = {size.name: at.value(label, unit) for size, label in list_sizes(chosen)}
    return sizes | {name: at.value(label, unit) for name, label in list_shapes(chosen).items()}


def carry_over(other: Context, original: Context, unit: np.ndarray) -> np.ndarray:
    """Coordinates (D',) of the context of terms with base model, faults and power before as at
    coordinates (D,).
    """
    to = other.coordinates
    old = original.coordinates
    moved = to.null.copy()
    faults = to.catalogue.parameters(to.catalogue.of_measurement)
    for name in (*(to.names[k] for k in to.base), *(p.name for p in faults)):
        moved[to.column[name]] = unit[old.column[name]]
    moved[to.before] = unit[old.before]
    return moved
