"""The page of an identification, to be read in a minute: what was found, how sure, how well it fits, what next."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tractexp.identification.uncertainty import Together, Uncertainty
from tractexp.identification.verdict import BOUND, IDENTIFIED
from tractexp.report.page import Page


def digits(value: float) -> str:
    return f"{value:.4g}"


def rows(known: Uncertainty, units: dict[str, str]) -> list[list[str]]:
    """One row for each free parameter: name, most likely value, unit, interval, standard error, verdict."""
    table = []
    errors = known.information.standard_errors
    for j, name in enumerate(known.names):
        low, high = known.intervals[j]
        error = digits(errors[j]) if errors[j] < float("inf") else "none"
        unit = units.get(name.partition("[")[0], "")
        table.append(
            [name, digits(known.values[j]), unit, f"{digits(low)} .. {digits(high)}", error, str(known.verdicts[name])]
        )
    return table


def headline(known: Uncertainty) -> str:
    """How many of the parameters are identified, and which are not, in one sentence."""
    poor = [f"{name} {v.word}" for name, v in known.verdicts.items() if v.word != IDENTIFIED]
    good = len(known.verdicts) - len(poor)
    return f"{good} of {len(known.verdicts)} parameters are identified" + (f"; {', '.join(poor)}" if poor else "") + "."


def page(
    result: Any,
    known: Uncertainty,
    together: Together | None,
    advice: Sequence[str],
    fits: Sequence[Path],
    correlation: Path,
    residuals: Path,
) -> Page:
    """The whole page; the paths are figures to be drawn into it."""
    names = ", ".join(e["name"] for e in result.events if e["role"] == "train")
    made = Page(f"Identification of {names}", f"{result.optimizer}, seed {result.seed}; the search {result.status}.")
    holds = "holds" if result.acceptable else "does not hold"
    errors = f"epsilon_p {result.epsilon_p:.2%}, epsilon_q {result.epsilon_q:.2%}"
    acceptance = f"Acceptance of Eq. (20), below 5 %, {holds}: {errors}."
    sound = result.acceptable and not known.notes and not any(v.word == BOUND for v in known.verdicts.values())
    made.verdict(headline(known), acceptance, *(f"{note}." for note in result.uncertainty["notes"]),
                 kind="good" if sound else "bad")  # fmt: skip
    made.heading("Parameters")
    made.table(
        ["parameter", "most likely", "unit", "95 % interval", "standard error", "verdict"],
        rows(known, result.units),
        caption="Most likely: colored noise whitened, the power before the dip left free. The search's own values,"
        " which minimize the objective, are below.",
        words=(5,),
    )
    made.heading("What to do next").items(advice)
    if together is not None:
        _events(made, known, together)
    made.heading("Fit")
    for path in fits:
        made.figure(path)
    made.heading("What the fit leaves").figure(residuals)
    made.table(
        ["event", "channel", "test", "statistic", "p", "says"],
        [
            [t["event"], t["channel"], t["name"], digits(t["statistic"]), f"{t['p']:.2g}", t["says"]]
            for t in known.tests
        ],
        caption="Of the residuals after whitening; below p = 0.01 a test speaks.",
        words=(1, 2, 5),
    )
    made.table(
        ["event", "channel", "noise [pu]", "before the dip [pu]", "order", "neighbors' correlation"],
        [
            [n["event"], n["channel"], digits(n["deviation"]), digits(n["before"]), str(n["order"]),
             f"{n['correlation']:.2f}"]
            for n in known.noise
        ],
        caption="Noise model of each channel: an autoregression of the residual, its order chosen by AICc.",
        words=(1,),
    )  # fmt: skip
    made.heading("How the estimates depend on each other").figure(
        correlation,
        "Correlation. Two parameters near +1 or -1 trade against each other: the record knows a combination.",
    )
    with made.folded("Values that minimize the objective, Eq. (8)"):
        made.table(
            ["parameter", "value", "unit", "bounds"],
            [
                [name, digits(value), result.units[name], f"{result.bounds[name][0]:g} .. {result.bounds[name][1]:g}"]
                for name, value in result.parameters.items()
            ],
            caption=f"objective {result.objective:.4g} pu², {result.simulations} simulations, {result.seconds:.2f} s",
        )
    return made


def _events(made: Page, known: Uncertainty, together: Together) -> None:
    """What each event of a joint fit adds, and which does not belong."""
    made.heading("What each event adds")
    if together.notes:
        made.verdict(*(f"{note}." for note in together.notes), kind="bad")
    made.table(
        ["without", *known.names],
        [[event, *(_wider(gain[n]) for n in known.names)] for event, gain in together.gains.items()],
        caption="How many times as wide each 95 % interval would be without the event.",
    )


def _wider(ratio: float) -> str:
    return f"{ratio:.2f}" if ratio < 1000 else "not identifiable"
