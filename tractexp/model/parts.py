"""The bases a load is composed of. A part returns what it is asked for; the framework does the
rest.

A method gets the part's own parameters by name, as SymPy symbols; which names it asks for is
checked when the plugin is registered, and the bases' `*_, **parameters` leave them open to a type
checker. What `eq` offers is told in docs/plugins.md.
"""

import inspect
from abc import abstractmethod
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from tractexp.configuration.plugin import Plugin
from tractexp.errors import UserError, list_allowed
from tractexp.model import sites
from tractexp.model.names import check_name
from tractexp.model.signature import check_signature, select_arguments

if TYPE_CHECKING:
    from sympy import Expr, Symbol

    from tractexp.model.drive import Drive
    from tractexp.model.equations import Equations

# recorded channels that not every record has; I0 of waveforms, where there is some
CHANNELS = ("f", "U2", "I0")
LEFT = ("P_s0", "Q_s0")  # what the other parts leave to the static load before the event
OWN = "motor"  # who writes the states that are pushed, and the speed that effects ask for
COMPARED = ("I0",)  # of these, what is compared and drives nothing: an event may be without


class Part(Plugin):
    """A part of a load.

    `reads` names the recorded channels (`f`, `U2`, `I0`) without which its parameters cannot be
    identified.
    """

    reads: ClassVar[tuple[str, ...]] = ()
    phasors_only: ClassVar[str] = ""  # why it makes no sense of waveforms; "" where it does
    waves_only: ClassVar[str] = ""  # why it makes no sense of phasors
    # A structure that most loads may have as well: every fit tells by how much it would move the
    # parameters. A static load takes the place of the model's own, an effect is added.
    rival: ClassVar[bool] = False

    @classmethod
    def check_class(cls, where: str) -> None:
        """Raise `UserError` for names of parameters that cannot be, or a channel that no record
        has.
        """
        for parameter in cls.parameters:
            check_name(parameter.name, where)
        for channel in cls.reads:
            if channel not in CHANNELS:
                raise UserError(
                    f"{where}: reads names the channel"
                    f" '{channel}'{list_allowed(channel, CHANNELS, 'Channels')}"
                )


class Motor(Part):
    """Base of the motor plugins, chosen by `model/motor=NAME`."""

    group: ClassVar[str] = "model/motor"
    # It follows what happens within a cycle, as stator transients do: its answer is looked at
    # through the window that a record's phasors were averaged over. Where it does not, the window
    # on voltage and power keeps out what it lacks.
    within_a_cycle: ClassVar[bool] = False

    @abstractmethod
    def declare(self, eq: "Equations", *_: Any, **parameters: Any) -> Any:
        """Declare states and sites, and return the stator current.

        The motor draws V conj(I), V = `eq.V`; the framework declares that.

        Parameters
        ----------
        eq : Equations
            What offers states, sites and the voltage; docs/plugins.md lists its words.
        **parameters : Symbol
            Those of the motor that the method asks for by name.

        Returns
        -------
        Expr or None
            The phasor of the stator current [pu]; None: there is no motor.
        """

    def usual(self, *_: Any, **parameters: Any) -> "Iterable[tuple[Any, float, float]]":
        """The usual sizes of such machines' quantities, to which `model.priors` holds an estimate.

        Two machines of three have a quantity within `factor` times or over its median.

        Parameters
        ----------
        **parameters : float or (n,)
            Those of the motor that the method asks for by name.

        Returns
        -------
        iterable of (quantity, median, factor)
            Each positive and log-normally spread; a quantity does not depend on the base.
        """
        return ()

    def list_usual(self, parameters: dict[str, Any]) -> "Iterable[tuple[Any, float, float]]":
        """What `usual` tells of all the motor's parameters by name."""
        return self.usual(**select_arguments(self.usual, parameters))

    @classmethod
    def check_class(cls, where: str) -> None:
        """Raise `UserError` for methods of other arguments than `declare(eq)` and `usual` may have,
        too.
        """
        super().check_class(where)
        check_signature(cls, "declare", "eq", where)
        check_signature(cls, "usual", None, where, all_taken=False)


class Static(Part):
    """Base of the static load plugins, chosen by `model/static=NAME`.

    Before the event it draws P_s0 and Q_s0: what the other parts leave.
    """

    group: ClassVar[str] = "model/static"

    @abstractmethod
    def law(
        self, u: "Symbol", *_: Any, **parameters: Any
    ) -> "tuple[Expr | float, Expr | float] | None":
        """How the static load follows the voltage.

        Parameters
        ----------
        u : Symbol
            U / U_0.
        **parameters : Symbol
            Those of the load that the method asks for by name; a law that names an argument `f`
            gets the frequency over that before the event.

        Returns
        -------
        (Expr, Expr) or None
            P / P_s0 and Q / Q_s0, both 1 at u = 1; None: there is no static load.
        """

    def compute_damping(self, *_: Any, **parameters: Any) -> Any:
        """Resistance over reactance of the branch that draws Q_s in waveforms; in phasors there is
        none.
        """
        from tractexp.model.equations import DAMPING

        return DAMPING

    def compute_compensation(self, *_: Any, **parameters: Any) -> Any:
        """Reactive power before the event [pu] that a capacitor beside the branch supplies to it in
        waveforms; 0: there is none.

        Parameters
        ----------
        **parameters : Symbol
            Those of the load, and `P_s0` and `Q_s0` [pu], that the method asks for by name.
        """
        return 0

    def require(self, *_: Any, **parameters: Any) -> Iterable[tuple[Any, ...]]:
        """The conditions of a steady state.

        Parameters
        ----------
        **parameters : Symbol
            Those of the load, and `P0`, `Q0`, `U0`, `P_s0` and `Q_s0` [pu], that the method asks
            for by name.

        Returns
        -------
        iterable of (slack, sentence) or (slack, sentence, shown)
            The slack is 0 or more where it holds; `{value}` in the sentence prints `shown`, by
            default the slack.
        """
        return ()

    @classmethod
    def check_class(cls, where: str) -> None:
        """Raise `UserError` for a law of other arguments than u, f and parameters, too."""
        super().check_class(where)
        check_signature(cls, "law", "u", where, offered=("f",))
        if "f" in inspect.signature(cls.law).parameters and "f" not in cls.reads:
            raise UserError(
                f"{where}: law() asks for the frequency, f, which not every record has; say reads ="
                " ('f',)"
            )
        before = ("P0", "Q0", "U0", *LEFT)
        check_signature(cls, "require", None, where, offered=before, all_taken=False)
        check_signature(cls, "compute_damping", None, where, all_taken=False)
        check_signature(cls, "compute_compensation", None, where, offered=LEFT, all_taken=False)


@dataclass(frozen=True)
class Curve:
    """A law as it is drawn: `y` (n,) over `x` (n,), and what the axes say."""

    x: np.ndarray
    y: np.ndarray
    x_label: str
    y_label: str


class Effect(Part):
    """Base of the effects a model may lack, named in `model.effects=[...]`: an edit of the
    equations.

    The parameters that say how large the effect is have a `null` at which the edited equations are
    the unedited ones. The others vanish there.

    Attributes
    ----------
    order : int
        Edits of a higher order come later: those that copy what others have edited.
    grid : {parameter: values}
        The values of each parameter without a null at which to look for the effect.
    relevant : {parameter: float}
        The smallest departure of a size from its null that matters.
    theory : {parameter: float}
        Its size by theory, by which an input that it alone reads acts where nobody recorded it.
    reads : names
        The recorded channels without which the effect cannot be seen.
    confused_with : names
        The effects that look alike on ordinary dips.
    places, kind
        Where it acts and what it does there, of `sites.PLACES` and `sites.KINDS`.
    iterates : bool
        Whether it solves its equations anew at each stage of a step, by parts that other effects
        have enlarged, which makes all of them dear: it is simulated beside few.
    family : name
        The textbook effect that a member of its family is tried beside: the same kind of effect at
        another place, or at the same place by another law.
    differs : str
        The end of the sentence that begins with the textbook's name.
    as_textbook : {own parameter: the textbook's}
        Where a search begins and, where it `nests_textbook`, at which values it is the textbook
        effect, the other parameters at their defaults.
    likely : {parameter: standard deviation}
        Holds shapes to their defaults, the textbook law, unless the data say otherwise.
    """

    group: ClassVar[str] = "effect"
    chosen: ClassVar[bool] = False
    # edits of a higher order come later: those that copy what others have edited
    order: ClassVar[int] = 0
    grid: ClassVar[dict[str, tuple[float, ...]]] = {}
    relevant: ClassVar[dict[str, float]] = {}
    theory: ClassVar[dict[str, float]] = {}
    confused_with: ClassVar[tuple[str, ...]] = ()
    places: ClassVar[tuple[str, ...]] = ()
    kind: ClassVar[str] = ""
    iterates: ClassVar[bool] = False
    family: ClassVar[str] = ""
    differs: ClassVar[str] = ""
    as_textbook: ClassVar[Mapping[str, str]] = {}
    nests_textbook: ClassVar[bool] = False
    likely: ClassVar[Mapping[str, float]] = {}

    def curve(self, *_: Any, **parameters: Any) -> "Curve | None":
        """The law found, to be drawn.

        Parameters
        ----------
        **parameters : float
            The effect's own that the method asks for by name, in their units.

        Returns
        -------
        Curve or None
            None: it is no law that can be drawn.
        """
        return None

    @abstractmethod
    def edit(self, eq: "Equations", *_: Any, **parameters: Any) -> None:
        """Edit the declared equations: call `eq.edit` on a site, add what is new.

        Parameters
        ----------
        eq : Equations
            Asking it for what a model lacks refuses the effect for that model.
        **parameters : Symbol
            The effect's own that the method asks for by name.
        """

    def describe_sign(self, event: Any) -> str:
        """How a recorded event shows this effect before anything is fitted.

        A model with `shown_effects` has the effects that an event shows, as nuisances: what the fit
        needs to meet the record, and nobody asks for.

        Parameters
        ----------
        event : tractexp.record.Event
            In waveforms a `WaveEvent`.

        Returns
        -------
        str
            In words; "" where it does not.
        """
        return ""

    def refusal(self, eq: "Equations") -> str | None:
        """Why an effect makes no sense for a model, where only the effect knows.

        That a site, a speed or a quantity is not there needs no saying: asking `eq` for it refuses
        the effect.

        Parameters
        ----------
        eq : Equations
            Of the model that it would be added to.

        Returns
        -------
        str or None
            The reason; None: it makes sense.
        """
        return None

    @classmethod
    def check_class(cls, where: str) -> None:
        """Raise `UserError` for an edit of other arguments, or a place or kind that there is not,
        too.
        """
        super().check_class(where)
        check_signature(cls, "edit", "eq", where)
        cls._check_place(where)
        own = {p.name: p for p in cls.parameters}
        sizes = {name for name, p in own.items() if p.null is not None}
        if not sizes:
            raise UserError(
                f"{where} has no size: give the parameter that says how large the effect is a"
                " 'null', the value at which the equations are as if it were absent"
            )
        settings = own.keys() - sizes
        _check_names(
            f"{where}: grid", cls.grid, own, settings, "is a size, looked for from its null"
        )
        _check_names(f"{where}: relevant", cls.relevant, own, sizes, "has no null and is no size")
        for name, values in cls.grid.items():
            low, high = own[name].bounds
            if outside := [v for v in values if not low <= v <= high]:
                raise UserError(
                    f"{where}: grid has {name} = {outside[0]:g}, outside its bounds [{low:g},"
                    f" {high:g}]"
                )

    @classmethod
    def _check_place(cls, where: str) -> None:
        """Raise `UserError` for a place or a kind that there is not."""
        for place in cls.places:
            if place not in sites.PLACES:
                raise UserError(
                    f"{where}: places names '{place}'{list_allowed(place, sites.PLACES, 'Places')}"
                )
        if cls.kind and cls.kind not in sites.KINDS:
            raise UserError(
                f"{where}: kind is '{cls.kind}'{list_allowed(cls.kind, sites.KINDS, 'Kinds')}"
            )


class Measurement(Effect):
    """Base of the effects of the measurement: they act on the calculated power, not on the
    equations.
    """

    def edit(self, eq: "Equations", *_: Any, **parameters: Any) -> None:
        """A recorder leaves the equations as they are."""

    @abstractmethod
    def observe(
        self, power: np.ndarray, drive: "Drive", values: dict[str, np.ndarray]
    ) -> np.ndarray:
        """P and Q as the recorder would show them, in place or anew.

        Parameters
        ----------
        power : (2, n, N) [pu]
            What n candidates calculate, all events one after the other.
        drive : Drive
            Inputs and measurements of these events.
        values : {parameter: (E, n)}
            The parameters' values in each event.

        Returns
        -------
        (2, n, N) array [pu]
        """


def _check_names(
    where: str, names: Iterable[str], own: Collection[str], allowed: Collection[str], why_not: str
) -> None:
    """Raise `UserError` for a name that is none of an effect's `own` parameters, or not allowed."""
    for name in names:
        if name not in own:
            raise UserError(
                f"{where} names '{name}', no parameter of it{list_allowed(name, own, 'It has')}"
            )
        if name not in allowed:
            raise UserError(f"{where} names '{name}', which {why_not}; take it out")
