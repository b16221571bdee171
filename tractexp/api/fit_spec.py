"""The call of an identification, and the search that it asks for."""

from dataclasses import dataclass

import numpy as np

from tractexp.api.arguments import Choice
from tractexp.api.setup import Setup
from tractexp.identification.conclude import conclude
from tractexp.identification.fit import Fit
from tractexp.identification.result import Result
from tractexp.identification.search import SearchResult
from tractexp.identification.unrecorded_input import (
    AVERAGED_CYCLES,
    FREQUENCY_SWING,
    UNBALANCE,
    UnrecordedInput,
    list_unrecorded_inputs,
)
from tractexp.text.progress import Progress, tell


@dataclass(frozen=True, eq=False, kw_only=True)
class FitSpec(Setup):
    """The records, the model and the settings of an identification."""

    optimizer: Choice
    check_intervals: bool = True
    frequency_swing: float = FREQUENCY_SWING
    unbalance: float = UNBALANCE
    averaged_cycles: float = AVERAGED_CYCLES

    @property
    def unrecorded_inputs(self) -> list[UnrecordedInput]:
        """What records may lack, and how far it may have strayed."""
        return list_unrecorded_inputs(self.frequency_swing, self.unbalance, self.averaged_cycles)

    def search_end(self, progress: Progress) -> SearchResult:
        """Where the search ends; raises `UserError` where the input is wrong, before anything is
        told.
        """
        tell(progress, [*self.lines(), f"optimizer: {self.optimizer.name}, seed {self.seed}"])
        return self.search(self.optimizer, self.seed, progress)

    def build_result(self, end: SearchResult, values: np.ndarray, fits: list[Fit]) -> Result:
        """The result of free values (d,) that a search led to, before anything is judged of it."""
        node, name = self.model.node, self.optimizer.name
        return conclude(self.problem, end, values, fits, self.seed, node, name)
