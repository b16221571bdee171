"""What a call is given: records and a model, and for searches how a residual counts and when they
end.
"""

import functools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

from tractexp.api.arguments import Choice
from tractexp.api.compose import LoadModel, Portable, resolve_model
from tractexp.api.read import Dips, read_dips_together
from tractexp.api.task import OF_MODEL
from tractexp.configuration.schema import LEAST
from tractexp.errors import check_range
from tractexp.outcome import Plain
from tractexp.record import Event, describe
from tractexp.record.identity import Identity
from tractexp.text.progress import Progress, report_search
from tractexp.text.wording import describe_shown_effects

if TYPE_CHECKING:
    from tractexp.identification.search import Limits, SearchResult
    from tractexp.inference.problem import Problem


@dataclass(frozen=True, eq=False, kw_only=True)
class Given(Portable, Plain):
    """Events fitted and held out, the model with what is known of it, and the seed."""

    train: Dips
    validate: Dips
    model: LoadModel
    seed: int = 0


@dataclass(frozen=True, eq=False, kw_only=True)
class Setup(Given):
    """Records, model, objective and limits of searches. Travels to other processes, where compiled
    models cannot go.
    """

    objective: Choice
    budget: int | None = None
    time_limit: float | None = None
    target: float | None = None

    @classmethod
    def from_arguments(
        cls, records: Any, model: Any, validate: Any = (), objective: Any = None, **given: Any
    ) -> Self:
        """From the arguments of a call: those of the model replace its own where they
        are not None.
        """
        for key, least in LEAST.items():
            check_range(key, given.get(key), least)
        train, held = read_dips_together(records, validate)
        of_model = {key: given.pop(key) for key in OF_MODEL if key in given}
        load = resolve_model(model, of_model.get("domain")).with_(**of_model)
        load = load.fit_for(train)
        return cls(
            train=train,
            validate=held,
            model=load,
            objective=Choice.from_argument("objective", objective),
            **given,
        )

    @functools.cached_property
    def problem(self) -> "Problem":
        """The problem that is fitted, with the objective of this call."""
        return self.problem_of()

    def problem_of(self, train: Sequence[Event] | None = None) -> "Problem":
        """The identification problem of some events, by default of those fitted; made anew."""
        from tractexp.inference.problem import Problem

        m, loss, events = (
            self.model,
            self.objective.build("objective"),
            self.train if train is None else train,
        )
        return Problem(
            m.model, events, m.bounds, m.fixed, m.substeps, m.per_event, loss=loss, priors=m.priors
        )

    @property
    def limits(self) -> "Limits":
        """When a search ends."""
        from tractexp.identification.search import Limits

        return Limits(self.budget, self.time_limit, self.target)

    def lines(self) -> list[str]:
        """A sentence on each record that is read, and one on the model."""
        problem = self.problem
        model = f"model: {problem.model.title}, {problem.space.dimension} parameters"
        steps = f"Runge-Kutta steps: {problem.step.describe(problem.events)}"
        shown = [describe_shown_effects(self.model.shown)] if self.model.shown else []
        return [*describe_records(self.train, self.validate), f"{model}; {steps}", *shown]

    def search(self, optimizer: Choice, seed: int, progress: Progress) -> "SearchResult":
        """Search, and show how far that is."""
        from tractexp.identification.search import search

        plugin = optimizer.build("optimizer")
        with report_search(plugin.end(self.budget), self.budget, progress) as callback:
            return search(self.problem, plugin, seed, self.limits, callback)


def describe_records(
    train: Sequence[Event], validate: Sequence[Event], held_out: str = "validate"
) -> Iterator[str]:
    """A sentence for each event and each of its notes, and of each recording which load it
    is of.
    """
    said: list[Identity] = []
    for role, group in (("fit", train), (held_out, validate)):
        for event in group:
            yield f"{role}: {describe(event)}"
            if (
                event.record.source
                and (identity := Identity.from_record(event.record).recording) not in said
            ):
                said.append(identity)
                yield f"  record: {identity}"
            yield from (f"  note: {note}" for note in event.record.notes)
