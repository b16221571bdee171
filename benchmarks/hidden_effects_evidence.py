"""Rows of judgement sets as the tables and figures of the docs. Shares come with exact 95 % intervals."""

import itertools
import json
from collections.abc import Callable, Container, Iterable, Mapping, Sequence
from pathlib import Path

import marked
import numpy as np
import oracle  # noqa: F401

from hidden_effects.laws import MEMBERS_LAW

Rows = list[dict]
VERDICTS = ("none", "named", "tied", "unexplained")
FITTED = 3  # events, where nothing else is said
OTHERS = ("rotor_skin_effect", "stator_transients")  # orders of the model, which have no law of their own
BINS = ((0, 20), (20, 40), (40, 80), (80, np.inf))  # of the non-centrality that the best single effect leaves
MARK = "benchmarks/hidden_effects_study.py --docs"  # what makes the tables
NEWEST, EARLIER = "missing-effects.md", "earlier-judgements.md"  # the pages that hold them
_POWER, _STATIC = {"power", "power_P", "power_Q", "whole"}, {"static", "static_P", "static_Q"}
RIGHT = {  # of a stranger: balances and signals of a proposal that are called right, fixed before any seed was drawn;
    # "voltage" was no balance of the library before the set with near rivals
    "load_step": (_POWER, {"step"}),
    "two_load_steps": (_POWER, {"step"}),
    "subsynchronous_ring": ({"power", "power_P"}, {"ring"}),
    "tap_changer_step": (_POWER | {"voltage"}, {"step"}),
    "arc_load": (_POWER | _STATIC, {"power", "knee", "knee_squared", "below"}),
    "voltage_gain_drift": (_POWER | {"voltage"}, {"ramp"}),
    "harmonic_ripple": (_POWER, {"ring"}),
    "current_transformer_saturation": (_POWER | {"motor"}, {"current", "current_squared"}),
    "phase_jump": ({"angle"}, {"power", "knee", "knee_squared", "below", "lag"}),
    "voltage_rate": (_POWER | _STATIC, {"rate"}),
}
_FIRST = ("of the first", "frozen anew")  # no member had a law of its own
_TWO = (*_FIRST, "with more members", "ten of each")
SINCE = {  # laws of members that came after these sets
    "thermostat_recovery": _TWO,
    "switched_capacitors": _TWO,
    "staged_power_limit": (*_TWO, "nearby families"),
    "link_voltage_control": (*_TWO, "nearby families"),
}
CLOSES = 0.8  # of the gap on the held-out event, by a proposal


def read(path: Path) -> Rows:
    """The rows of a study."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def mark(what: str = "") -> str:
    """Where the tables of a set stand: of the newest, or of that in which `what` is new."""
    return f"{MARK}, {what}" if what else MARK


def tables(rows: Rows, what: str = "") -> str:
    """The tables of a set, Markdown: of the newest with times and figures, or of that in which `what` is new.

    Laws that a member of a family was built to tell stand apart from others.
    """
    known = {law for law in MEMBERS_LAW if what not in SINCE.get(law, _FIRST)}
    good, usual = [r for r in rows if "failed" not in r], _usual(rows)
    failed, when = len(rows) - len(good), what and f", {what}"
    parts = [
        f"{len(rows)} data sets" + (f", of which {failed} could not be made or investigated." if failed else "."),
        *(_table(title + when, head, lines) for title, head, lines in (
            _false_alarms(usual), _singles(usual), _laws(usual, known), _each_law(usual), _events(good),
            _abstention(usual), _proposals(usual), _pairs(usual), _sizes(usual), _seconds([] if what else usual),
        ) if lines),
        *(() if what else (f"![{told}]({_path(name)})" for name, told in _figures(usual).items())),
    ]  # fmt: skip
    return "\n\n".join(parts)


def _usual(rows: Rows) -> Rows:
    """What was investigated with the usual number of events."""
    return [r for r in rows if "failed" not in r and fitted(r) == FITTED]


def _path(name: str) -> str:
    return f"images/missing-effects-{name}.svg"


def _figures(rows: Rows) -> dict[str, str]:
    """The figures that these rows give, with what they show."""
    shown = {"detection": "Share of data sets in which something was found"} if len(_multiples(rows)) > 1 else {}
    return shown | {"confusion": "What was said of what was hidden"}


def _multiples(rows: Rows) -> list[float]:
    """Detection limits at which single effects of the catalogue are hidden."""
    return [m for m in (0.5, 1.0, 2.0, 4.0, 8.0) if any(r["group"] == f"{m:g} x" and reached(r, m) for r in rows)]


def write(sets: Mapping[str, Rows], docs: Path) -> None:
    """Put the tables of all sets between their marks, the figures of the newest, which is the last, into images/."""
    *earlier, newest = sets
    for what in earlier:
        marked.replace(docs / EARLIER, mark(what), tables(sets[what], what))
    marked.replace(docs / NEWEST, mark(), tables(sets[newest]))
    usual = _usual(sets[newest])
    for name in _figures(usual):
        {"detection": _draw_detection, "confusion": _draw_confusion}[name](usual, docs / _path(name))


def share(right: int, of: int) -> str:
    """A percentage with its exact 95 % interval. Source: Clopper and Pearson 1934."""
    from scipy.stats import binomtest

    if not of:
        return "-"
    low, high = binomtest(right, of).proportion_ci(0.95, "exact")
    return f"{right / of:.1%} ({low:.0%}-{high:.0%})" if of < 1000 else f"{right / of:.1%}"


def fitted(row: dict) -> int:
    """Number of events fitted."""
    return row["events"] - row["held"]


def _table(title: str, head: Sequence[str], lines: Sequence[Sequence[object]]) -> str:
    rows = ["| " + " | ".join(map(str, line)) + " |" for line in (head, ["---"] * len(head), *lines)]
    return f"### {title}\n\n" + "\n".join(rows)


def _groups(rows: Rows, start: str) -> dict[str, Rows]:
    found: dict[str, Rows] = {}
    for row in rows:
        if row["group"].startswith(start):
            found.setdefault(row["group"], []).append(row)
    return found


def _rank(row: dict, price: Callable[[int, int], float]) -> str:
    """The effect that a criterion picks by the drop of the deviance less a price; "" where it picks none."""
    gain = {n: d - price(row["parameters"][n], row["samples"]) for n, d in row["drops"].items()}
    best = max(gain, key=gain.__getitem__, default="")
    return best if best and gain[best] > 0 else ""


def aic(row: dict) -> str:
    """What Akaike's criterion picks."""
    return _rank(row, lambda k, n: 2 * k)


def bic(row: dict) -> str:
    """What Schwarz's criterion picks."""
    return _rank(row, lambda k, n: k * np.log(n))


def rmse(row: dict) -> str:
    """What leaves the smallest error."""
    return _rank(row, lambda k, n: 0.0)


def sparse(row: dict) -> str:
    """What sparse regression keeps; several as one name, which is nobody's."""
    return " + ".join(row["sparse"])


PICKS = {"AIC": aic, "BIC": bic, "RMSE": rmse, "STLSQ": sparse}


def wrong(row: dict) -> bool:
    """Whether one set was named and it is not the truth."""
    return row["verdict"] == "named" and sorted(row["names"]) != row["truth"]


def right(row: dict) -> bool:
    """Whether the truth alone was named."""
    return row["verdict"] == "named" and sorted(row["names"]) == row["truth"]


def in_set(row: dict) -> bool:
    """Whether the truth is among the sets that were not rejected."""
    return row["truth"] in [sorted(s) for s in row["sets"]]


def _false_alarms(rows: Rows) -> tuple[str, list[str], list]:
    lines, everything = [], []
    for group, members in _groups(rows, "null").items():
        if "nuisances" not in group:
            everything += members
        lines.append([group.removeprefix("null, "), *_alarms(members)])
    if everything:
        lines.append(["all but those with nuisances", *_alarms(everything)])
    head = ["noise", "data sets", "anything said", "a name among it", *(f"{pick} names one" for pick in PICKS)]
    return "Nothing is missing", head, lines


def _alarms(members: Rows) -> list[str]:
    """Nuisances that are there may be named: they are the truth of their data sets."""
    n, chain = len(members), {"time_skew", "measurement_window", "load_drift"}
    allowed = chain if members[0]["group"] == "null with nuisances" else set()
    said = [r for r in members if r["verdict"] != "none" and not (r["names"] and set(r["names"]) <= allowed)]
    named = sum(r["verdict"] in ("named", "tied") for r in said)
    picks = [share(sum(bool(pick(r)) for r in members), n) for pick in PICKS.values()]
    return [str(n), share(len(said), n), share(named, n), *picks]


def _singles(rows: Rows) -> tuple[str, list[str], list]:
    lines = []
    for multiple in (0.5, 1.0, 2.0, 4.0, 8.0):
        members = [r for r in _groups(rows, f"{multiple:g} x").get(f"{multiple:g} x", []) if reached(r, multiple)]
        if not members:
            continue
        n = len(members)
        found = [r for r in members if r["verdict"] in ("named", "tied")]
        said = [r for r in members if r["verdict"] != "none"]
        unique = [r for r in members if r["verdict"] == "named"]
        held = np.array([r["closed_true"] for r in members if right(r) and r.get("closed_true") is not None])
        placed = [r for r in said if r["places"]]
        lines.append([
            f"{multiple:g}", n, share(len(said), n), share(len(unique), n), share(sum(map(right, unique)), len(unique)),
            share(sum(map(in_set, found)), len(found)), share(len(said) - len(found), n),
            *(share(sum([pick(r)] == r["truth"] for r in members), n) for pick in PICKS.values()),
            f"{np.median(held):.1%}, {np.mean(held >= 0.95):.0%}" if len(held) else "-",
            share(sum(r["places_true"] > 0 for r in placed), len(placed)),
        ])  # fmt: skip
    head = [
        "times the limit", "data sets", "disagreement found", "one name", "of these right", "truth among the names",
        "unexplained", *(f"{pick} right" for pick in PICKS),
        "gap closed on the held-out event: median, at least 95 %", "a place found is true",
    ]  # fmt: skip
    return "One effect is missing", head, lines


def _laws(rows: Rows, known: Container[str]) -> tuple[str, list[str], list]:
    lines = []
    full = [r for r in rows if reached(r, 4.0) and r["label"] not in OTHERS]
    by_law = {
        "the catalogue's": [r for r in full if r["group"] == "4 x"],
        "that of a member": [r for r in full if r["group"] == "law 4 x" and r["label"] in known],
        "another": [r for r in full if r["group"] == "law 4 x" and r["label"] not in known],
    }
    for law, members in by_law.items():
        if members:
            n, unique = len(members), [r for r in members if r["verdict"] == "named"]
            told = [r for r in members if r["verdict"] in ("named", "tied")]
            lines.append([
                law, n, share(len(unique), n), share(sum(map(right, unique)), len(unique)),
                share(sum(map(in_set, told)), len(told)),
                *(share(sum(r["verdict"] == v for r in members), n) for v in ("tied", "unexplained", "none")),
                *(share(sum([pick(r)] == r["truth"] for r in members), n) for pick in PICKS.values()),
            ])  # fmt: skip
    head = ["law", "data sets", "one name", "of these right", "truth among the names", "tied", "unexplained", "none",
            *(f"{pick} right" for pick in PICKS)]  # fmt: skip
    return "The same effect by another law, 4 times the limit", head, lines


def _each_law(rows: Rows) -> tuple[str, list[str], list]:
    lines = []
    for label in dict.fromkeys(r["label"] for r in rows if r["group"].startswith("law")):
        members = [r for r in rows if r["group"].startswith("law") and r["label"] == label]
        others = sorted({" + ".join(r["names"]) for r in members if wrong(r)})
        lines.append([
            label, members[0]["truth"][0], len(members), sum(map(right, members)), ", ".join(others) or "-",
            *(sum(r["verdict"] == v for r in members) for v in ("tied", "unexplained", "none")),
        ])  # fmt: skip
    head = ["hidden", "its family", "data sets", "family named", "another name", "tied", "unexplained", "none"]
    return "Each of those laws", head, lines


def _proposals(rows: Rows) -> tuple[str, list[str], list]:
    def line(what: str, members: Rows) -> list:
        made = [r for r in members if r["proposal"]]
        true = [r for r in made if r["label"] in RIGHT and _is_right(r)]
        closing = [r for r in true if r["proposal"]["closed"]["validate"] >= CLOSES]
        n = len(members)
        return [what, n, share(len(made), n), share(len(true), n) if what.startswith("outside") else "-",
                share(len(closing), n) if what.startswith("outside") else "-"]  # fmt: skip

    strangers = [r for r in rows if r["group"].startswith("outside") and "lambda_left" in r]
    sorts = {
        "outside the catalogue, above 80": [r for r in strangers if r["lambda_left"] >= 80],
        "outside the catalogue, below 80": [r for r in strangers if r["lambda_left"] < 80],
        "another law, not named": [r for r in rows if r["group"].startswith("law") and r["verdict"] != "named"],
        "nothing, or one name": [r for r in rows if r["group"].startswith("null") or r["verdict"] == "named"],
    }
    head = ["hidden", "data sets", "a term is proposed", "in the right balance, by the right signal",
            f"and closes {CLOSES:.0%} on the held-out event"]  # fmt: skip
    return "Terms proposed", head, [line(what, members) for what, members in sorts.items() if members]


def _is_right(row: dict) -> bool:
    balances, signals = RIGHT[row["label"]]
    return row["proposal"]["balance"] in balances and row["proposal"]["signal"] in signals


def _events(rows: Rows, multiple: float = 4.0) -> tuple[str, list[str], list]:
    lines = []
    for count in sorted({fitted(r) for r in rows}):
        members = [r for r in rows if r["group"] == f"{multiple:g} x" and fitted(r) == count and reached(r, multiple)]
        if members:
            n, unique = len(members), [r for r in members if r["verdict"] == "named"]
            verdicts = [share(sum(r["verdict"] == v for r in members), n) for v in ("named", "tied", "unexplained")]
            known = [r for r in members if r["verdict"] in ("named", "tied")]
            lines.append([
                count, n, verdicts[0], share(sum(map(right, unique)), len(unique)), verdicts[1],
                share(sum(map(in_set, known)), len(known)), verdicts[2],
            ])  # fmt: skip
    head = ["events fitted", "data sets", "one name", "of these right", "tied", "truth among the names", "unexplained"]
    return f"Fewer events, {multiple:g} times the limit of their own", head, lines


def reached(row: dict, multiple: float) -> bool:
    """Whether the effect could be made this many limits large."""
    return all(m >= 0.9 * multiple for m in row["multiples"]) and not set(row["untestable"]) & set(row["truth"])


def _abstention(rows: Rows) -> tuple[str, list[str], list]:
    lines = []
    for what, start in (("outside the catalogue", "outside"), ("left out of it", "left out")):
        members = [r for rs in _groups(rows, start).values() for r in rs if "lambda_left" in r]
        for low, high in BINS:
            inside = [r for r in members if low <= r["lambda_left"] < high]
            if inside:
                span = f"{low:g} to {high:g}" if np.isfinite(high) else f"above {low:g}"
                counts = [share(sum(r["verdict"] == v for r in inside), len(inside)) for v in VERDICTS]
                lines.append([what, span, len(inside), counts[3], counts[0], counts[2], counts[1]])
    head = ["effect", "non-centrality left by the best single effect", "data sets", "unexplained", "none", "tied",
            "one wrong name"]  # fmt: skip
    return "The missing effect is not in the catalogue", head, lines


def _pairs(rows: Rows) -> tuple[str, list[str], list]:
    lines = []
    for group, members in _groups(rows, "pairs").items():
        multiple = float(group.split()[1])
        full = [r for r in members if reached(r, multiple)]
        if full:
            n = len(full)
            partly = sum(r["verdict"] == "named" and set(r["names"]) < set(r["truth"]) for r in full)
            lines.append([
                group.split()[1], n, share(sum(map(right, full)), n), share(sum(map(in_set, full)), n),
                share(partly, n), share(sum(r["verdict"] == "unexplained" for r in full), n),
                share(sum(wrong(r) and not set(r["names"]) < set(r["truth"]) for r in full), n),
            ])  # fmt: skip
    head = ["times their joint limit", "data sets", "exactly the pair", "the pair among the sets", "one of the two",
            "unexplained", "another name"]  # fmt: skip
    return "Two effects are missing", head, lines


def _sizes(rows: Rows) -> tuple[str, list[str], list]:
    lines = []
    for name in sorted({r["label"] for r in rows if "estimate" in r}):
        members = [r for r in rows if r["label"] == name and "estimate" in r and r["error"]]
        off = np.array([(r["estimate"] - r["amount"]) / r["error"] for r in members])
        relative = np.array([r["estimate"] / r["amount"] - 1 for r in members])
        if len(off) >= 5:
            lines.append([name, len(off), f"{np.sqrt(np.mean(off**2)):.2f}", f"{np.median(off):+.2f}",
                          share(int(np.sum(np.abs(off) < 1.96)), len(off)), f"{np.median(relative):+.1%}"])  # fmt: skip
    head = ["effect", "data sets", "RMSE over standard error", "median of error over standard error",
            "95 % interval holds the truth", "median relative error"]  # fmt: skip
    return "How large it is", head, lines


def _seconds(rows: Rows) -> tuple[str, list[str], list]:
    lines = []
    for verdict in VERDICTS:
        spent = np.array([r["seconds"] - r.get("generated", 0.0) for r in rows if r["verdict"] == verdict])
        if len(spent):
            lines.append([verdict, len(spent), f"{np.median(spent):.1f}", f"{np.quantile(spent, 0.9):.1f}"])
    return "Seconds of an investigation, one core each", ["verdict", "data sets", "median", "90 %"], lines


def _draw_detection(rows: Rows, path: Path) -> None:
    """Share of data sets in which something was found, over how many detection limits were hidden."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    from tractexp.blocks import style

    x = _multiples(rows)
    with rc_context(style.SETTINGS):
        figure = Figure(figsize=(6.4, 3.4), layout="constrained")
        axes = figure.subplots()
        members = [[r for r in rows if r["group"] == f"{m:g} x" and reached(r, m)] for m in x]
        for label, color, count in (
            ("a disagreement is found", style.REACTIVE, lambda r: r["verdict"] != "none"),
            ("the truth is among the names", style.ACTIVE, in_set),
            ("the truth is the one name", style.VOLTAGE, right),
        ):
            axes.plot(x, [100 * np.mean([*map(count, rs)]) for rs in members], "o-", color=color, label=label)
        fine = np.geomspace(0.5, 8, 60)
        axes.plot(fine, 100 * _power(fine), "--", color=style.FAINT, label="best possible: likelihood-ratio test")
        axes.set(xscale="log", xticks=x, xticklabels=[f"{m:g}" for m in x], ylim=(0, 103))
        axes.set(xlabel="times the detection limit", ylabel="share of data sets [%]")
        axes.minorticks_off()
        axes.legend(loc="lower right")
        style.save(figure, path)


def _power(multiple: np.ndarray) -> np.ndarray:
    """Power of the two-sided test at the level of one of 20, where 1 has a power of 0.9."""
    from scipy.stats import norm

    z = norm.isf(0.05 / 40)
    return norm.cdf(multiple * (z + norm.isf(0.1)) - z)


def _draw_confusion(rows: Rows, path: Path, multiple: float = 4.0) -> None:
    """What was said (columns) of what was hidden (rows), in percent, at four times the limit or as large as may be."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    from tractexp.blocks import style

    groups = [f"{sort}{multiple:g} x" for sort in ("", "law ", "outside ")]
    blocks = [list(dict.fromkeys(_hidden(r) for r in rows if r["group"] == group)) for group in groups]
    names, labels = blocks[0], list(itertools.chain(*blocks))
    members = [r for r in rows if r["group"] in groups]
    said = [*names, "several at once", "tied, truth among", "tied, truth not", "unexplained", "none"]
    table = np.zeros((len(labels), len(said)))
    for r in members:
        table[labels.index(_hidden(r)), said.index(_column(r, names))] += 1
    table *= 100 / np.maximum(table.sum(axis=1, keepdims=True), 1)
    with rc_context({**style.SETTINGS, "axes.grid": False}):
        figure = Figure(figsize=(8.6, 11.0), layout="constrained")
        axes = figure.subplots()
        axes.imshow(table, cmap="Blues", vmin=0, vmax=130, aspect="auto")
        for (i, j), value in np.ndenumerate(table):
            if value:
                axes.text(j, i, f"{value:.0f}", ha="center", va="center", fontsize=7)
        axes.set_xticks(range(len(said)), [s.replace("_", " ") for s in said], rotation=90)
        axes.set_yticks(range(len(labels)), [s.replace("_", " ") for s in labels])
        for end in itertools.accumulate(map(len, blocks[:-1])):
            axes.axhline(end - 0.5, color=style.FAINT, linewidth=0.8)
        axes.axvline(len(names) - 0.5, color=style.FAINT, linewidth=0.8)
        axes.set(xlabel="said", ylabel="hidden: the catalogue's law, another law, not in the catalogue")
        axes.set_title(f"percent of the data sets of each row, {multiple:g} times the detection limit")
        style.save(figure, path)


def _hidden(row: dict) -> str:
    """What a row of the figure is called: an effect of the catalogue by its name there."""
    return row["truth"][0] if row["group"][0].isdigit() else row["label"]


def _column(row: dict, names: Iterable[str]) -> str:
    if row["verdict"] == "named":
        return row["names"][0] if len(row["names"]) == 1 and row["names"][0] in names else "several at once"
    if row["verdict"] == "tied":
        return "tied, truth among" if in_set(row) else "tied, truth not"
    return row["verdict"]
