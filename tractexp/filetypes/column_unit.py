"""Units of columns, as instruments of many countries write them."""

import re
from collections.abc import Mapping

from tractexp.recording.recording import find_unit
from tractexp.recording.unit import parse_amount

# {unit in lower case, but those of voltage and current: (quantity, factor to s, MW, Mvar, Hz, rad,
# pu)}
UNITS: Mapping[str, tuple[str, float]] = {
    unit: (quantity, size)
    for quantity, sizes in {
        "t": {
            1.0: "s sec second seconds sek 秒 с сек",
            1e-3: "ms msec millisecond milliseconds 毫秒 мс",
            1e-6: "us µs μs usec microseconds 微秒 мкс",
            1e-9: "ns",
            60.0: "min",
            3600.0: "h",
            86400.0: "day days",
        },
        "power": {1.0: "mw мвт 兆瓦", 1e-3: "kw квт 千瓦", 1e-6: "w", 1e3: "gw"},
        "reactive": {
            1.0: "mvar mva мвар 兆乏",
            1e-3: "kvar kva квар 千乏",
            1e-6: "var va",
            1e3: "gvar",
        },
        "frequency": {1.0: "hz гц", 1e-3: "mhz"},
        "rocof": {1.0: "hz/s"},
        "angle": {0.017453292519943295: "deg degree degrees ° grad 度", 1.0: "rad radian radians"},
        "": {1.0: "pu p.u. p.u puv 1", 1e-2: "%"},
    }.items()
    for size, units in sizes.items()
    for unit in units.split()
} | {"per unit": ("", 1.0)}
PER_UNIT = frozenset(unit for unit, (quantity, _) in UNITS.items() if not quantity)
FITTING: Mapping[str, tuple[str, ...]] = {
    "t": ("t",),
    "U": ("voltage", ""),
    "I": ("current", ""),
    "P": ("power", ""),
    "Q": ("reactive", ""),
    "f": ("frequency", ""),
    "dfdt": ("rocof", "frequency", ""),
    "angle": ("angle", ""),
    "day": ("t", ""),
    "frac": ("t", ""),
    "soc": ("t", ""),
}
# as files write them
ALSO: Mapping[str, tuple[str, ...]] = {"P": ("reactive",), "Q": ("power",), "t": ("",)}
BRACKETED = (
    r"(.+?)[\s_]*[\[(（{<]\s*([^\])）}>]*?)\s*[\])）}>]",
    r"(.+?)\s*/\s*(\S+)",
    r"(.+?)\s+in\s+(\S+)",
)
LONGEST_NAME_END = 80  # letters at the end of a name among which its unit is
UNMISTAKABLE = frozenset(
    (  # as units after a space or an underscore, where V and A may be phases
        "kv",
        "ka",
        "mw",
        "kw",
        "mvar",
        "kvar",
        "hz",
        "s",
        "ms",
        "us",
        "pu",
        "deg",
        "rad",
    )
)


def split_unit(name: str) -> tuple[str, str]:
    """A column's name and its unit.

    A unit stands at the end: before its last letters nothing is looked for, which would take hours
    in a name of a million brackets.

    Parameters
    ----------
    name : str
        A heading.

    Returns
    -------
    (str, str)
        The unit is "" where there is none.

    Examples
    --------
    >>> split_unit("Voltage [kV]"), split_unit("P_MW"), split_unit("speed")
    (('Voltage', 'kV'), ('P', 'MW'), ('speed', ''))
    """
    name = name.strip().strip('"').strip("'").strip()
    before = name[:-LONGEST_NAME_END]
    end = name[-LONGEST_NAME_END:]
    for pattern in BRACKETED:
        if (match := re.fullmatch(pattern, end)) and is_unit(match[2]):
            return before + match[1].strip(), match[2]
    match = re.fullmatch(r"(.+?)[\s,_]+([^\s,_]+)", end)
    sure = (
        match is not None
        and match[2] != "S"
        and (  # S: a phase
            match[2].lower() in UNMISTAKABLE or (not match[2].isascii() and is_unit(match[2]))
        )
    )
    return (before + match[1], match[2]) if match and sure else (name, "")


def is_unit(text: str) -> bool:
    """Whether a text is a unit of `UNITS`."""
    return find_meaning(text) is not None and not text.strip().isdigit()


def find_meaning(unit: str) -> tuple[str, float] | None:
    """What a unit means.

    Parameters
    ----------
    unit : str
        As written.

    Returns
    -------
    (str, float) or None
        The quantity ("" of per unit) and the factor to the unit used inside; None for no unit.

    Examples
    --------
    >>> find_meaning("kW"), find_meaning("furlong")
    (('power', 0.001), None)
    """
    if unit.strip() == "mW":
        return "power", 1e-9
    electrical = find_unit(unit)
    return electrical if electrical[0] else UNITS.get(unit.strip().lower())


def find_factor(unit: str) -> float:
    """The factor from a unit to the one used inside (kV, kA, MW, Mvar, s); 1 for no unit.

    A setting's unit may have a number before it.

    Examples
    --------
    >>> find_factor("V"), find_factor("89.8 kV")
    (0.001, 89.8)
    """
    number, unit = parse_amount(unit)
    return number * (find_meaning(unit) or ("", 1.0))[1]


def fits(quantity: str, unit: str, exact: bool = False) -> bool:
    """Whether a unit is one of a quantity, as `data.units` calls it; P in Mvar, Q in MW are, unless
    `exact`.
    """
    kind = find_unit_quantity(parse_amount(unit)[1])
    return kind in (FITTING[quantity] if exact else {*FITTING[quantity], *ALSO.get(quantity, ())})


def find_unit_quantity(unit: str) -> str:
    """The quantity of a unit; "" of per unit, and for no unit."""
    return (find_meaning(unit) or ("",))[0]
