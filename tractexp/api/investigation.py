"""What an investigation says: the verdict, the gap before and after, and the extended model."""

import functools
import operator
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractexp.api.compose import LoadModel
from tractexp.api.gap import Gap, Gaps, Misfit, NoGap
from tractexp.api.identification import Identification
from tractexp.api.question import Question
from tractexp.api.response import Response
from tractexp.blocks import Report, Table
from tractexp.configuration.plugin import get
from tractexp.errors import UserError
from tractexp.identification.result import Result
from tractexp.outcome import Written
from tractexp.storage import files
from tractexp.text.wording import format_with_error

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from tractexp.api.given import Source
    from tractexp.discrepancy.findings import Findings as Steps
    from tractexp.discrepancy.readings import ShapeReading


@dataclass(frozen=True, eq=False, repr=False)
class Investigation(Written):
    """The effects that a model lacks, how sure that is, and the model with them. `content` is that
    of `discrepancy.json`.
    """

    kind = "investigation"
    page = "discrepancy.html"

    question: Question
    content: Mapping[str, Any]
    result: Result  # the extended model's parameters, as `result.json` holds them
    behind: "Steps | None" = None  # None where it was loaded

    @property
    def verdict(self) -> str:
        """`none`, `candidate`, `named`, `tied` or `unexplained`."""
        return self.content["verdict"]

    @property
    def complete(self) -> bool:
        """Whether nothing but noise is left."""
        return self.content["complete"]

    @property
    def reason(self) -> str:
        """Why, in one sentence."""
        return self.content["reason"]

    @property
    def names(self) -> tuple[str, ...]:
        """The effects added to the model, by the catalogue's names; `forms` says at which place and
        by which law.
        """
        return tuple(self.content["effects"])

    @property
    def forms(self) -> Mapping[str, Mapping[str, Any]]:
        """{name: {place, kind, law, differs, effect, curve}} of each effect added, as
        `discrepancy.json` holds it.
        """
        return self.content["forms"]

    @property
    def members(self) -> tuple[str, ...]:
        """The effects added as `model.effects` takes them: of another law or place, the family's
        member.
        """
        return tuple(form["effect"] for form in self.forms.values())

    @property
    def recommendation(self) -> str:
        """The next step that the evidence asks for, a sentence."""
        return self.content["recommendation"]

    @property
    def where(self) -> Table:
        """The intervals in which the base model disagrees with the records, the loudest first."""
        places = self.content["where"]
        return Table(
            [*places[0]] if places else [],
            [[*place.values()] for place in places],
            "where they disagree",
        )

    @property
    def candidates(self) -> Table:
        """Every set of effects that was fitted and every single one that was tested, with what
        became of it.
        """
        rows = [
            [" and ".join(c["effects"]), c["status"], c["likelihood_ratio"]]
            for c in self.content["candidates"]
        ]
        return Table(["effects", "status", "deviance lowered by"], rows, "candidates")

    @property
    def remainder(self) -> Table:
        """Where nothing explains the disagreement: the shapes in what the base model leaves, the
        loudest first.
        """
        entry = self.content["remainder"]
        shapes = entry["of_base"] if entry else []
        columns = [*shapes[0]] if shapes else []
        rows = [[shape[key] for key in columns] for shape in shapes]
        return Table(columns, rows, "what is left", entry["sentence"] if entry else "")

    @property
    def readings(self) -> "list[ShapeReading]":
        """Physical causes that the shapes which are left may have, each with what would decide it;
        [] where nothing is left.
        """
        from tractexp.discrepancy.readings import read_shapes
        from tractexp.discrepancy.remainder import Remainder

        entry = self.content["remainder"] or {}
        of_each = (entry.get(key) for key in ("of_names", "of_nearest", "of_base"))
        shapes = [Remainder(**shape) for shape in next(filter(None, of_each), [])]
        return read_shapes(shapes, self.question.train[0])

    @property
    def proposal(self) -> Mapping[str, Any] | None:
        """The term proposed for an unexplained disagreement, as `discrepancy.json` has it; None
        where there is none.
        """
        return self.content["proposal"]

    @property
    def proposal_sentences(self) -> list[str]:
        """The proposal as sentences; why there is none where nothing explains."""
        from tractexp.discrepancy.proposal.wording import describe_proposal

        return describe_proposal(self.proposal, self.content["no_proposal"])

    @property
    def sizes(self) -> list[str]:
        """How large the effects named are, with standard errors, as text: their parameters that
        have a null.
        """
        return self._sizes(self.members, self.content["parameters"])

    @property
    def sizes_of_nearest(self) -> list[str]:
        """The sizes of the candidates that come nearest where nothing explains the disagreement."""
        near = self.content["nearest"]
        return self._sizes(near["effects"], near["parameters"]) if near else []

    @staticmethod
    def _sizes(effects: Sequence[str], parameters: Mapping[str, Mapping[str, Any]]) -> list[str]:
        """The sizes of effects, each with its standard error and unit."""
        own = [
            p for name in effects for p in get("effect", name)().parameters if p.null is not None
        ]
        return [_format_size(p.name, parameters[p.name], p.unit) for p in own]

    @property
    def sets(self) -> list[Mapping[str, Any]]:
        """The sets of effects that were refitted: `effects`, `status`, `likelihood_ratio`,
        `parameters`.
        """
        # single tests say why
        return [row for row in self.content["candidates"] if "why" not in row]

    @property
    def gap(self) -> Gaps:
        """How far off the model is before and after."""

        def gap(entry: Mapping[str, Any]) -> Gap:
            return Gap(Misfit(**entry["before"]), Misfit(**entry["after"]), entry["closed"])

        entry = self.content["gap"]
        held = gap(entry["validate"]) if entry["validate"] else NoGap()
        return Gaps(gap(entry["train"]), held, entry["fitted_to_both"])

    @functools.cached_property
    def extended_model(self) -> LoadModel:
        """The model with the effects named: a model again, for any call. Raises `UserError` where
        none was named.
        """
        model = self.question.model
        if not self.names:
            raise UserError(
                f"there is no extended model: the verdict is '{self.verdict}', and nothing was"
                " added; go on with the base model (.question.model), or give records that show"
                " more"
            )
        # the latter of earlier versions
        window = self.content.get("recorder_window", self.content["phasor_window"])
        return model.with_(
            effects=sorted({*model.effects, *self.members}),
            fixed=self.content["held"],
            window=window,
        )

    extended = property(operator.attrgetter("extended_model"))  # its name in version 0.2

    @functools.cached_property
    def fit(self) -> Identification:
        """The extended model with the parameters that the investigation found; it predicts,
        simulates and exports.

        The base model where no effect was named.
        """
        errors = {name: at["standard_error"] for name, at in self.content["parameters"].items()}
        return Identification(replace(self.result, standard_errors=errors))

    def predict(
        self,
        event: "Source | None" = None,
        *,
        t: "ArrayLike | None" = None,
        U: "ArrayLike | None" = None,
        f: "ArrayLike | None" = None,
        P0: float | None = None,
        Q0: float | None = None,
    ) -> Response:
        """The response of the model of `fit` to an event or a voltage: see
        `Identification.predict`.
        """
        return self.fit.predict(event, t=t, U=U, f=f, P0=P0, Q0=Q0)

    @functools.cached_property
    def steps(self) -> "Steps":
        """The chain of results, from the records to the verdict; of a loaded result it is
        investigated again.
        """
        return self.behind or self.question.find_steps(False)

    def table(self) -> Table:
        """How far off the models are, on the fitted and on the held-out events."""
        from tractexp.report import discrepancy

        return discrepancy.build_gap_table(self.content)

    def summary(self) -> Report:
        """The verdict with its reason, the gap and the parameters."""
        from tractexp.report import discrepancy

        return discrepancy.build_summary(self)

    def screen(self) -> Report:
        from tractexp.report import discrepancy_screen

        return discrepancy_screen.build_screen(self)

    def report(self) -> Report:
        """The page: events before and after, where they disagree, candidates, what changed."""
        from tractexp.report import discrepancy

        return discrepancy.report(self.steps, self.content, self.result.identities)

    def write_results(self, folder: Path, home: Path | None = None) -> list[Path]:
        """discrepancy.json and result.json; `home` is the folder that the files will be in, by
        default `folder`.

        conf/model/extended.yaml where an effect was named, unexplained.csv where nothing explains,
        and the plugin of a term where one is proposed.
        """
        from tractexp.discrepancy import discrepancy_json
        from tractexp.discrepancy.discrepancy_json import MODEL_FILE

        model = self.question.model
        known = {
            # what machines are it is held to again by whoever reads it
            "bounds": {name: b for name, b in model.bounds.items() if name not in model.held},
            "fixed": model.fixed,
            "substeps": model.substeps,
            "priors": model.priors,
            "physical": model.physical,
        }
        base = {**model.node, **known}
        paths = [
            files.write_json(folder / "discrepancy.json", self.content),
            self.result.write(folder / "result.json"),
        ]
        if self.names:
            paths.append(
                discrepancy_json.write_model(
                    self.steps, base, folder / MODEL_FILE, (home or folder) / MODEL_FILE
                )
            )
        if not self.complete:
            paths.append(discrepancy_json.write_left(self.steps, folder / "unexplained.csv"))
        if self.content["proposal"]:
            paths.append(
                discrepancy_json.write_plugin(
                    self.steps, folder / self.content["proposal"]["plugin"]
                )
            )
        return paths


def _format_size(name: str, at: Mapping[str, Any], unit: str) -> str:
    """ "k_f = 0.12 ± 0.01"."""
    error = float("nan") if at["standard_error"] is None else at["standard_error"]
    return f"{name} = {format_with_error(at['value'], error)}{'' if unit == '1' else f' {unit}'}"
