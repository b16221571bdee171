"""Sentences on several problems at once, each with its numbers and no more than the tests allow."""

import itertools
from collections.abc import Sequence

from tractexp.studies.comparison.ablation import Ablation, SwitchEffect
from tractexp.studies.comparison.claims import format_number
from tractexp.studies.comparison.overall import Overall, Several
from tractexp.studies.comparison.statistics import SIGNIFICANCE_LEVEL
from tractexp.text.wording import format_probability, format_share, join_words


def answer(several: Several) -> str:
    """The sentence on the best rank under each of the terms."""
    return " ".join(describe_mean_ranks(overall) for overall in several.overall)


def describe_mean_ranks(overall: Overall) -> str:
    """Which variant has the best mean rank, and which are not told from it."""
    where = f"{overall.terms}, {overall.where}" if overall.terms else overall.where
    if overall.ranks is None:
        return f"{where}: too few variants or seeds to rank."
    ranks = overall.ranks
    best, *others = sorted(zip(ranks.mean, ranks.names, strict=True))
    alike = [name for mean, name in others if mean - best[0] < ranks.critical_difference]
    said = f"{where}: {best[1]} has the best mean rank, {best[0]:.2f} of {len(ranks.names)}"
    if ranks.p >= SIGNIFICANCE_LEVEL:
        return (
            f"{said}, but the variants do not differ significantly (Friedman, p ="
            f" {format_probability(ranks.p)})."
        )
    close = join_words(alike) if len(alike) < 6 else f"{len(alike)} others"
    verdict = f"; not told from it: {close}" if alike else ", significantly before all others"
    return f"{said}{verdict} (critical difference {ranks.critical_difference:.2f})."


def describe_switches(overall: Overall) -> str:
    """Which switches help and which harm, over all problems under the same terms; "" without an
    ablation.
    """
    if overall.ablation is None:
        return ""
    effects = [describe_effect(effect) for effect in overall.ablation.effects]
    terms = [overall.terms, "BBOB" if overall.share else ""]
    where = ", ".join(filter(None, terms))
    said = "; ".join(effects)
    return f"{where}: {said}." if where else f"{said}."


def describe_effect(effect: SwitchEffect) -> str:
    """ "levy helps (x 0.81, 0.76 to 0.87; in 64 % of the pairs)"."""
    verdict = (
        "has no effect that is shown"
        if not effect.is_significant
        else "helps"
        if effect.factor < 1
        else "harms"
    )
    pairs = f"; better in {format_share(effect.better[0])} of the pairs" if effect.better else ""
    interval = f"{format_number(effect.low)} to {format_number(effect.high)}"
    return f"{effect.switches[0]} {verdict} (× {format_number(effect.factor)}, {interval}{pairs})"


def describe_costs(overall: Overall) -> str:
    """The sentence on the simulations that each switch costs; "" where that is not known."""
    if not overall.cost:
        return ""
    costs = [f"{switch} {cost:+.1f}" for switch, cost in overall.cost.items()]
    return (
        f"{overall.terms}: simulations that switching on adds to an iteration: {', '.join(costs)}."
    )


def describe_agreement(several: Several) -> str:
    """Whether the switches do the same under all terms; "" without ablations."""
    ablations = [overall.ablation for overall in several.overall if overall.ablation]
    if len(ablations) < 2:
        return ""
    helps = _list_help(ablations)
    always = [s for s, each in helps.items() if sum(each) == len(ablations)]
    never = [s for s, each in helps.items() if not any(each)]
    parts = [f"{_say_help(always)} everywhere" if always else "no ingredient helps everywhere"]
    parts += [f"{_say_help(never)} nowhere"] if never else []
    return f"Over all terms together, {' and '.join(parts)}."


def _list_help(ablations: Sequence[Ablation]) -> dict[str, list[bool]]:
    """{switch: whether it helps, under each of the terms}."""
    helps: dict[str, list[bool]] = {}
    for effect in itertools.chain.from_iterable(ablation.effects for ablation in ablations):
        helps.setdefault(effect.switches[0], []).append(effect.factor < 1 and effect.is_significant)
    return helps


def _say_help(names: list[str]) -> str:
    """ "levy helps", or "levy and tent help"."""
    return f"{join_words(names)} {'helps' if len(names) == 1 else 'help'}"


def list_overall_claims(several: Several) -> list[str]:
    """All claims, the most general first."""
    claims = [describe_agreement(several)]
    for overall in several.overall:
        claims += [describe_mean_ranks(overall), describe_switches(overall)]
    claims += [describe_costs(overall) for overall in several.overall]
    return [text for text in claims if text]
