"""The page of an identification, to be read in a minute: what it is good for, what was found, how
sure, what next.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.blocks import Report, style
from tractexp.blocks.chart import Chart
from tractexp.configuration.run_command import get_command
from tractexp.identification.result import name_by_event
from tractexp.identification.search import REFUSED, History
from tractexp.identification.uncertainty import Uncertainty
from tractexp.identification.verdict import IDENTIFIED, TRADES
from tractexp.inference.residual_tests import LAGS, REJECTED, compute_autocorrelation
from tractexp.record.identity import compose_title, describe_identities
from tractexp.report.fit_sentences import describe_rivals, describe_search_end
from tractexp.report.fit_summary import (
    describe_machine,
    describe_samples,
    describe_yardstick,
    write_headline,
)
from tractexp.report.fit_tables import (
    format_digits,
    list_origin,
    tabulate_model_errors,
    tabulate_parameters,
    tabulate_search_end,
)
from tractexp.report.fitted_curves import MOST_OPEN_EVENTS, ROLES, add_curves, add_next_dip
from tractexp.report.race import tabulate_race
from tractexp.report.sliders import add_sliders
from tractexp.text.wording import finish_sentence, format_probability

if TYPE_CHECKING:
    from tractexp.api.identification import Identification

KIND = {"adequate": "good", "effect_missing": "plain", "wrong_model": "bad"}
CHANNELS = (style.ACTIVE, style.REACTIVE, style.PALETTE[2])  # of what is compared
SHARES_HELD = (
    "The motors' share held, all else fitted again: by how much more the fit then leaves than the"
    " best does."
)
SAME_END_SHARE = 0.01  # of the deviance: starts closer than this ended in the same place


def report(fit: "Identification") -> Report:
    """The page: what the summary says, and what one sees of it."""
    result, details = fit.result, fit.details
    uncertainty, together = details.uncertainty, details.agreement
    names, of = [e["name"] for e in result.events if e["role"] == "train"], result.identities
    lead = "; ".join([*describe_identities(of), f"{result.optimizer}, seed {result.seed}."])
    page = Report(f"Identification of {compose_title(of, names)}", lead)
    page.verdict(
        finish_sentence(fit.usability_sentence),
        *describe_yardstick(fit),
        f"{finish_sentence(result.acceptance)}{_describe_current_errors(result)}",
        write_headline(result),
        kind=KIND[fit.grade],
    )
    page.heading("Measured and calculated")
    add_curves(page, details.fits, uncertainty, fit.spec.validate)
    add_next_dip(page, fit)
    page.heading("Parameters").add(tabulate_parameters(fit)).text(
        *map(finish_sentence, describe_machine(fit))
    )
    if result.share_bound:
        page.chart(_draw_shares(result.share_bound["profile"]), SHARES_HELD)
    _add_parameters(page, fit, uncertainty)
    page.add(*tabulate_race(result.race))
    page.heading("Moved by hand")
    add_sliders(page, fit)
    page.heading("How well it fits").add(tabulate_model_errors(fit)).text(
        *map(finish_sentence, describe_samples(fit))
    )
    page.heading("What to do next").items(fit.advice)
    if together is not None:
        _add_events(page, uncertainty, together)
    page.heading("The search and the estimate").add(tabulate_search_end(fit)).text(
        finish_sentence(describe_search_end(fit))
    )
    page.chart(
        _chart_fitness(fit.search_result.history, result),
        "Best objective of the search; dashed: the estimate's.",
    )
    _add_starts(page, details.estimation.starts)
    page.heading("What the fit leaves")
    _add_residual_section(page, uncertainty)
    page.heading("How the estimates depend on each other")
    _add_correlations(page, uncertainty)
    page.heading("How this page was made")
    return page.table(["", ""], list_origin(result, get_command()), words=(1,))


def _draw_shares(profile: Sequence[dict[str, float]]) -> Chart:
    """The error of a fit whose motors' share is held, over the least, by share."""
    shares, errors = (np.array([row[key] for row in profile]) for key in ("share", "error"))
    chart = Chart("motors, of P [%]", ["error, over the least"], pixels=260)
    return chart.line("all else free", 100 * shares, errors, style.ACTIVE, width=2.0)


def _describe_current_errors(result: Any) -> str:
    """epsilon_i of each event, in a sentence; "" in phasors."""
    values = [
        f"{e['epsilon_i']:.2%} ({e['name']}, {ROLES[e['role']]})"
        for e in result.events
        if "epsilon_i" in e
    ]
    return f" Of the currents themselves epsilon_i is {', '.join(values)}." if values else ""


def _add_parameters(page: Report, fit: "Identification", uncertainty: Uncertainty) -> None:
    """The base of the values, a picture against the bounds, and what rivals make of
    the parameters.
    """
    result = fit.result
    if on_given_base := result.on_given_base():
        base = f"Values and bounds in the table are on the record's own base of {result.base}."
        page.text(f"{finish_sentence(on_given_base)} {base}")
    page.chart(
        _chart_estimates(
            uncertainty, name_by_event(result.search["parameters"], result.search["per_event"])
        ),
        "Estimates and 95 % intervals within the bounds of each parameter (0 is the lower, 1 the"
        " upper bound); cross: where the search ended.",
    )
    nuisances = result.nuisances
    verdicts = uncertainty.verdicts.items()
    poor = [
        f"{name}: {v}." for name, v in verdicts if v.word != IDENTIFIED and name not in nuisances
    ]
    page.items([*map(finish_sentence, describe_rivals(fit)), *poor])


def _chart_estimates(uncertainty: Uncertainty, search: dict[str, float]) -> Chart:
    """Estimates and intervals in their bounds, beside where the search ended."""
    lower, width = uncertainty.lower, uncertainty.upper - uncertainty.lower
    at, spans = (
        (uncertainty.values - lower) / width,
        (uncertainty.intervals - lower[:, None]) / width[:, None],
    )
    sentences = [
        f"{n}: {format_digits(v)}, {format_digits(a)} .. {format_digits(b)}"
        for n, v, (a, b) in zip(
            uncertainty.names, uncertainty.values, uncertainty.intervals, strict=True
        )
    ]
    ended = (np.array([search[n] for n in uncertainty.names]) - lower) / width
    chart = Chart("between the bounds", [""], pixels=110 + 34 * len(uncertainty.names))
    chart.points(
        "estimate and 95 % interval",
        at,
        uncertainty.names,
        style.PALETTE[0],
        size=9,
        hover=sentences,
        spans=spans,
    )
    chart.points(
        "search",
        ended,
        uncertainty.names,
        style.PALETTE[1],
        symbol="x",
        size=8,
        hover=[f"{n}: search ended at {format_digits(search[n])}" for n in uncertainty.names],
    )
    return chart.limits(None, -0.02, 1.02).limits(0, len(uncertainty.names) - 0.5, -0.5)


def _chart_fitness(history: History, result: Any) -> Chart:
    """The best objective [pu²] by simulations."""
    valid = history.objective < REFUSED
    chart = Chart("simulations", ["best objective [pu²]"], log_y=True, pixels=300)
    best = np.maximum(history.objective[valid], 1e-30)
    chart.line(
        result.optimizer or "search", history.simulations[valid], best, style.PALETTE[0], step=True
    )
    return chart.level(max(result.objective, 1e-30), "estimate")


def _add_starts(page: Report, starts: Sequence[Mapping[str, Any]]) -> None:
    """Where each descent to the estimate ended."""
    above = np.maximum([s["above"] for s in starts], SAME_END_SHARE)
    chart = Chart("rank of the start", ["deviance above the best"], log_y=True, pixels=280)
    looks = {
        "search": ("x", style.PALETTE[1]),
        "box": ("circle", style.PALETTE[0]),
        "beside the best": ("diamond", style.PALETTE[2]),
    }
    for origin, (symbol, color) in looks.items():
        at = [k for k, s in enumerate(starts) if s["from"] == origin]
        sentences = [
            f"{origin}: "
            + ", ".join(f"{n} {format_digits(v)}" for n, v in starts[k]["parameters"].items())
            for k in at
        ]
        if at:
            chart.points(
                origin, [k + 1 for k in at], above[at], color, symbol=symbol, hover=sentences
            )
    valleys = 1 + int(np.sum(np.diff([s["above"] for s in starts]) > 1.0))
    page.chart(
        chart,
        f"Descents of the likelihood from {len(starts)} starts ended at {valleys} heights; those at"
        " the lowest are the estimate's valley. A difference of 3.8 is what a 95 % interval spans.",
    )
    with page.fold_blocks("where each start ended"):
        page.table(
            ["from", "above the best", *starts[0]["parameters"]],
            [
                [s["from"], f"{s['above']:.3g}", *map(format_digits, s["parameters"].values())]
                for s in starts
            ],
        )


def _add_residual_section(page: Report, uncertainty: Uncertainty) -> None:
    """Whitened residuals, their autocorrelation, and what the tests of them say."""
    likelihood, tests = uncertainty.of_noise, uncertainty.tests
    drive, events = likelihood.problem.drive, likelihood.problem.events
    # measured less calculated, as in the charts of power
    white = -uncertainty.whitened_residual.reshape(drive.channels, -1)
    colored = [t for t in tests if t["p"] < REJECTED]
    page.text(_conclude_tests(colored, len(tests)))
    for e, event in enumerate(events[:MOST_OPEN_EVENTS]):
        part = drive.part(e)
        compared = [c for c in range(drive.channels) if likelihood.valid[c, part].any()]
        chart = Chart("t [s]", [f"{drive.names[c]} [σ]" for c in compared], pixels=320)
        lags = Chart("lag [samples]", ["autocorrelation"], pixels=320)
        for panel, c in enumerate(compared):
            name, color, seen = drive.names[c], CHANNELS[c], likelihood.valid[c, part]
            rows = white[c, part][seen]
            chart.line(name, event.record.t[seen], rows, color, panel, width=0.8)
            x = np.arange(1, min(LAGS, len(rows) // 4) + 1)
            lags.points(name, x + 0.2 * c, compute_autocorrelation(rows, len(x)), color, size=5)
            limit = 1.96 / np.sqrt(max(len(rows), 1))
            lags.level(limit).level(-limit)
        caption = (
            f"{event.record.name}: measured less calculated, whitened, in standard deviations of"
            " the noise."
        )
        page.chart(chart.edge(event.t_start).edge(event.t_end), caption)
        page.chart(
            lags, "Autocorrelation of the whitened residual; between the dashed lines is chance."
        )
    with page.fold_blocks("tests of the residuals, and the noise"):
        page.table(
            ["event", "channel", "test", "statistic", "p", "says"],
            [
                [
                    t["event"],
                    t["channel"],
                    t["name"],
                    format_digits(t["statistic"]),
                    format_probability(t["p"]),
                    t["says"],
                ]
                for t in tests
            ],
            caption=f"Of the residuals after whitening; below p = {REJECTED} a test speaks.",
            words=(1, 2, 4, 5),
        )
        page.table(
            [
                "event",
                "channel",
                "noise [pu]",
                "before the dip [pu]",
                "order",
                "neighbors' correlation",
                f"correlation of {drive.names[0]} and {drive.names[1]}",
            ],
            [
                [
                    n["event"],
                    n["channel"],
                    format_digits(n["deviation"]),
                    format_digits(n["before"]),
                    str(n["order"]),
                    f"{n['correlation']:.2f}",
                    f"{n['between_P_and_Q']:.2f}",
                ]
                for n in uncertainty.noise
            ],
            caption="Noise of each channel, told from what the fit leaves before the dips and at"
            " the end of the records: an autoregression of the channels mixed until they are"
            " independent.",
            words=(1,),
        )


def _conclude_tests(speaking: Sequence[dict[str, Any]], tests: int) -> str:
    """The verdict of the tests on the residual, in a sentence."""
    if not tests:
        return "There are too few samples to test what is left."
    if not speaking:
        return (
            f"None of {tests} tests finds anything but noise in what is left: it is white and"
            " normal."
        )
    said = sorted({f"{t['channel']} of {t['event']} is {t['says']}" for t in speaking})
    return (
        f"{len(speaking)} of {tests} tests find more than noise in what is left: {'; '.join(said)}."
    )


def _add_correlations(page: Report, uncertainty: Uncertainty) -> None:
    """The strongest correlations in words, all of them as a table."""
    names, matrix = uncertainty.names, uncertainty.information.correlation
    pairs = [(abs(matrix[i, j]), i, j) for i in range(len(names)) for j in range(i)]
    strong = [
        f"{names[j]} and {names[i]} ({matrix[i, j]:+.3f})"
        for r, i, j in sorted(pairs, reverse=True)
        if r >= TRADES
    ]
    page.text(
        "These trade against each other, so that the record knows a combination of them:"
        f" {', '.join(strong)}."
        if strong
        else "No two parameters trade against each other."
    )
    page.table(
        ["correlation", *names],
        [
            [n, *(f"{r:+.3f}" for r in row[:k]), *[""] * (len(names) - k)]
            for k, (n, row) in enumerate(zip(names, matrix, strict=True), start=1)
        ],
    )


def _add_events(page: Report, uncertainty: Uncertainty, together: Mapping[str, Any]) -> None:
    """Add what each event of a joint fit contributes, and which does not belong."""
    page.heading("What each event adds")
    if together["notes"]:
        page.verdict(*(f"{note}." for note in together["notes"]), kind="bad")
    page.table(
        ["without", *uncertainty.names],
        [
            [event, *(_tell_widening(gain[n]) for n in uncertainty.names)]
            for event, gain in together["gains"].items()
        ],
        caption="How many times as wide each 95 % interval would be without the event.",
    )


def _tell_widening(ratio: float) -> str:
    """By how much a parameter's own value in each event widens its interval."""
    return f"{ratio:.2f}" if ratio < 1000 else "not identifiable"
