"""What an identification came to, in sentences and on one screen."""

from typing import TYPE_CHECKING, Any

from tractexp.blocks import Report
from tractexp.identification.network_comparison import describe_poles
from tractexp.identification.verdict import IDENTIFIED, TRADES
from tractexp.report.fit_sentences import describe_rivals, describe_search_end
from tractexp.report.fit_tables import format_digits, tabulate_model_errors, tabulate_parameters
from tractexp.report.race import tabulate_race
from tractexp.text.wording import describe_shown_effects, finish_sentence

if TYPE_CHECKING:
    from tractexp.api.identification import Identification


def build_summary(fit: "Identification") -> Report:
    """Grade, estimates, errors, why some parameters are not identified, and the next steps."""
    result = fit.result
    verdicts = select_verdicts_of_parameters(result)
    poor = [f"{name}: {verdict}" for name, verdict in name_verdicts(result).items()]
    notes = [f"note: {note}" for note in result.uncertainty.get("notes", ())]
    start = [text for event in result.events if (text := describe_rest(event))]
    report = Report()
    if fit.headline:
        report.text(finish_sentence(fit.usability_sentence))
    report.add(tabulate_parameters(fit), *tabulate_race(result.race))
    report.text(
        *describe_machine(fit), *describe_rivals(fit), *filter(None, [result.on_given_base()])
    ).add(tabulate_model_errors(fit))
    return report.text(
        *describe_yardstick(fit),
        *describe_samples(fit),
        *list_correlations(fit),
        *start,
        result.acceptance,
        *([write_headline(result)] if verdicts else []),
        *(f"  {sentence}" for sentence in poor),
        *notes,
        *filter(None, [describe_search_end(fit)]),
        *(f"next: {sentence}" for sentence in fit.next_steps),
    )


def describe_machine(fit: "Identification") -> list[str]:
    """How the load divides before the dip, in a sentence; [] where its model has no motor."""
    bound = fit.result.share_bound.get("sentence", "")
    division = [] if fit.operating_point is None else [str(fit.operating_point)]
    return [*division, *filter(None, [bound]), *describe_network(fit)]


def describe_network(fit: "Identification") -> list[str]:
    """Sentences on what the records show beside the fitted load, and on its nuisances; [] where
    nothing.
    """
    result = fit.result
    if not result.shown_effects:
        return []
    values = ", ".join(
        f"{n} {format_digits(v)} {result.units.get(n, '')}".rstrip(" 1")
        for n, v in result.nuisances.items()
    )
    return [describe_shown_effects(result.shown_effects), f"nuisances of the fit: {values}"]


def name_verdicts(result: Any) -> dict[str, str]:
    """The verdicts of parameters that are not identified, by their names."""
    own = select_verdicts_of_parameters(result).items()
    return {name: verdict for name, verdict in own if not verdict.startswith(IDENTIFIED)}


def select_verdicts_of_parameters(result: Any) -> dict[str, str]:
    """{name: verdict} without nuisances."""
    return {
        name: verdict for name, verdict in result.verdicts.items() if name not in result.nuisances
    }


def describe_yardstick(fit: "Identification") -> list[str]:
    """The best linear network beside it, in a sentence, with its poles where there are some; []
    where not judged.
    """
    poles = fit.result.linear_network.get("poles")
    what = "pole" if len(poles or ()) == 1 else "poles"
    beside = f" The network's {what}: {describe_poles(poles)}." if poles else ""
    return [finish_sentence(fit.yardstick) + beside] if fit.yardstick else []


def describe_rest(event: dict[str, Any]) -> str:
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


def write_headline(result: Any) -> str:
    """How many of the parameters are identified, and which are not, in one sentence."""
    verdicts = select_verdicts_of_parameters(result)
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


def describe_samples(fit: "Identification") -> list[str]:
    """How many samples were fitted, in a sentence; [] of an early result."""
    statistics = fit.result.uncertainty
    if "samples" not in statistics:
        return []
    said = (
        f"{statistics['samples']} samples compared, {statistics['parameters']} parameters searched"
    )
    return [f"fitted: {said}, {statistics['freedom']} degrees of freedom"]


def list_correlations(fit: "Identification") -> list[str]:
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
