"""The page of an identification, to be read in a minute: what it is good for, what was found, how sure, what next."""

from collections.abc import Sequence
from contextlib import nullcontext
from typing import Any

import numpy as np

from tractexp.identification.adequacy import Adequacy
from tractexp.identification.agreement import EventAgreement
from tractexp.identification.estimate import EstimationResult
from tractexp.identification.model_error import in_percent
from tractexp.identification.residual_tests import LAGS, REJECTED, autocorrelation
from tractexp.identification.result import by_event
from tractexp.identification.search import REFUSED, History
from tractexp.identification.uncertainty import Uncertainty
from tractexp.identification.verdict import IDENTIFIED, TRADES
from tractexp.provenance import in_words as identity_in_words
from tractexp.report import style
from tractexp.report.chart import Chart
from tractexp.report.events import CAPTION, Curve, event_chart
from tractexp.report.page import Page
from tractexp.report.waves import CAPTION as WAVE_CAPTION
from tractexp.report.waves import IN_WAVES, Drawn, prepared, spectrum_chart, wave_chart
from tractexp.wording import as_sentence, in_words

ROLES = {"train": "fitted", "validate": "held out"}
KIND = {"adequate": "good", "effect_missing": "plain", "wrong_model": "bad"}
SHOWN = 4  # events whose curves are not folded away
CHANNELS = (style.ACTIVE, style.REACTIVE, style.PALETTE[2])  # of what is compared
EXACT = (
    "Nothing but noise is left: the estimate is the most likely set, noise whitened, the power before each dip free."
    " pu: per unit of the record's base."
)
SCATTERED = (
    "More than noise is left: the estimate is the minimum of Eq. (8), and intervals say by how much it scatters where"
    " stretches of 0.1 s are left out. pu: per unit of the record's base."
)
MODEL_ERROR = (
    "Model error: rms of what is left beyond the noise, from the dip on, over the rms of the load's response, both in"
    " apparent power S. epsilon: Eq. (20)."
)
SMALLEST = 0.01  # of the deviance: starts closer than this ended in the same place


def digits(value: float) -> str:
    return f"{value:.4g}"


def page(
    result: Any, fits: Sequence[Any], estimated: EstimationResult, known: Uncertainty, together: EventAgreement | None,
    adequacy: Adequacy, structures: Sequence[str], advice: Sequence[str], history: History,
    about: dict[str, str], search: str, command: str,
) -> Page:  # fmt: skip
    """The whole page. `about` {parameter: meaning}; `search` is where the optimizer ended, in words."""
    names = ", ".join(e["name"] for e in result.events if e["role"] == "train")
    made = Page(f"Identification of {names}", f"{result.optimizer}, seed {result.seed}.")
    made.verdict(
        as_sentence(adequacy.sentence),
        f"{as_sentence(result.acceptance)}{_of_currents(result)}",
        headline(known),
        kind=KIND[adequacy.grade],
    )
    made.heading("Measured and calculated")
    _curves(made, fits, known)
    made.heading("Parameters")
    _parameters(made, result, known, structures, about)
    made.heading("How well it fits")
    _errors(made, result)
    made.heading("What to do next").items(advice)
    if together is not None:
        _events(made, known, together)
    made.heading("The search and the estimate").text(as_sentence(search))
    made.chart(_fitness(history, result), "Best objective of the search; dashed: the estimate's.")
    _starts(made, estimated, known)
    made.heading("What the fit leaves")
    _left(made, known)
    made.heading("How the estimates depend on each other")
    _correlation(made, known)
    made.heading("How this page was made")
    made.table(["", ""], _origin(result, command), words=(1,))
    return made


def _of_currents(result: Any) -> str:
    """epsilon_i of each event, in a sentence; "" in phasors."""
    told = [f"{e['epsilon_i']:.2%} ({e['name']}, {ROLES[e['role']]})" for e in result.events if "epsilon_i" in e]
    return f" Of the currents themselves epsilon_i is {', '.join(told)}." if told else ""


def headline(known: Uncertainty) -> str:
    """How many of the parameters are identified, and which are not, in one sentence."""
    poor = [f"{name} {v.word}" for name, v in known.verdicts.items() if v.word != IDENTIFIED]
    good = len(known.verdicts) - len(poor)
    return f"{good} of {len(known.verdicts)} parameters are identified" + (f"; {', '.join(poor)}" if poor else "") + "."


def _curves(made: Page, fits: Sequence[Any], known: Uncertainty) -> None:
    """The charts of each event; of many the later ones are folded away."""
    likelihood = known.likelihood
    waves = likelihood.problem.model.waves
    made.text(*[IN_WAVES] * waves)
    deviation = known.of_noise.noise.deviation(likelihood.problem.drive)
    parts = [likelihood.problem.drive.part(e) for e in range(likelihood.problem.drive.events)]
    made.text(CAPTION)
    for k, fit in enumerate(fits):
        noise = deviation[:, parts[k]] if fit.role == "train" else None
        with made.folded(f"{fit.event.record.name}, {ROLES[fit.role]}") if k >= SHOWN else nullcontext():
            _event(made, fit, noise)
    if waves:
        made.heading("What was done to the records", level=3).items(prepared(likelihood.problem, fits))


def _event(made: Page, fit: Any, noise: np.ndarray | None) -> None:
    """The currents of an event in waveforms and their spectra, then P and Q; `noise` (2, N) is that of phasors."""
    record, power = fit.event.record, np.stack((fit.P, fit.Q))
    about, notes = f"{record.name}, {ROLES[fit.role]}", [f"{note}." for note in record.notes]
    if fit.waves is not None:
        made.chart(
            wave_chart(fit.waves, [Drawn("estimate", fit.currents, style.PALETTE[0])]),
            " ".join([f"{about}: epsilon_i {fit.epsilon_i:.3%}.", WAVE_CAPTION, *notes]),
        )
        made.chart(*spectrum_chart(fit.waves, fit.currents))
        noise, notes = None, ["Measured and calculated are phasors of the currents above, by the same estimator."]
    chart = event_chart(fit.event, [Curve("estimate", power, style.PALETTE[0])], deviation=noise, around=power)
    made.chart(chart, " ".join([f"{about}: epsilon_p {fit.epsilon_p:.3%}, epsilon_q {fit.epsilon_q:.3%}.", *notes]))


def _parameters(
    made: Page, result: Any, known: Uncertainty, structures: Sequence[str], about: dict[str, str]
) -> None:  # fmt: skip
    """Table and picture against the bounds; `structures` say what rivals make of the parameters."""
    search = by_event(result.search["parameters"], result.search["per_event"])
    values = result.free | {n: v for n, v in result.parameters.items() if n not in result.per_event}
    rows = [
        [name, about.get(_base(name), ""), digits(value), result.units.get(_base(name), ""), *_sure(known, name),
         "{:g} .. {:g}".format(*result.bounds[_base(name)]), digits(search[name])]
        for name, value in values.items()
    ]  # fmt: skip
    columns = ["parameter", "meaning", "value", "unit", "95 % interval", "verdict", "bounds", "search ended at"]
    made.table(columns, rows, words=(1, 5), caption=EXACT if known.exact else SCATTERED)
    if told := result.on_given_base():
        made.text(f"{as_sentence(told)} Values and bounds in the table are on the record's own base of {result.base}.")
    made.chart(
        _forest(known, search),
        "Estimates and 95 % intervals within the bounds of each parameter (0 is the lower, 1 the upper bound); cross:"
        " where the search ended.",
    )
    poor = [f"{name}: {v}." for name, v in known.verdicts.items() if v.word != IDENTIFIED]
    made.items([*map(as_sentence, structures), *poor])


def _errors(made: Page, result: Any) -> None:
    """The model's error on each event, and the errors of Eq. (20)."""
    columns = ["event", "", "model error", "95 % interval", "of S", *result.epsilons]
    rows = [
        [e["name"], ROLES[e["role"]], in_percent(m["value"]), " .. ".join(map(in_percent, m["interval"])),
         in_percent(m["of_S"]), *(f"{e[key]:.3%}" for key in result.epsilons)]
        for e, m in zip(result.events, result.model_error["events"], strict=True)
    ]  # fmt: skip
    made.table(columns, rows, caption=MODEL_ERROR)


def _base(name: str) -> str:
    return name.partition("[")[0]


def _sure(known: Uncertainty, name: str) -> list[str]:
    """Interval and verdict of one parameter; of a fixed one that it is fixed."""
    if name not in known.names:
        return ["", "fixed"]
    low, high = known.intervals[known.names.index(name)]
    return [f"{digits(low)} .. {digits(high)}", brief(str(known.verdicts[name]))]


def brief(verdict: str) -> str:
    """A verdict without what stands behind it."""
    first = verdict.partition(":")[0].partition(";")[0]
    return first + ")" * (first.count("(") - first.count(")"))


def _forest(known: Uncertainty, search: dict[str, float]) -> Chart:
    """Every interval on the range between its bounds."""
    lower, width = known.lower, known.upper - known.lower
    at, spans = (known.values - lower) / width, (known.intervals - lower[:, None]) / width[:, None]
    told = [
        f"{n}: {digits(v)}, {digits(a)} .. {digits(b)}"
        for n, v, (a, b) in zip(known.names, known.values, known.intervals, strict=True)
    ]
    ended = (np.array([search[n] for n in known.names]) - lower) / width
    chart = Chart("between the bounds", [""], pixels=110 + 34 * len(known.names))
    chart.points("estimate and 95 % interval", at, known.names, style.PALETTE[0], size=9, told=told, spans=spans)
    chart.points("search", ended, known.names, style.PALETTE[1], symbol="x", size=8,
                 told=[f"{n}: search ended at {digits(search[n])}" for n in known.names])  # fmt: skip
    return chart.limits(None, -0.02, 1.02).limits(0, len(known.names) - 0.5, -0.5)


def _fitness(history: History, result: Any) -> Chart:
    found = history.objective < REFUSED
    chart = Chart("simulations", ["best objective [pu²]"], log_y=True, pixels=300)
    best = np.maximum(history.objective[found], 1e-30)
    chart.line(result.optimizer or "search", history.simulations[found], best, style.PALETTE[0], step=True)
    return chart.level(max(result.objective, 1e-30), "estimate")


def _starts(made: Page, estimated: EstimationResult, known: Uncertainty) -> None:
    """Where each descent to the estimate ended."""
    starts = estimated.starts
    above = np.maximum([s.above for s in starts], SMALLEST)
    chart = Chart("rank of the start", ["deviance above the best"], log_y=True, pixels=280)
    looks = {"search": ("x", style.PALETTE[1]), "box": ("circle", style.PALETTE[0]),
             "beside the best": ("diamond", style.PALETTE[2])}  # fmt: skip
    for origin, (symbol, color) in looks.items():
        at = [k for k, s in enumerate(starts) if s.origin == origin]
        told = [
            f"{origin}: " + ", ".join(f"{n} {digits(v)}" for n, v in zip(known.names, starts[k].values, strict=True))
            for k in at
        ]
        if at:
            chart.points(origin, [k + 1 for k in at], above[at], color, symbol=symbol, told=told)
    valleys = sum(1 for k, s in enumerate(starts) if k == 0 or s.above - starts[k - 1].above > 1.0)
    made.chart(
        chart,
        f"Descents of the likelihood from {len(starts)} starts ended at {valleys} heights; those at the lowest are the"
        " estimate's valley. A difference of 3.8 is what a 95 % interval spans.",
    )
    with made.folded("where each start ended"):
        made.table(["from", "above the best", *known.names],
                   [[s.origin, f"{s.above:.3g}", *map(digits, s.values)] for s in starts])  # fmt: skip


def _left(made: Page, known: Uncertainty) -> None:
    """Whitened residuals, their autocorrelation, and what the tests of them say."""
    likelihood, tests = known.of_noise, known.tests
    drive, events = likelihood.problem.drive, likelihood.problem.events
    white = known.whitened.reshape(drive.channels, -1)
    colored = [t for t in tests if t["p"] < REJECTED]
    made.text(_conclusion(colored, len(tests)))
    for e, event in enumerate(events[:SHOWN]):
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
        told = f"{event.record.name}: the whitened residual, in standard deviations of the noise."
        made.chart(chart.edge(event.t_start).edge(event.t_end), told)
        made.chart(lags, "Autocorrelation of the whitened residual; between the dashed lines is chance.")
    with made.folded("tests of the residuals, and the noise"):
        made.table(
            ["event", "channel", "test", "statistic", "p", "says"],
            [[t["event"], t["channel"], t["name"], digits(t["statistic"]), in_words(t["p"]), t["says"]]
             for t in tests],
            caption=f"Of the residuals after whitening; below p = {REJECTED} a test speaks.", words=(1, 2, 4, 5),
        )  # fmt: skip
        made.table(
            ["event", "channel", "noise [pu]", "before the dip [pu]", "order", "neighbors' correlation",
             f"correlation of {drive.names[0]} and {drive.names[1]}"],
            [[n["event"], n["channel"], digits(n["deviation"]), digits(n["before"]), str(n["order"]),
              f"{n['correlation']:.2f}", f"{n['between_P_and_Q']:.2f}"] for n in known.noise],
            caption="Noise of each channel, told from what the fit leaves before the dips and at the end of the"
                    " records: an autoregression of the channels mixed until they are independent.", words=(1,),
        )  # fmt: skip


def _conclusion(speaking: Sequence[dict[str, Any]], tests: int) -> str:
    if not tests:
        return "There are too few samples to test what is left."
    if not speaking:
        return f"None of {tests} tests finds anything but noise in what is left: it is white and normal."
    said = sorted({f"{t['channel']} of {t['event']} is {t['says']}" for t in speaking})
    return f"{len(speaking)} of {tests} tests find more than noise in what is left: {'; '.join(said)}."


def _correlation(made: Page, known: Uncertainty) -> None:
    """The strongest correlations in words, all of them as a table."""
    names, matrix = known.names, known.information.correlation
    pairs = [(abs(matrix[i, j]), i, j) for i in range(len(names)) for j in range(i)]
    strong = [
        f"{names[j]} and {names[i]} ({matrix[i, j]:+.3f})" for r, i, j in sorted(pairs, reverse=True) if r >= TRADES
    ]
    made.text(
        f"These trade against each other, so that the record knows a combination of them: {', '.join(strong)}."
        if strong else "No two parameters trade against each other."
    )  # fmt: skip
    with made.folded("all correlations"):
        made.table(["", *names], [[n, *(f"{r:+.2f}" for r in row)] for n, row in zip(names, matrix, strict=True)])


def _origin(result: Any, command: str) -> list[list[str]]:
    told = [["command", command]] if command else []
    told.append(["tractexp", f"{result.tractexp_version}{f', commit {result.commit}' if result.commit else ''}"])
    told += [
        [f"record {r['name']} ({r['role']})", "; ".join(filter(None, [identity_in_words(r), f"SHA-256 {r['sha256']}"]))]
        for r in result.records
    ]
    return told


def _events(made: Page, known: Uncertainty, together: EventAgreement) -> None:
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
