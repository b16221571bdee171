"""A load model by name or put together from parts, and what is known of its
parameters beforehand.
"""

import dataclasses
import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from tractexp.api.arguments import Choice, check_kind, public
from tractexp.blocks import Table
from tractexp.configuration.choices import read_choices, read_default_choices, read_replacements
from tractexp.configuration.composition import read_choice
from tractexp.configuration.plugin import discover, get
from tractexp.errors import UserError, check_choice, list_allowed, name_setting
from tractexp.outcome import Plain, Tabulated
from tractexp.text import quoting

if TYPE_CHECKING:
    from tractexp.api.given import ModelGiven
    from tractexp.model.model import Model
    from tractexp.record import Event

GROUP, DOMAIN, PARTS = "model", "domain", ("motor", "static")


class Portable:
    """Base of dataclasses that travel to other processes by their fields: what they cache is
    compiled code.
    """

    def __getstate__(self) -> dict[str, Any]:
        """The fields alone: what was computed from them is computed again."""
        return {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False, repr=False)
class LoadModel(Portable, Plain, Tabulated):
    """A load model as a call takes it. Prints its parameters; in a notebook its equations, too."""

    motor: Mapping[str, Any]  # name and settings of the plugin
    static: Mapping[str, Any]
    effects: Sequence[str] = ()
    bounds: Mapping[str, Sequence[float]] = field(default_factory=dict)
    fixed: Mapping[str, float] = field(default_factory=dict)
    substeps: int | None = None
    per_event: Sequence[str] = ()
    integration: str = "classical"
    domain: str = "phasors"
    window: float | str | None = None
    priors: bool = False
    physical: bool | None = None
    # {domain: choices of model that are raced before a fit}
    candidates: Mapping[str, Sequence[str]] = field(default_factory=dict)
    shown_effects: bool = False
    # {effect that the records show: how they do}
    shown: Mapping[str, str] = field(default_factory=dict)
    # {parameter that is held to what machines are: its range, which is in `bounds`}
    held: Mapping[str, Sequence[float]] = field(default_factory=dict)
    race: Sequence[Mapping[str, Any]] = ()  # how the structures did of which this one won

    @property
    def node(self) -> dict[str, Any]:
        """The parts of the composed model as `result.json` keeps them, with integration, domain and
        window if they are not the defaults.
        """
        parts = {
            "motor": dict(self.motor),
            "static": dict(self.static),
            "effects": list(self.effects),
        }
        defaults = {"integration": "classical", "domain": "phasors", "window": None}
        return parts | {
            key: value
            for key, default in defaults.items()
            if (value := getattr(self, key)) != default
        }

    @functools.cached_property
    def model(self) -> "Model":
        """The composed model, which simulates."""
        from tractexp.domain.averaging import check_window
        from tractexp.identification.result import build_parts
        from tractexp.model.model import compose

        check_window(self.window, self.domain)
        return compose(*build_parts(self.node))

    @functools.cached_property
    def parameters(self) -> Mapping[str, Any]:
        """The parameters by name, with bounds as set here (`Parameter`: default, bounds, unit,
        about, symbol).
        """
        from tractexp.inference.bounds import narrow_bounds

        return {p.name: p for p in narrow_bounds(self.model.parameters, self.bounds)}

    def with_(self, **changes: Any) -> "LoadModel":
        """The model with what is given (not None) in place; bounds and fixed values are added to
        those there are.
        """
        settings = {key: value for key, value in changes.items() if value is not None}
        given = {*settings.get("bounds", ()), *settings.get("fixed", ())}
        settings["held"] = {n: each for n, each in self.held.items() if n not in given}
        for key in ("bounds", "fixed"):
            if key in settings:
                settings[key] = {**getattr(self, key), **settings[key]}
        return replace(self, **settings)

    def add_shown_effects(self, events: Sequence["Event"]) -> "LoadModel":
        """The model with the effects that some of the events show, where it is one of
        `shown_effects`.
        """
        if not self.shown_effects:
            return self
        shown = {**self.shown, **find_shown_effects(self.model, events)}
        return replace(self, effects=sorted({*self.effects, *shown}), shown=shown)

    def fit_for(self, events: Sequence["Event"]) -> "LoadModel":
        """The model that is fitted to these events: the winner where structures are raced, with the
        effects that they show where it asks for these, its machines within what machines are.
        """
        names = self.candidates.get(self.domain, ())
        if not names:
            return self.add_shown_effects(events).hold_to_machines(events)
        return self._choose_structure(names, events)

    def _choose_structure(self, names: Sequence[str], events: Sequence["Event"]) -> "LoadModel":
        """The winner of a race, with what is said of its parameters here."""
        from tractexp.identification.race import Entry, race_structures

        models, refused = dict[str, LoadModel](), list[Entry]()
        for name in names:
            try:
                prepared = self._prepare_choice(name).fit_for(events)
                prepared.refuse_same(models)
                models[name] = prepared
            except UserError as error:
                refused.append(Entry(name, 0, math.inf, math.inf, str(error)))
        if not models:
            raise UserError(f"none of the structures can be fitted: {refused[0].why}")
        candidates = {name: (one.model, one.bounds) for name, one in models.items()}
        entries = race_structures(candidates, events, self.fixed)
        race = [entry.to_dict() for entry in (*entries, *refused)]
        return replace(models[entries[0].name], race=race)

    def refuse_same(self, models: Mapping[str, "LoadModel"]) -> None:
        """Raise `UserError` where one of the models by name is the same, as where the records show
        nothing that one of two would add; and for parts that do not compose.
        """
        _ = self.model
        own = self.node, self.bounds, self.fixed
        for name, other in models.items():
            if (other.node, other.bounds, other.fixed) == own:
                raise UserError(f"on these records it is the same as {name}")

    def _prepare_choice(self, name: str) -> "LoadModel":
        """A choice of model by name, in this one's domain, with what is known of its parameters."""
        other = replace(
            resolve_model(name),
            domain=self.domain,
            physical=self.physical,
            priors=self.priors,
            substeps=self.substeps,
            window=self.window,
        )
        known = {p.name for p in other.model.parameters}
        return other.with_(
            bounds={key: value for key, value in self.bounds.items() if key in known},
            fixed={key: value for key, value in self.fixed.items() if key in known},
            per_event=[key for key in self.per_event if key in known],
        )

    def hold_to_machines(self, events: Sequence["Event"]) -> "LoadModel":
        """The model within the physical ranges of its parameters where `physical` says so, or where
        it leaves that open and the events are from the field. Bounds that are given stay.
        """
        wanted, given = self.physical, {*self.bounds, *self.fixed} - {*self.held}
        if wanted is None:
            wanted = all(event.record.is_from_field for event in events)
        ranges = {p.name: p.physical for p in self.model.parameters if p.physical and wanted}
        held = {name: list(each) for name, each in ranges.items() if name not in given}
        return replace(self, bounds={**held, **self.bounds}, held=held) if held else self

    def table(self) -> Table:
        """Each parameter with its value or default, unit and bounds."""
        rows = [
            [
                p.name,
                self.fixed.get(p.name, p.default),
                p.unit,
                "fixed" if p.name in self.fixed else f"{p.bounds[0]:g} .. {p.bounds[1]:g}",
                p.about,
            ]
            for p in self.parameters.values()
        ]
        return Table(["parameter", "default", "unit", "bounds", "meaning"], rows, self.model.title)

    def _repr_html_(self) -> str:
        """The table, and the equations below it."""
        return super()._repr_html_() + "".join(
            f"<p>$${quoting.html(line)}$$</p>" for line in self.model.latex()
        )

    def _repr_latex_(self) -> str:
        """The equations."""
        return "\n\n".join(f"$${line}$$" for line in self.model.latex())


@public
def compose(
    model: "ModelGiven | None" = None,
    *,
    motor: str | Mapping[str, Any] | Sequence[Any] | None = None,
    static: str | Mapping[str, Any] | None = None,
    effects: Sequence[str] | None = None,
    bounds: Mapping[str, Sequence[float]] | None = None,
    fixed: Mapping[str, float] | None = None,
    substeps: int | None = None,
    per_event: Sequence[str] | None = None,
    integration: str | None = None,
    domain: str | None = None,
    window: float | str | None = None,
    priors: bool | None = None,
    physical: bool | None = None,
    shown_effects: bool | None = None,
) -> LoadModel:
    """A load model: a choice of `conf/model` (by name, or the path of a YAML file), or a motor
    beside a static load.

    Parameters
    ----------
    model : name, path, LoadModel or None
        What the other arguments change; None: the model of `conf/config.yaml`.
    motor, static : name, or mapping of `name` and the plugin's settings
        They replace those of `model`, and one left out is that of the paper's model; "none" is
        without. A list of motors is several groups side by side (["stator_flux", "double_cage"]).
    effects : names
        What is added to the equations.
    bounds : {name: [lower, upper]}
        In the parameters' own units, added to those of the choice.
    fixed : {name: value}
        Parameters that are not searched, added to those of the choice.
    substeps : int
        Runge-Kutta steps per sample; None: as many as needed.
    per_event : names
        Parameters with a value of their own in each event.
    integration : "classical" or "printed"
        "printed" is Eq. (4) of the paper as it stands.
    domain : "phasors" or "waves"
        With "waves" the same equations draw sampled currents, and what phasors neglect is kept.
    window : float [s], name or "recorded"
        That over which the recorder averages phasors: its length, the name of an estimator, or
        what the records say.
    priors : bool
        Whether a fit holds the motor to what machines usually are, where its records do not tell.
    physical : bool
        Whether a fit keeps the motor within what machines are; None: of records in kV and MW.
    shown_effects : bool
        Whether a fit has the effects that its records show.

    Returns
    -------
    LoadModel
        `parameters` {name: default, bounds, unit, about}, `node`, its configuration, and as a
        notebook's last line its equations.

    Raises
    ------
    UserError
        For an unknown name or an effect that does not fit the equations; values are checked where
        the model is used.

    Examples
    --------
    >>> import tractexp
    >>> load = tractexp.compose(motor="double_cage", static="zip", fixed={"a_Z": 0.4})
    >>> load.fixed["a_Z"], "T_prime" in load.parameters
    (0.4, True)
    """
    composed = resolve_model(model, domain)
    chosen_parts = {"motor": motor, "static": static}
    parts = {
        part: Choice.from_argument(f"model/{part}", chosen).node
        for part, chosen in chosen_parts.items()
        if chosen is not None
    }
    settings = {
        "effects": effects,
        "substeps": substeps,
        "per_event": per_event,
        "integration": integration,
        "domain": domain,
        "window": window,
        "priors": priors,
        "physical": physical,
        "shown_effects": shown_effects,
    }
    composed = composed.with_(bounds=bounds, fixed=fixed, **settings, **parts)
    _ = composed.parameters
    for key in composed.fixed:
        if key not in composed.parameters:
            allowed = list_allowed(key, composed.parameters, "Parameters")
            raise UserError(f"fixed.{key}: this model has no parameter '{key}'{allowed}")
    return composed


def find_shown_effects(model: "Model", events: Sequence["Event"]) -> dict[str, str]:
    """{effect: how one of the events shows it}, of those that the model takes and does not have."""
    from tractexp.domain import find_domain
    from tractexp.model.parts import Effect

    names = discover()["effect"].keys() - {effect.name for effect in model.effects}
    classes = [get("effect", name) for name in sorted(names)]
    showing = [cls() for cls in classes if cls.describe_sign is not Effect.describe_sign]
    taken = [effect for effect in showing if model.acceptance(effect).refusal is None]
    seen = find_domain(model).events(events) if taken else ()
    signs = {effect.name: [*filter(None, map(effect.describe_sign, seen))] for effect in taken}
    return {name: several[0] for name, several in signs.items() if several}


def resolve_model(given: Any, domain: str | None = None) -> LoadModel:
    """The model that a call was given: a name, a path, a mapping of parts, a `LoadModel` or a
    composed `Model`.

    None is the usual model of the `domain`. Raises `UserError` for an unknown name.
    """
    if domain is not None:
        check_choice("domain", domain, sorted(read_choices()[DOMAIN]))
        return replace(
            resolve_model(given or read_replacements(DOMAIN, domain).get(GROUP)), domain=domain
        )
    if isinstance(given, LoadModel):
        return given
    if given is None or isinstance(given, str | Path):
        given = read_choice(GROUP, str(given or read_default_choices()[GROUP]))
    elif not isinstance(given, Mapping):
        given = _build_node(given)
    keys = [f.name for f in dataclasses.fields(LoadModel)]
    for key in given:
        if key not in keys:
            known = list_allowed(key, keys, "Keys")
            raise UserError(f"{name_setting(f'model.{key}')}: there is no such key{known}")
    if missing := [part for part in PARTS if not given.get(part)]:
        raise UserError(
            f"model lacks {' and '.join(missing)}; name a motor and a static load ('none' for"
            " without)"
        )
    composed: dict[str, Any] = dict(given) | {
        part: Choice.from_argument(f"model/{part}", given[part]).node for part in PARTS
    }
    for item in dataclasses.fields(LoadModel):
        if item.name in composed:
            check_kind(f"model.{item.name}", composed[item.name], item.type)
    return LoadModel(**composed)


def _build_node(model: Any) -> dict[str, Any]:
    """The parts of a model composed of plugins."""
    try:
        motor, static = (
            {"name": p.name, **dataclasses.asdict(p)} for p in (model.motor, model.static)
        )
        parts = {
            "motor": motor,
            "static": static,
            "effects": [effect.name for effect in model.effects],
        }
        return parts | {
            "integration": model.integration,
            "domain": model.domain,
            "window": model.window,
        }
    except AttributeError:
        kind = type(model).__name__
        raise UserError(
            f"model is of type {kind}; give a name, or what tractexp.compose makes"
        ) from None
