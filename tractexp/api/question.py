"""What an investigation is asked: records, model and settings, and the chain of results."""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from tractexp.api.arguments import Choice
from tractexp.api.setup import Given
from tractexp.identification.conclude import refuse_failed
from tractexp.identification.search import search
from tractexp.inference.problem import Problem
from tractexp.text.progress import Progress, tell_stages
from tractexp.text.wording import describe_shown_effects

if TYPE_CHECKING:
    from tractexp.discrepancy.findings import Findings as Steps


@dataclass(frozen=True, eq=False, kw_only=True)
class Question(Given):
    """The records, the model and the settings of an investigation."""

    effects: Sequence[str]  # none: the whole catalogue
    false_alarms: float
    criteria: Mapping[str, float]

    def find_steps(self, progress: Progress) -> "Steps":
        """The chain of results, from the records to the verdict."""
        from tractexp.discrepancy.investigate import investigate as find_missing_effects
        from tractexp.inference.criteria import Criteria

        base = self.model
        with tell_stages(progress) as tell:
            if base.shown:
                tell(describe_shown_effects(base.shown))
            return find_missing_effects(
                base.model,
                self.train,
                self.validate,
                base.bounds,
                base.fixed,
                only=self.effects,
                substeps=base.substeps,
                criteria=Criteria.from_choices(
                    {"false_alarms": self.false_alarms, **self.criteria}
                ),
                priors=base.priors,
                shown=tuple(base.shown),
                search=functools.partial(_search_end, self.seed),
                seed=self.seed,
                tell=tell,
            )


def _search_end(seed: int, problem: Problem) -> np.ndarray:
    """The free values (d,) at which the search of an identification ends that is asked for nothing
    unusual.
    """
    end = search(problem, Choice.from_argument("optimizer", None).build("optimizer"), seed)
    refuse_failed(problem, end)
    return end.values
