"""A station's loads over the years: what they are, what differs from dip to dip, and how well dips
were predicted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from typing import Any

import numpy as np

from tractexp.blocks import Report, Table, style
from tractexp.blocks.chart import Chart
from tractexp.identification.composition import DAYS_A_YEAR, HOUR
from tractexp.inference.interval import INTERVAL_LEVEL
from tractexp.inference.model_error import format_percent, tell_error
from tractexp.text.wording import count_noun, list_first, shorten

MOST_SCREEN_ROWS, MOST_SCREEN_LOADS = 8, 4  # loads of the first screen, and those it describes
TWO_LINES = 150  # characters
MOST_TOLD_ODD = 3  # odd dips that a line names
TOLD_CONSTANTS = ("T_prime", "X_prime", "H")  # of a load's row
TERM_NAMES = {
    "hour": "hour of the day",
    "weekday": "weekday, Monday the first",
    "season": "month",
    "year": "year, from the first dip on",
}
UNUSABLE = "unusable"
VERDICTS = {"usable": "good", UNUSABLE: "bad"}
ON_OWN = "per unit of what the motors draw"
CONSTANTS_CAPTION = (
    f"Impedances and inertia are {ON_OWN} before the dip, so that they are the same however many of"
    " them run. Intervals: 95 %, by leaving out one dip at a time. Differs: by how much a constant"
    " varies from dip to dip beyond chance, of those that do."
)
LEAST_DATED_SPAN = 1.0  # years: dips of a shorter span are drawn by their numbers
MOST_NUMBERED = 20  # dips, each with a tick of its own
TIME_CAPTION = (
    "Above: the model's error on each dip, of its response, as those before it predict it, and the"
    " error that 95 % of the dips predicted until then stayed below. Below:"
    " the motors' share of P in each dip, and what was expected of it. Crosses: left out."
)


def tell_load(load: Mapping[str, Any]) -> dict[str, Any]:
    """The row of a load."""
    constants = {row["name"]: row for row in load["constants"]}
    predicted = load["predicted"]
    share = load["share"] if load["usability"] != UNUSABLE else {"value": None, "spread": None}
    return {
        "station": load["station"],
        "load": load["load"],
        "dips": load["dips"],
        "usability": load["usability"],
        "left_out": len(load["odd"]),
        **{name: constants[name]["value"] for name in TOLD_CONSTANTS if name in constants},
        "share": share["value"],
        "spread": share["spread"],
        "varies": load["composition"]["varies"],
        "P_mean": load["power"]["mean"],
        "unit": load["power"]["unit"],
        "error": load["error"]["value"],
        "predicted": predicted["last_half"],
    }


def tabulate_loads(content: Mapping[str, Any]) -> Table:
    """A row for each load that was fitted."""
    rows = [
        [
            load["load"] or load["station"],
            load["dips"],
            load["usability"],
            _tell_share(load),
            tell_error(load["error"]),
            _format_percent(load["predicted"]["last_half"]),
        ]
        for load in content["loads"]
        if "why" not in load
    ]
    columns = ["load", "dips", "use", "motors, of P", "error", "predicted"]
    return Table(columns, rows, f"loads of {content['folder']}", words=(2, 3, 4, 5))


def _tell_share(load: Mapping[str, Any]) -> str:
    """Nothing where the model does not describe the load: then no part of it is a motor's share."""
    share = load["share"]
    if load["usability"] == UNUSABLE:
        return "not told"
    return f"{share['value']:.0%} ± {share['spread']:.1%}"


def _format_percent(value: float | None) -> str:
    return "" if value is None else format_percent(value)


def build_screen(content: Mapping[str, Any]) -> Report:
    """The answer in 25 lines: the loads in a table, and of the first what differs."""
    page = Report().text(_tell_extent(content))
    table = tabulate_loads(content)
    rows = table.rows[:MOST_SCREEN_ROWS]
    page.add(replace(table, rows=rows))
    told = [shorten(sentence, TWO_LINES) for sentence in _describe_loads(content)]
    page.text(*told[:MOST_SCREEN_LOADS])
    if len(told) > MOST_SCREEN_LOADS:
        page.text("of every load: --all, or the page")
    unfitted = [shorten(sentence, TWO_LINES) for sentence in _describe_unfitted(content)]
    return page.text(*unfitted[:1])


def build_summary(content: Mapping[str, Any]) -> Report:
    """The loads in a table, then of each what differs, in sentences."""
    page = Report().text(_tell_extent(content)).add(tabulate_loads(content))
    return page.text(*_describe_loads(content), *_describe_unfitted(content))


def _describe_loads(content: Mapping[str, Any]) -> list[str]:
    """A line for each load that was fitted."""
    return [
        f"{load['load'] or load['station']}: {describe_load(load)}"
        for load in content["loads"]
        if "why" not in load
    ]


def _tell_extent(content: Mapping[str, Any]) -> str:
    dips = sum(load["dips"] for load in content["loads"] if "why" not in load)
    return f"{content['files']} files in {content['folder']}, {count_noun(dips, 'dip')} fitted"


def _describe_unfitted(content: Mapping[str, Any]) -> list[str]:
    """A sentence for each load that was not fitted, and one for all dips that could not be read,
    with the reason of the first.
    """
    told = [
        f"not fitted: {load['load'] or load['station']}: {load['why']}"
        for load in content["loads"]
        if "why" in load
    ]
    if unread := content["unread"]:
        first = unread[0]
        told.append(f"not read: {count_noun(len(unread), 'dip')}, {first['event']}: {first['why']}")
    return told


def describe_load(load: Mapping[str, Any]) -> str:
    """The differences between dips, the predicted dips, and what was left out, in a line."""
    told = [f"{load['usability']}: {load['reason']}", _tell_variation(load)]
    differs = {r["name"]: r["spread"] for r in load["constants"] if r["spread"]}
    differs.pop("H", None)
    if differs:
        own = ", ".join(f"{name} by {spread:.0%}" for name, spread in differs.items())
        told.append(f"no constants: {own} from dip to dip")
    if odd := load["odd"]:
        told.append(f"left out: {list_first([o['event'] for o in odd], MOST_TOLD_ODD)}")
    return "; ".join(told)


def _tell_variation(load: Mapping[str, Any]) -> str:
    """By what the share differs."""
    if load["usability"] == UNUSABLE:
        return "so its dips tell nothing of the motors' share"
    share, terms = load["share"], load["composition"]["terms"]
    spread = f"{share['spread']:.1%} of P"
    if not terms:
        return f"motors {share['value']:.0%} of P, from dip to dip ± {spread}"
    spans = [
        f"by {term} {min(r['value'] for r in rows):.0%} to {max(r['value'] for r in rows):.0%}"
        for term, rows in terms.items()
    ]
    return f"motors {share['value']:.0%} of P, {', '.join(spans)}, beside that ± {spread}"


def report(content: Mapping[str, Any]) -> Report:
    """The page: the loads in a table, then each by itself."""
    page = Report(f"Station of {content['folder']}", _tell_extent(content))
    page.add(tabulate_loads(content))
    page.text(*_describe_unfitted(content))
    for load in content["loads"]:
        if "why" not in load:
            _show_load(page, load)
    return page


def _show_load(page: Report, load: Mapping[str, Any]) -> None:
    """A load's section."""
    page.heading(", ".join(filter(None, (load["station"], load["load"]))))
    kind = VERDICTS.get(load["usability"], "plain")
    page.verdict(describe_load(load) + ".", kind=kind)
    page.add(_tabulate_constants(load))
    page.chart(_draw_years(load), TIME_CAPTION)
    for term, rows in load["composition"]["terms"].items():
        page.chart(_draw_term(term, rows, "motors, of P [%]", 100.0))
    for term, rows in load["power"]["terms"].items():
        page.chart(_draw_term(term, rows, f"P before the dip [{load['power']['unit']}]", 1.0))
    if load["odd"]:
        page.heading("Left out", 3)
        page.items([f"{one['event']}: {one['why']}" for one in load["odd"]])
    if load["curves"]:
        page.heading("The last dips, as those before them predict them", 3)
        page.charts([_draw_dip(curve) for curve in load["curves"]])
    with page.fold_blocks("every dip"):
        page.add(_tabulate_events(load))


def _tabulate_constants(load: Mapping[str, Any]) -> Table:
    rows = [
        [
            row["name"],
            row["value"],
            row["unit"],
            "{:.4g} .. {:.4g}".format(row["low"], row["high"]) if row["low"] is not None else "",
            _format_percent(row["spread"]),
        ]
        for row in load["constants"]
    ]
    columns = ["constant", "value", "unit", "95 % interval", "differs"]
    return Table(columns, rows, "what all dips share", CONSTANTS_CAPTION, words=(2, 3, 4))


def _draw_term(term: str, rows: Sequence[Mapping[str, Any]], what: str, factor: float) -> Chart:
    """A quantity by hour, weekday, month or year, with its interval."""
    first = 0.5 if term == HOUR else 1.0
    x = first + np.arange(len(rows))
    value = factor * np.array([row["value"] for row in rows])
    low = factor * np.array([row["low"] for row in rows])
    high = factor * np.array([row["high"] for row in rows])
    hover = [f"{row['at']}: {factor * row['value']:.4g}" for row in rows]
    chart = Chart(TERM_NAMES[term], [what], pixels=240, legend=False)
    chart.band("95 %", x, low, high, style.FAINT)
    chart.points("expected", x, value, style.ACTIVE, hover=hover)
    return chart


def _tabulate_events(load: Mapping[str, Any]) -> Table:
    unit = load["power"]["unit"]
    rows = [
        [
            event["event"],
            (event["when"] or "").replace("T", " ")[:16],
            f"{event['depth']:.0%}",
            event["P"],
            f"{event['share']:.1%}",
            f"{event['low']:.1%} .. {event['high']:.1%}",
            _format_percent(event["error"]),
            _format_percent(event["predicted"]),
            "left out" if event["odd"] else "",
        ]
        for event in load["events"]
    ]
    columns = [
        "dip",
        "when",
        "depth",
        f"P [{unit}]",
        "motors, of P",
        "95 % interval",
        "error",
        "predicted",
        "",
    ]
    return Table(columns, rows, "dips in order of time", words=(1, 2, 4, 5, 6, 7, 8))


def _draw_years(load: Mapping[str, Any]) -> Chart:
    """The errors with which each dip was predicted by those before it, and the motors' shares of P,
    over the years; by the dip's number where times are not known, or span less than a year.
    """
    events = load["events"]
    years = np.array([_compute_year(each["when"]) if each["when"] else np.nan for each in events])
    dated = bool(np.ptp(years) > LEAST_DATED_SPAN)  # nan is not
    x = years if dated else np.arange(1, len(events) + 1)
    label = "year" if dated else "dip, by its number"
    chart = Chart(label, ["error [%]", "motors, of P [%]"], pixels=460)
    if dated:
        chart.ticks(None, np.arange(np.floor(x.min()), np.ceil(x.max()) + 1).tolist())
    elif len(x) <= MOST_NUMBERED:
        chart.ticks(None, x.tolist())
    odd = np.array([bool(event["odd"]) for event in events])
    told = [f"{event['event']}, {event['known']} dips before it" for event in events]

    def add(
        name: str, key: str, some: np.ndarray, panel: int, color: str, symbol: str = "circle"
    ) -> None:
        values = np.array([event[key] for event in events], dtype=float)
        values = 100 * values
        here = np.flatnonzero(some & np.isfinite(values))
        hover = [f"{told[k]}: {values[k]:.3g} %" for k in here]
        chart.points(
            name,
            x[here],
            values[here],
            color,
            panel,
            symbol=symbol,
            hover=hover,
        )

    limits = 100 * find_limits([event["predicted"] for event in events], odd)
    chart.line("95 % of the dips before", x, limits, style.FAINT, 0, step=True)
    add("error as predicted", "predicted", ~odd, 0, style.ACTIVE)
    if odd.any():
        add("left out", "predicted", odd, 0, style.ACTIVE, "x")
    add("motors of each dip", "share", ~odd, 1, style.REACTIVE)
    add("motors expected", "expected", ~odd, 1, style.FAINT, "diamond-open")
    return chart


def find_limits(errors: Sequence[float | None], odd: np.ndarray) -> np.ndarray:
    """The error that 95 % of the dips predicted before each stayed below.

    Parameters
    ----------
    errors : E numbers
        Of dips in order of time; None of one that was not predicted.
    odd : (E,) bools
        Dips that set no limit.

    Returns
    -------
    (E,) array
        nan where none was predicted before.

    Examples
    --------
    >>> find_limits([None, 0.1, 0.3, 0.2], np.zeros(4, dtype=bool)).tolist()
    [nan, nan, 0.1, 0.3]
    """
    limits = np.full(len(errors), np.nan)
    seen: list[float] = []
    for k, error in enumerate(errors):
        if seen:
            limits[k] = np.quantile(seen, INTERVAL_LEVEL, method="higher")
        if error is not None and np.isfinite(error) and not odd[k]:
            seen.append(error)
    return limits


def _compute_year(when: str) -> float:
    """A moment as a year with its fraction."""
    moment = datetime.fromisoformat(when)
    return moment.year + (moment.timetuple().tm_yday - 1 + moment.hour / 24) / DAYS_A_YEAR


def _draw_dip(curve: Mapping[str, Any]) -> Chart:
    """U, P and Q of a dip, measured and predicted."""
    chart = Chart(
        "t from the dip's start [s]",
        ["U [pu]", "P [pu]", "Q [pu]"],
        heights=(0.6, 1.0, 1.0),
        pixels=420,
        title=f"{curve['event']}: {format_percent(curve['error'])} missed",
        legend=False,
    )
    t, U = (np.array(curve[key], dtype=float) for key in ("t", "U"))
    chart.line("U", t, U, style.VOLTAGE, 0)
    for panel, channel in enumerate("PQ", 1):
        measured = np.array(curve[channel], dtype=float)
        calculated = np.array(curve[f"{channel}_predicted"], dtype=float)
        chart.line("measured", t, measured, style.MEASURED, panel, width=3)
        chart.line("predicted", t, calculated, style.ACTIVE, panel)
    return chart
