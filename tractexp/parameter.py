"""A model parameter, declared once beside the equation that uses it, and the box a
search works in.
"""

from dataclasses import dataclass, field

import numpy as np

from tractexp.errors import UserError, list_allowed


@dataclass(frozen=True)
class Parameter:
    """One number to identify: its default, bounds, unit, meaning and source.

    The attribute a plugin assigns it to is its name.

    Attributes
    ----------
    default : float
        Where a search that asks for a start begins.
    bounds : (float, float)
        Least and greatest value, in its unit.
    unit : str
        "1" of a plain number.
    about : str
        What it means, in a few words.
    source : str
        Where default and bounds come from.
    symbol : str
        LaTeX; "": the name.
    null : float or None
        The value at which the equations are as if the term were absent.
    power_exponent : int
        How the value goes with the base of power, whatever its unit: on a base of a k-th of the MVA
        the same load has k^power_exponent times the value. A power, a torque, an inertia or an
        admittance has 1, an impedance -1; shares, times and voltages have 0.
    physical : (float, float) or None
        The range of real devices, within the bounds, to which records from the field are held;
        None: the bounds are.
    natural_ends : tuple of float
        Bounds that are ordinary values, such as a share of 1 that a device may have: to rest on one
        is no sign that the search ended there. Of what is no size 0 is one anyhow.

    Examples
    --------
    >>> class Load:
    ...     p_v = Parameter(1.5, (0.0, 4.0), "1", "exponent of P", "IEEE Task Force 1995")
    >>> Load.p_v.name, Load.p_v.bounds
    ('p_v', (0.0, 4.0))
    """

    default: float
    bounds: tuple[float, float]
    unit: str
    about: str
    source: str
    symbol: str = ""
    null: float | None = None
    power_exponent: int = field(default=0, kw_only=True)
    physical: tuple[float, float] | None = field(default=None, kw_only=True)
    natural_ends: tuple[float, ...] = field(default=(), kw_only=True)
    name: str = field(default="", compare=False)

    @property
    def absent(self) -> float:
        """The `null` of a parameter that has one: the size of an effect."""
        assert self.null is not None
        return self.null

    def __set_name__(self, owner: type, name: str) -> None:
        """Take the attribute's name, and its symbol where none is given."""
        if not self.name:  # one of several classes' has its name already
            object.__setattr__(self, "name", name)
            object.__setattr__(self, "symbol", self.symbol or name)

    def check(self, where: str) -> None:
        """Raise `UserError` unless low <= default, null <= high, low < high, all finite, and no
        text is empty.
        """
        for what in ("unit", "about", "source"):
            if not getattr(self, what).strip():
                raise UserError(
                    f"{where}: the parameter has no {what}; say it ('1' where a number has no unit)"
                )
        if not isinstance(self.power_exponent, int):
            raise UserError(
                f"{where}: power_exponent={self.power_exponent!r} must be a whole number: 1 of a"
                " power or an admittance, -1 of an impedance, 0 of what no base of power changes"
            )
        self._check_numbers(where)

    def _check_numbers(self, where: str) -> None:
        """Raise `UserError` unless the bounds are finite and in order, and the numbers lie
        within them.
        """
        low, high = self.bounds
        if not (np.isfinite([low, high]).all() and low < high):
            raise UserError(
                f"{where}: bounds [{low:g}, {high:g}] must be two finite numbers, the lower one"
                " first"
            )
        if not low <= self.default <= high:
            raise UserError(
                f"{where}: the default {self.default:g} is outside the bounds [{low:g}, {high:g}]"
            )
        if self.null is not None and not low <= self.null <= high:
            raise UserError(
                f"{where}: the null {self.null:g} is outside the bounds [{low:g}, {high:g}]"
            )
        if self.physical is not None and not low <= self.physical[0] < self.physical[1] <= high:
            raise UserError(
                f"{where}: the physical range {list(self.physical)} must lie within the bounds"
                f" [{low:g}, {high:g}], the lower end first"
            )
        if not set(self.natural_ends) <= {low, high}:
            raise UserError(
                f"{where}: the natural ends {list(self.natural_ends)} must be bounds, of"
                f" [{low:g}, {high:g}]"
            )


@dataclass(frozen=True)
class Box:
    """The values that a search may try: bounds (d,), and the way to the unit cube and back.

    A problem's box has the names of its columns. An optimizer's has none: it is the unit cube, or
    the problem's bounds where the optimizer asks for `space="raw"`.

    Examples
    --------
    >>> box = Box(np.array([0.0, 10.0]), np.array([1.0, 30.0]), ("C", "X"))
    >>> box.from_unit(np.array([0.5, 0.25])).tolist()
    [0.5, 15.0]
    >>> box.clip(np.array([[2.0, 20.0]])).tolist()
    [[1.0, 20.0]]
    """

    lower: np.ndarray  # (d,)
    upper: np.ndarray  # (d,)
    names: tuple[str, ...] = ()

    @classmethod
    def from_parameters(cls, parameters: tuple[Parameter, ...]) -> "Box":
        """The box of some parameters, with their names and bounds."""
        bounds = np.array([p.bounds for p in parameters], dtype=float).reshape(-1, 2)
        return cls(bounds[:, 0].copy(), bounds[:, 1].copy(), tuple(p.name for p in parameters))

    of = from_parameters  # its name in version 0.2

    @classmethod
    def unit(cls, dimension: int) -> "Box":
        """The unit cube of so many coordinates, without names."""
        return cls(np.zeros(dimension), np.ones(dimension))

    @property
    def dimension(self) -> int:
        """The number d of coordinates."""
        return len(self.lower)

    @property
    def width(self) -> np.ndarray:
        """The width (d,) of each coordinate's range."""
        return self.upper - self.lower

    def clip(self, x: np.ndarray) -> np.ndarray:
        """Points (n, d) moved to the nearest of the box."""
        return np.clip(x, self.lower, self.upper)

    def uniform(self, rng: np.random.Generator, n: int) -> np.ndarray:
        """Points (n, d) of the box, drawn uniformly.

        Examples
        --------
        >>> Box.unit(2).uniform(np.random.default_rng(1), 3).shape
        (3, 2)
        """
        return self.from_unit(rng.random((n, self.dimension)))

    def from_unit(self, unit: np.ndarray) -> np.ndarray:
        """Points (..., d) of the unit cube in this box's coordinates, never outside the bounds by
        rounding.
        """
        return self.clip(self.lower + self.width * unit)

    def to_unit(self, x: np.ndarray) -> np.ndarray:
        """The points (..., d) of this box in the unit cube.

        Examples
        --------
        >>> Box(np.array([10.0]), np.array([30.0])).to_unit(np.array([15.0])).tolist()
        [0.25]
        """
        return (x - self.lower) / self.width

    def index(self, name: str) -> int:
        """The column of a name.

        Raises
        ------
        UserError
            For a name that there is not, with the nearest one.
        """
        if name not in self.names:
            raise UserError(
                f"this model has no parameter '{name}'"
                f"{list_allowed(name, self.names, 'Parameters')}"
            )
        return self.names.index(name)


def spread_evenly(n: int, d: int) -> np.ndarray:
    """Points that fill the unit cube evenly, the same ones every time.

    Parameters
    ----------
    n : int
        How many.
    d : int
        Of so many coordinates.

    Returns
    -------
    (n, d) array
        In [0, 1). Source: Roberts 2018, the additive sequence R_d.

    Examples
    --------
    >>> spread_evenly(3, 1).ravel().round(3).tolist()
    [0.118, 0.736, 0.354]
    """
    ratio = 2.0
    for _ in range(60):  # the root above 1 of x^(d + 1) = x + 1
        ratio = (1 + ratio) ** (1 / (d + 1))
    return (0.5 + np.outer(np.arange(1, n + 1), ratio ** -np.arange(1.0, d + 1))) % 1


def best_distinct(
    unit: np.ndarray, f: np.ndarray, distance: float, count: int, norm: float = np.inf
) -> np.ndarray:
    """Indices of the best points that are not too close to a better one.

    Parameters
    ----------
    unit : (n, d)
        Points in the unit cube.
    f : (n,)
        Objectives, lower is better.
    distance : float
        Each chosen one is further than this from every better one chosen.
    count : int
        At most so many.
    norm : float
        Order of the distance's norm: `np.inf` takes the coordinate that differs most, 2 is
        Euclid's.

    Returns
    -------
    (k,) array of ints
        The best first.

    Examples
    --------
    >>> best_distinct(np.array([[0.1], [0.15], [0.9]]), np.array([2.0, 1.0, 3.0]), 0.1, 2).tolist()
    [1, 2]
    """
    remaining, chosen = np.argsort(f, kind="stable"), []
    while len(remaining) and len(chosen) < count:
        chosen.append(remaining[0])
        remaining = remaining[
            np.linalg.norm(unit[remaining] - unit[remaining[0]], norm, axis=1) > distance
        ]
    return np.array(chosen, dtype=int)


def find_unlike(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which rows are no copies of an earlier one, to the last bit.

    Parameters
    ----------
    rows : (n, d)
        Points.

    Returns
    -------
    (m,) array of ints
        The first of each kind.
    (n,) array of ints
        Of which of these each row is a copy.

    Examples
    --------
    >>> chosen, copies = find_unlike(np.array([[0.1], [0.9], [0.1]]))
    >>> chosen.tolist(), copies.tolist()
    ([0, 1], [0, 1, 0])
    """
    places: dict[bytes, int] = {}
    copies = np.array([places.setdefault(row.tobytes(), len(places)) for row in rows], dtype=int)
    return np.unique(copies, return_index=True)[1], copies
