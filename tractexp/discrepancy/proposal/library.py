"""The library of terms: what may act (a signal) where (a balance), declared once for the screen and
for the plugin.

Instants, levels, times and frequencies stand on grids that know nothing of any record; a
shortlisted term's are freed.
"""

import functools
import itertools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from tractexp.discrepancy.proposal import balances, shapes
from tractexp.model import sites
from tractexp.parameter import Parameter

if TYPE_CHECKING:
    from tractexp.model.equations import Equations

SOURCE = "a term proposed by the data; see docs/missing-effects.md"
# kinds of signals: functions of voltage and states, functions of time, and what these count by
ANSWER, TIMED, CLOCK = "answer", "timed", "clock"

Grid = tuple[float, ...]


@dataclass(frozen=True)
class Shape:
    """A parameter of a signal: its values on the grid of the screen, its bounds,
    unit and symbol.
    """

    name: str
    grid: Grid
    bounds: tuple[float, float]
    unit: str
    about: str
    latex: str

    def parameter(self, name: str, default: float | None = None) -> Parameter:
        """As a parameter of an effect."""
        value = self.grid[len(self.grid) // 2] if default is None else default
        return Parameter(value, self.bounds, self.unit, self.about, SOURCE, self.latex, name=name)


@dataclass(frozen=True)
class Signal:
    """What a term follows, or the clock that a function of time counts by. `latex` formats the
    symbols of its parameters.
    """

    name: str
    kind: str
    words: str
    latex: str = ""
    shapes: tuple[Shape, ...] = ()
    needs: str = ""  # of the equations: "" nothing, or the name of what must be there

    @property
    def build(self) -> Callable[..., Any]:
        """The function that writes it into equations."""
        return getattr(shapes, self.name)

    @property
    def settings(self) -> list[dict[str, float]]:
        """Every combination of grid values; of phases the first, for two of them make one block of
        a screen.
        """
        values = itertools.product(
            *(s.grid[:1] if s.name == "phase" else s.grid for s in self.shapes)
        )
        return [dict(zip((s.name for s in self.shapes), chosen, strict=True)) for chosen in values]


@dataclass(frozen=True)
class Size:
    """How large a term is: `relevant` is what a linear step uses as its unit, `where` it acts if
    not in all.

    Signals are shares, so that `power_exponent` is that of what the size is added to.
    """

    name: str
    bound: float
    unit: str
    relevant: float
    latex: str = "k"
    where: str = ""
    power_exponent: int = 0

    def parameter(self, name: str, about: str, default: float = 0.0) -> Parameter:
        """As a parameter of an effect."""
        bounds = (-self.bound, self.bound)
        return Parameter(
            default,
            bounds,
            self.unit,
            about,
            SOURCE,
            self.latex,
            null=0.0,
            power_exponent=self.power_exponent,
            name=name,
        )


@dataclass(frozen=True)
class Balance:
    """Where a term acts. `latex` formats the signal `g`."""

    name: str
    words: str
    latex: str
    sizes: tuple[Size, ...]
    places: tuple[sites.Site, ...] = ()
    in_waves: tuple[sites.Site, ...] | None = None  # where they are others
    kinds: tuple[str, ...] = (ANSWER,)
    # signals that make no sense here: a flux is not switched
    without: tuple[str, ...] = ("constant", "relay", "below")

    @property
    def build(self) -> Callable[..., Any]:
        """The function that adds a signal to it."""
        return getattr(balances, self.name)

    def places_in(self, eq: "Equations") -> tuple[sites.Site, ...]:
        """The sites it edits in equations of phasors or of waves."""
        return self.places if self.in_waves is None or not eq.waves else self.in_waves


@dataclass(frozen=True)
class Term:
    """A signal in a balance; with a clock it is a function of time, not of the voltage."""

    balance: Balance
    signal: Signal
    clock: Signal | None = None

    @property
    def name(self) -> str:
        """Kind, balance, signal and clock, by which it is known."""
        return ":".join(
            (
                self.signal.kind,
                self.balance.name,
                self.signal.name,
                *([self.clock.name] if self.clock else []),
            )
        )

    def parameters(self, values: Mapping[str, float], prefix: str = "") -> list[Parameter]:
        """Its sizes and those of its signal, with these defaults; names begin with `prefix`."""
        where = self.balance.words
        sizes = [
            s.parameter(prefix + s.name, f"size in {s.where or where}", values[s.name])
            for s in self.balance.sizes
        ]
        return sizes + [s.parameter(prefix + s.name, values[s.name]) for s in self.signal.shapes]

    @property
    def words(self) -> str:
        """What it is, in words."""
        text = self.signal.words + (f" {self.clock.words}" if self.clock else "")
        return f"{text}, in {self.balance.words}"

    @property
    def latex(self) -> str:
        """The term as an edit of its balance."""
        return self.balance.latex.replace("{g}", self.signal.latex)


def name_size(kind: str, balance: Balance, size: Size) -> str:
    """What the library's effect of a kind calls a size: of several, each is that of a balance of
    its own.
    """
    part = size.name.removeprefix("size")
    return f"{kind}_{balance.name}{part}_size"


def name_shape(signal: Signal, shape: Shape) -> str:
    """What it calls a parameter of a signal."""
    return f"{signal.kind}_{signal.name}_{shape.name}"


def pick_of(kind: str, name: str) -> str:
    """What it calls the choice of a signal or a clock: 1 where it is chosen."""
    return f"{kind}_pick_{name}"


def _declare_level(low: float, high: float, grid: Grid, latex: str) -> Shape:
    """A level of a signal, over its value before the event."""
    return Shape("level", grid, (low, high), "1", "level, over the value before the event", latex)


def _declare_time(grid: Grid) -> Shape:
    """A time constant [s]."""
    return Shape("time", grid, (0.002, 3.0), "s", "time constant", "T")


def _space_evenly(first: float, last: float, step: float) -> Grid:
    """Values in even steps."""
    return tuple(round(first + k * step, 6) for k in range(round((last - first) / step) + 1))


def _declare_instant(grid: Grid) -> Shape:
    """An instant [s] at which a signal begins."""
    return Shape("instant", grid, (0.0, 30.0), "s", "instant at which it begins", "t_1")


_FREQUENCY = Shape("frequency", _space_evenly(2.0, 44.0, 1.5), (0.5, 100.0), "Hz", "frequency", "f")
_PHASE = Shape("phase", (0.0, 1.5707963), (-6.3, 6.3), "rad", "phase", r"\varphi")
_SQUARE = r"\frac{|E|^2}{|E_0|^2}"
_LAGS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
_LEVELS = (0.5, 0.6, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95)
_DELAYS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.3)

SIGNALS = (
    Signal("power", ANSWER, "a power of the voltage", r"(u^{a} - 1)",
           (Shape("exponent", (-2.0, -1.0, 0.5, 1.0, 2.0, 3.0), (-4.0, 8.0), "1", "exponent",
                  "a"),)),
    Signal("knee", ANSWER, "what the voltage lacks to a level", r"[u_1 - u]_+",
           (_declare_level(0.2, 0.99, _LEVELS, "u_1"),)),
    Signal("knee_squared", ANSWER, "what the voltage lacks to a level, squared", r"[u_1 - u]_+^2",
           (_declare_level(0.2, 0.99, _LEVELS, "u_1"),)),
    Signal("below", ANSWER, "a switch while the voltage is below a level", r"1_{u < u_1}",
           (_declare_level(0.2, 0.985, _LEVELS, "u_1"),)),
    Signal("rate", ANSWER, "the slope of the voltage", r"\dot u"),
    Signal("lag", ANSWER, "the voltage as a lag sees it", r"(x - 1),\quad T\,\dot x = u - x",
           (_declare_time(_LAGS),)),
    Signal("washout", ANSWER, "the voltage less what a lag sees of it", r"(u - x),\quad T\,\dot x ="
        r" u - x",
           (_declare_time(_LAGS),)),
    Signal("relay", ANSWER, "a relay that trips below a level and returns", r"g,\quad g \in \{0,"
        r" 1\}", (
        _declare_level(0.3, 0.97, (0.55, 0.7, 0.8, 0.9), "u_1"),
        Shape("margin", (0.03, 0.1), (0.005, 0.4), "1", "recovered is this much above the level",
              "h"),
        Shape("delay", _DELAYS, (0.0, 1.0), "s", "time below the level before it trips", "T_1"),
        Shape("wait", (0.02, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5, 0.7, 5.0),
              (0.0, 10.0), "s", "time back before it returns", "T_2"),
        Shape("ramp", (0.03,), (0.0, 2.0), "s", "time in which it returns", "T_3"),
    )),
    Signal("field", ANSWER, "the square of the flux", rf"({_SQUARE} - 1)", needs="E"),
    Signal("field_knee", ANSWER, "the square of the flux beyond a level",
           rf"([{_SQUARE} - e_1]_+ - [1 - e_1]_+)",
           (_declare_level(0.1, 0.99, (0.4, 0.5, 0.6, 0.7, 0.8, 0.9), "e_1"),), needs="E"),
    Signal("slip", ANSWER, "the slip", r"(s - s_0)", needs="omega"),
    Signal("slip_squared", ANSWER, "the square of the slip", r"(s^2 - s_0^2)", needs="omega"),
    Signal("current", ANSWER, "the motor's current", r"(\frac{|I|}{|I_0|} - 1)",
           needs="stator_current"),
    Signal("current_squared", ANSWER, "the square of the motor's current", r"(\frac{|I|^2}{|I_0|^2}"
        r" - 1)",
           needs="stator_current"),
    Signal("constant", ANSWER, "a constant", ""),
    Signal("step", TIMED, "a step", r"1_{t \geq t_1}",
           (_declare_instant(_space_evenly(0.0, 1.8, 0.01)),)),
    Signal("ramp", TIMED, "a straight line that begins", r"[t - t_1]_+",
           (_declare_instant(_space_evenly(0.0, 1.8, 0.04)),)),
    Signal("decay", TIMED, "a step that decays", r"1_{t \geq t_1}\,e^{-(t - t_1)/T}",
           (_declare_instant(_space_evenly(0.0, 0.9, 0.03)), _declare_time((0.03, 0.1, 0.3)))),
    Signal("ring", TIMED, "an oscillation that begins and decays",
           r"1_{t \geq t_1}\,e^{-(t - t_1)/T} \cos(2 \pi f (t - t_1) + \varphi)",
           (_declare_instant((0.0, 0.15, 0.3, 0.45)), _declare_time((0.06, 0.25)), _FREQUENCY,
            _PHASE)),
)  # fmt: skip

CLOCKS = (
    Signal("of_record", CLOCK, "at a time of the record"),
    Signal("of_dip", CLOCK, "at a time after the dip begins"),
    Signal("of_return", CLOCK, "at a time after the voltage returns"),
)

_PU, _SHARE = Size("size", 2.0, "pu", 0.02, power_exponent=1), Size("size", 3.0, "1", 0.05)
_BOTH = (
    Size("size_P", 2.0, "pu", 0.02, "k_P", "active power", 1),
    Size("size_Q", 2.0, "pu", 0.02, "k_Q", "reactive power", 1),
)
_ANY = (ANSWER, TIMED)
_Z = sites.stator_impedance
_OWN_CURRENT = ("current", "current_squared", "relay", "below")
_SWITCHED = ("constant",)
BALANCES = (
    Balance(
        "power_P",
        "the active power",
        r"P \rightarrow P + k\,{g}",
        (_PU,),
        kinds=_ANY,
        without=_SWITCHED,
    ),
    Balance(
        "power_Q",
        "the reactive power",
        r"Q \rightarrow Q + k\,{g}",
        (_PU,),
        kinds=_ANY,
        without=_SWITCHED,
    ),
    Balance(
        "power",
        "active and reactive power",
        r"P + \mathrm{j} Q \rightarrow P + \mathrm{j} Q"
        r" + (k_P + \mathrm{j} k_Q)\,{g}",
        _BOTH,
        kinds=_ANY,
        without=_SWITCHED,
    ),
    Balance(
        "whole",
        "the whole load by one share",
        r"P + \mathrm{j} Q \rightarrow (P + \mathrm{j} Q)(1 + k\,{g})",
        (_SHARE,),
        without=_SWITCHED,
    ),
    Balance(
        "static",
        "the static load by one share",
        r"P_s + \mathrm{j} Q_s \rightarrow (P_s + \mathrm{j} Q_s)(1 + k\,{g})",
        (_SHARE,),
        (sites.P_static, sites.Q_static),
        without=_SWITCHED,
    ),
    Balance(
        "static_P",
        "the static load's active power",
        r"P_s \rightarrow P_s (1 + k\,{g})",
        (_SHARE,),
        (sites.P_static,),
        without=_SWITCHED,
    ),
    Balance(
        "static_Q",
        "the static load's reactive power",
        r"Q_s \rightarrow Q_s (1 + k\,{g})",
        (_SHARE,),
        (sites.Q_static,),
        without=_SWITCHED,
    ),
    Balance(
        "motor",
        "the motors' power by one share",
        r"P_d + \mathrm{j} Q_d \rightarrow (P_d + \mathrm{j} Q_d)(1 + k\,{g})",
        (_SHARE,),
        (sites.P_motor, sites.Q_motor),
        (sites.motor_current,),
        without=_SWITCHED,
    ),
    Balance(
        "torque",
        "the load torque",
        r"T_L \rightarrow T_L + k\,{g}",
        (Size("size", 20.0, "pu", 0.05, power_exponent=1),),
        (sites.load_torque,),
        without=_SWITCHED,
    ),
    Balance(
        "coupling",
        "the coupling of rotor and stator",
        r"c \rightarrow c\,(1 + k\,{g})",
        (Size("size", 3.0, "1", 0.02),),
        (sites.coupling,),
    ),
    Balance(
        "decay",
        "the decay of the rotor's flux",
        r"\frac{1}{\tau'} \rightarrow \frac{1}{\tau'}\,(1 + k\,{g})",
        (Size("size", 60.0, "1", 0.05),),
        (sites.time_constant,),
    ),
    Balance(
        "magnetizing",
        "the magnetizing reactance",
        r"c \rightarrow c/(1 + k\,{g}),\quad \tau' \rightarrow \tau'/(1 + k\,{g})",
        (Size("size", 10.0, "1", 0.05),),
        (sites.coupling, sites.time_constant),
    ),
    Balance(
        "resistance",
        "the stator's resistance",
        r"Z' \rightarrow Z' + k\,{g}",
        (Size("size", 0.5, "pu", 0.005, power_exponent=-1),),
        (_Z,),
        without=_OWN_CURRENT,
    ),
    Balance(
        "reactance",
        "the stator's reactance",
        r"Z' \rightarrow Z' + \mathrm{j} k\,{g}",
        (Size("size", 0.5, "pu", 0.005, power_exponent=-1),),
        (_Z,),
        without=(*_OWN_CURRENT, "constant"),
    ),
    Balance(
        "angle",
        "the angle of the voltage",
        r"V \rightarrow V (1 + \mathrm{j} k\,{g})",
        (Size("size", 2.0, "rad", 0.02),),
        (sites.motor_voltage,),
    ),
    Balance(
        "voltage",
        "the voltage that the load sees",
        r"V \rightarrow V (1 + k\,{g})",
        (Size("size", 0.5, "1", 0.005),),
        (sites.motor_voltage, sites.static_voltage),
        kinds=(TIMED,),
    ),
)


@functools.cache
def list_terms() -> tuple[Term, ...]:
    """Every term of the library."""
    return tuple(_yield_terms())


def _yield_terms() -> Iterator[Term]:
    """Each signal in each balance that may have it, by each clock where it is one of time."""
    for balance, signal in itertools.product(BALANCES, SIGNALS):
        if signal.kind not in balance.kinds or signal.name in balance.without:
            continue
        for clock in CLOCKS if signal.kind == TIMED else (None,):
            yield Term(balance, signal, clock)


def find_term(name: str) -> Term:
    """The term of that name."""
    return next(t for t in list_terms() if t.name == name)
