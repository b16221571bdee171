"""The page of an identification, to be read in a minute: what it is good for, what was found, how
sure, what next.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from tractexp.blocks import Report, Table, style
from tractexp.blocks.chart import Chart
from tractexp.configuration.run_command import command
from tractexp.identification.agreement import EventAgreement
from tractexp.identification.estimate import EstimationResult
from tractexp.identification.result import by_event
from tractexp.identification.search import REFUSED, History
from tractexp.identification.uncertainty import Uncertainty
from tractexp.identification.verdict import IDENTIFIED, TRADES, brief
from tractexp.identification.yardstick import poles_in_words
from tractexp.inference.model_error import in_percent, tell_error
from tractexp.inference.residual_tests import LAGS, REJECTED, autocorrelation
from tractexp.record.identity import Identity, describe_identities, title
from tractexp.report.fitted_curves import MOST_OPEN_EVENTS, ROLES, add_curves, add_next_dip
from tractexp.report.race import tabulate_race
from tractexp.report.sliders import add_sliders
from tractexp.text.wording import as_sentence, epsilon, in_words, shown_in_words

if TYPE_CHECKING:
    from tractexp.api.identify import Identification

KIND = {"adequate": "good", "effect_missing": "plain", "wrong_model": "bad"}
CHANNELS = (style.ACTIVE, style.REACTIVE, style.PALETTE[2])  # of what is compared
EXACT = (
    "Nothing but noise is left: the estimate is the most likely set, noise whitened, the power"
    " before each dip free. pu: per unit of the record's base."
)
SCATTERED = (
    "More than noise is left: the estimate is the minimum of Eq. (8), and intervals say by how much"
    " it scatters where stretches of 0.1 s are left out. pu: per unit of the record's base."
)
MODEL_ERROR = (
    "Model error: rms of what is left beyond the noise, from the dip on, over the rms of the load's"
    " response, both in apparent power S. epsilon: Eq. (20)."
)
SHARES_HELD = (
    "The motors' share held, all else fitted again: by how much more the fit then leaves than the"
    " best does."
)
FIXED = "fixed"
SAME_END_SHARE = 0.01  # of the deviance: starts closer than this ended in the same place


def digits(value: float) -> str:
    """A number with four digits."""
    return f"{value:.4g}"


def summary(fit: "Identification") -> Report:
    """What it is good for, the estimates, how well they fit, why some are not identified, and what
    to do next.
    """
    result = fit.result
    verdicts = own_verdicts(result)
    poor = [f"{name}: {verdict}" for name, verdict in name_verdicts(result).items()]
    notes = [f"note: {note}" for note in result.uncertainty.get("notes", ())]
    start = [text for event in result.events if (text := starts_at_rest(event))]
    report = Report()
    if fit.headline:
        report.text(as_sentence(fit.headline))
    report.add(parameters(fit), *tabulate_race(result.race))
    report.text(*machine(fit), *fit.structures, *filter(None, [result.on_given_base()])).add(
        errors(fit)
    )
    return report.text(
        *yardstick(fit),
        *samples(fit),
        *correlations(fit),
        *start,
        result.acceptance,
        *([headline(result)] if verdicts else []),
        *(f"  {sentence}" for sentence in poor),
        *notes,
        *filter(None, [fit.end_of_search]),
        *(f"next: {sentence}" for sentence in fit.next_steps),
    )


def machine(fit: "Identification") -> list[str]:
    """How the load divides before the dip, in a sentence; [] where its model has no motor."""
    bound = fit.result.share_bound.get("sentence", "")
    division = [] if fit.operating_point is None else [str(fit.operating_point)]
    return [*division, *filter(None, [bound]), *network(fit)]


def network(fit: "Identification") -> list[str]:
    """What the records show beside the load that is fitted, and its nuisances, in a sentence each;
    [] where nothing.
    """
    result = fit.result
    if not result.shown_effects:
        return []
    values = ", ".join(
        f"{n} {digits(v)} {result.units.get(n, '')}".rstrip(" 1")
        for n, v in result.nuisances.items()
    )
    return [shown_in_words(result.shown_effects), f"nuisances of the fit: {values}"]


def name_verdicts(result: Any) -> dict[str, str]:
    """The verdicts of parameters that are not identified, by their names."""
    own = own_verdicts(result).items()
    return {name: verdict for name, verdict in own if not verdict.startswith(IDENTIFIED)}


def own_verdicts(result: Any) -> dict[str, str]:
    """{name: verdict} without nuisances."""
    return {
        name: verdict for name, verdict in result.verdicts.items() if name not in result.nuisances
    }


def yardstick(fit: "Identification") -> list[str]:
    """The best linear network beside it, in a sentence, with its poles where there are some; []
    where not judged.
    """
    poles = fit.result.linear_network.get("poles")
    beside = f" The network's poles: {poles_in_words(poles)}." if poles else ""
    return [as_sentence(fit.yardstick) + beside] if fit.yardstick else []


def starts_at_rest(event: dict[str, Any]) -> str:
    """How well a simulation in waveforms begins at rest, in a sentence; "" in phasors, which do so
    exactly.
    """
    if event.get("unsettled") is None:
        return ""
    change = (
        f"the calculated currents still change by {event['unsettled']:.2g} of their size from cycle"
        " to cycle"
    )
    return f"periodic steady state before {event['name']}: {change}"


def report(fit: "Identification") -> Report:
    """The page: what the summary says, and what one sees of it."""
    result, details = fit.result, fit.details
    uncertainty, together = details.uncertainty, details.agreement
    names, of = [e["name"] for e in result.events if e["role"] == "train"], result.identities
    lead = "; ".join([*describe_identities(of), f"{result.optimizer}, seed {result.seed}."])
    page = Report(f"Identification of {title(of, names)}", lead)
    page.verdict(
        as_sentence(fit.headline),
        *yardstick(fit),
        f"{as_sentence(result.acceptance)}{_of_currents(result)}",
        headline(result),
        kind=KIND[fit.grade],
    )
    page.heading("Measured and calculated")
    add_curves(page, details.fits, uncertainty, fit.spec.validate)
    add_next_dip(page, fit)
    page.heading("Parameters").add(parameters(fit)).text(*map(as_sentence, machine(fit)))
    if result.share_bound:
        page.chart(_draw_shares(result.share_bound["profile"]), SHARES_HELD)
    _parameters(page, fit, uncertainty)
    page.add(*tabulate_race(result.race))
    page.heading("Moved by hand")
    add_sliders(page, fit)
    page.heading("How well it fits").add(errors(fit)).text(*map(as_sentence, samples(fit)))
    page.heading("What to do next").items(fit.advice)
    if together is not None:
        _events(page, uncertainty, together)
    page.heading("The search and the estimate").add(tabulate_search_end(fit)).text(
        as_sentence(fit.end_of_search)
    )
    page.chart(
        _fitness(fit.search_result.history, result),
        "Best objective of the search; dashed: the estimate's.",
    )
    _starts(page, details.estimation, uncertainty)
    page.heading("What the fit leaves")
    _add_residual_section(page, uncertainty)
    page.heading("How the estimates depend on each other")
    _correlation(page, uncertainty)
    page.heading("How this page was made")
    return page.table(["", ""], list_origin(result, command()), words=(1,))


def _draw_shares(profile: Sequence[dict[str, float]]) -> Chart:
    """The error of a fit whose motors' share is held, over the least, by share."""
    shares, errors = (np.array([row[key] for row in profile]) for key in ("share", "error"))
    chart = Chart("motors, of P [%]", ["error, over the least"], pixels=260)
    return chart.line("all else free", 100 * shares, errors, style.ACTIVE, width=2.0)


def _of_currents(result: Any) -> str:
    """epsilon_i of each event, in a sentence; "" in phasors."""
    values = [
        f"{e['epsilon_i']:.2%} ({e['name']}, {ROLES[e['role']]})"
        for e in result.events
        if "epsilon_i" in e
    ]
    return f" Of the currents themselves epsilon_i is {', '.join(values)}." if values else ""


def headline(result: Any) -> str:
    """How many of the parameters are identified, and which are not, in one sentence."""
    verdicts = own_verdicts(result)
    poor = [
        f"{n} {v.partition(':')[0].partition(' (')[0]}"
        for n, v in verdicts.items()
        if not v.startswith(IDENTIFIED)
    ]
    good = len(verdicts) - len(poor)
    return (
        f"{good} of {len(verdicts)} parameters are identified"
        + (f"; {', '.join(poor)}" if poor else "")
        + "."
    )


def parameters(fit: "Identification") -> Table:
    """The estimates. Where the search ended is a detail, unless that lies outside an interval."""
    rows = [
        [
            e.name,
            e.about,
            e.value,
            e.unit,
            "{:.4g} .. {:.4g}".format(*e.interval) if e.interval else "",
            "{:g} .. {:g}".format(*e.bounds),
            e.search,
            brief(e.verdict),
        ]
        for e in fit.parameters.values()
        if e.name not in fit.result.nuisances
    ]
    columns = [
        "parameter",
        "meaning",
        "value",
        "unit",
        "95 % interval",
        "bounds",
        "search ended at",
        "verdict",
    ]
    caption = EXACT if fit.adequate else SCATTERED
    if missing := fit.result.unrecorded:  # a further column: what it would move each by
        columns.append(f"{missing['swing']:g} Hz of {missing['channel']} moves")
        rows = [[*row, missing["moves"].get(row[0])] for row in rows]
    return Table(
        columns,
        rows,
        fit.model.model.title,
        caption,
        words=(1, 3, 7),
        detail=(1, 5) if fit.outside_interval else (1, 5, 6),
    )


def tabulate_search_end(fit: "Identification") -> Table:
    """Where the search ended beside the estimate, and a word where they differ."""
    search, result, away = fit.result.search, fit.result, fit.outside_interval
    keys = [("objective", "pu²"), ("epsilon_p", "1"), ("epsilon_q", "1")] if search else []
    rows = [[key, search[key], getattr(result, key), unit, ""] for key, unit in keys]
    rows += [
        [e.name, e.search, e.value, e.unit, "outside the 95 % interval" if e.name in away else ""]
        for e in fit.parameters.values()
        if e.verdict != FIXED
    ]
    return Table(["", "search ended at", "estimate", "unit", "they differ"], rows, words=(3, 4))


def _parameters(page: Report, fit: "Identification", uncertainty: Uncertainty) -> None:
    """The base of the values, a picture against the bounds, and what rivals make of
    the parameters.
    """
    result = fit.result
    if on_given_base := result.on_given_base():
        base = f"Values and bounds in the table are on the record's own base of {result.base}."
        page.text(f"{as_sentence(on_given_base)} {base}")
    page.chart(
        _forest(uncertainty, by_event(result.search["parameters"], result.search["per_event"])),
        "Estimates and 95 % intervals within the bounds of each parameter (0 is the lower, 1 the"
        " upper bound); cross: where the search ended.",
    )
    nuisances = result.nuisances
    verdicts = uncertainty.verdicts.items()
    poor = [
        f"{name}: {v}." for name, v in verdicts if v.word != IDENTIFIED and name not in nuisances
    ]
    page.items([*map(as_sentence, fit.structures), *poor])


def errors(fit: "Identification") -> Table:
    """The model's error on each event, and the errors of Eq. (20)."""
    return tabulate_errors(fit.result)


def tabulate_errors(result: Any) -> Table:
    """The same of a result."""
    unknown = {"value": None, "interval": (), "of_S": None}
    of_events = result.model_error.get("events") or [unknown] * len(result.events)
    return error_table(result.events, of_events, result.epsilons)


def error_rows(result: Any) -> list[list[str]]:
    """Name, role, model's error and its interval of each event."""
    return [[str(cell) for cell in row[:4]] for row in tabulate_errors(result).rows]


def error_table(events: Sequence[Any], of_events: Sequence[Any], epsilons: Sequence[str]) -> Table:
    """Entries of `events` and of `model_error` as `result.json` has them, a row each."""
    columns = ["event", "role", "model error", "95 % interval", "of S", *epsilons]
    rows = [
        [
            e["name"],
            ROLES[e["role"]],
            tell_error(m),
            "" if m.get("stalls") else " .. ".join(map(in_percent, m["interval"])),
            "" if m.get("stalls") else in_percent(m["of_S"]),
            *(epsilon(e[key]) for key in epsilons),
        ]
        for e, m in zip(events, of_events, strict=True)
    ]
    return Table(columns, rows, "", MODEL_ERROR, words=(1,), detail=(4,))


def samples(fit: "Identification") -> list[str]:
    """How many samples were fitted, in a sentence; [] of an early result."""
    statistics = fit.result.uncertainty
    if "samples" not in statistics:
        return []
    said = (
        f"{statistics['samples']} samples compared, {statistics['parameters']} parameters searched"
    )
    return [f"fitted: {said}, {statistics['freedom']} degrees of freedom"]


def correlations(fit: "Identification") -> list[str]:
    """The correlations that a terminal has room for, the strongest first; [] where
    none is strong.
    """
    statistics = fit.result.uncertainty
    names, matrix = statistics.get("names", []), statistics.get("correlation", [])
    pairs = [(matrix[i][j], names[j], names[i]) for i in range(len(names)) for j in range(i)]
    strong = [
        f"{a} and {b} {r:+.3f}"
        for r, a, b in sorted(pairs, key=lambda p: -abs(p[0]))
        if abs(r) >= TRADES
    ]
    return [f"correlations of {TRADES} and more: {', '.join(strong)}"] if strong else []


def _forest(uncertainty: Uncertainty, search: dict[str, float]) -> Chart:
    """Estimates and intervals in their bounds, beside where the search ended."""
    lower, width = uncertainty.lower, uncertainty.upper - uncertainty.lower
    at, spans = (
        (uncertainty.values - lower) / width,
        (uncertainty.intervals - lower[:, None]) / width[:, None],
    )
    sentences = [
        f"{n}: {digits(v)}, {digits(a)} .. {digits(b)}"
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
        hover=[f"{n}: search ended at {digits(search[n])}" for n in uncertainty.names],
    )
    return chart.limits(None, -0.02, 1.02).limits(0, len(uncertainty.names) - 0.5, -0.5)


def _fitness(history: History, result: Any) -> Chart:
    """The best objective [pu²] by simulations."""
    valid = history.objective < REFUSED
    chart = Chart("simulations", ["best objective [pu²]"], log_y=True, pixels=300)
    best = np.maximum(history.objective[valid], 1e-30)
    chart.line(
        result.optimizer or "search", history.simulations[valid], best, style.PALETTE[0], step=True
    )
    return chart.level(max(result.objective, 1e-30), "estimate")


def _starts(page: Report, estimated: EstimationResult, uncertainty: Uncertainty) -> None:
    """Where each descent to the estimate ended."""
    starts = estimated.starts
    above = np.maximum([s.above for s in starts], SAME_END_SHARE)
    chart = Chart("rank of the start", ["deviance above the best"], log_y=True, pixels=280)
    looks = {
        "search": ("x", style.PALETTE[1]),
        "box": ("circle", style.PALETTE[0]),
        "beside the best": ("diamond", style.PALETTE[2]),
    }
    for origin, (symbol, color) in looks.items():
        at = [k for k, s in enumerate(starts) if s.origin == origin]
        sentences = [
            f"{origin}: "
            + ", ".join(
                f"{n} {digits(v)}" for n, v in zip(uncertainty.names, starts[k].values, strict=True)
            )
            for k in at
        ]
        if at:
            chart.points(
                origin, [k + 1 for k in at], above[at], color, symbol=symbol, hover=sentences
            )
    valleys = sum(1 for k, s in enumerate(starts) if k == 0 or s.above - starts[k - 1].above > 1.0)
    page.chart(
        chart,
        f"Descents of the likelihood from {len(starts)} starts ended at {valleys} heights; those at"
        " the lowest are the estimate's valley. A difference of 3.8 is what a 95 % interval spans.",
    )
    with page.fold_blocks("where each start ended"):
        page.table(
            ["from", "above the best", *uncertainty.names],
            [[s.origin, f"{s.above:.3g}", *map(digits, s.values)] for s in starts],
        )


def _add_residual_section(page: Report, uncertainty: Uncertainty) -> None:
    """Whitened residuals, their autocorrelation, and what the tests of them say."""
    likelihood, tests = uncertainty.of_noise, uncertainty.tests
    drive, events = likelihood.problem.drive, likelihood.problem.events
    white = uncertainty.whitened_residual.reshape(drive.channels, -1)
    colored = [t for t in tests if t["p"] < REJECTED]
    page.text(_conclusion(colored, len(tests)))
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
            lags.points(name, x + 0.2 * c, autocorrelation(rows, len(x)), color, size=5)
            limit = 1.96 / np.sqrt(max(len(rows), 1))
            lags.level(limit).level(-limit)
        caption = (
            f"{event.record.name}: the whitened residual, in standard deviations of the noise."
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
                    digits(t["statistic"]),
                    in_words(t["p"]),
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
                    digits(n["deviation"]),
                    digits(n["before"]),
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


def _conclusion(speaking: Sequence[dict[str, Any]], tests: int) -> str:
    """What the tests of the residual say, in a sentence."""
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


def _correlation(page: Report, uncertainty: Uncertainty) -> None:
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


def list_origin(result: Any, command: str) -> list[list[str]]:
    """The command, the version and the records that a result was made of, a row each."""
    rows = [["command", command]] if command else []
    rows.append(
        [
            "tractexp",
            f"{result.tractexp_version}{f', commit {result.commit}' if result.commit else ''}",
        ]
    )
    rows += [
        [
            f"record {r['name']} ({r['role']})",
            "; ".join(filter(None, [str(Identity.from_content(r)), f"SHA-256 {r['sha256']}"])),
        ]
        for r in result.records
    ]
    return rows


def _events(page: Report, uncertainty: Uncertainty, together: EventAgreement) -> None:
    """What each event of a joint fit adds, and which does not belong."""
    page.heading("What each event adds")
    if together.notes:
        page.verdict(*(f"{note}." for note in together.notes), kind="bad")
    page.table(
        ["without", *uncertainty.names],
        [
            [event, *(_wider(gain[n]) for n in uncertainty.names)]
            for event, gain in together.gains.items()
        ],
        caption="How many times as wide each 95 % interval would be without the event.",
    )


def _wider(ratio: float) -> str:
    """By how much a parameter's own value in each event widens its interval."""
    return f"{ratio:.2f}" if ratio < 1000 else "not identifiable"
