"""Sentences to quote, each with its numbers and no more than the tests allow."""

import numpy as np

from tractexp.studies.comparison.ablation import Ablation, SwitchEffect
from tractexp.studies.comparison.comparison import Comparison, VariantPair, count_seeds_needed
from tractexp.studies.comparison.floor import FLOOR_SHARE
from tractexp.studies.comparison.runs import Variant
from tractexp.studies.comparison.statistics import SIGNIFICANCE_LEVEL
from tractexp.studies.comparison.summary import Spread
from tractexp.text.wording import join_words

LEAST_TOLD_RATIO = 1.2  # times the simulations of another variant are worth a word


def format_number(value: float, digits: int = 3) -> str:
    """0.0000081 as 8.1e-06, 15000 as 15,000, inf as never."""
    if np.isnan(value):
        return "-"
    if np.isinf(value):
        return "never"
    if (abs(value) >= 1000 and value == round(value)) or abs(value) >= 10**digits:
        return f"{value:,.0f}"
    return f"{value:.{digits}g}"


def format_p_value(p: float) -> str:
    """A probability with two digits."""
    return f"{p:.2g}" if p >= 1e-4 else f"{p:.1e}"


def answer(comparison: Comparison) -> str:
    """Which variant to take, as far as these runs say."""
    best, *others = comparison.leaders
    if len(comparison.summaries) < 2:
        return f"There is one variant only, {best}: nothing to choose from."
    if max((pair.seeds for pair in comparison.pairs), default=0) < count_seeds_needed(
        len(comparison.pairs)
    ):
        lowest = f"{_list_names([best, *others])} have" if others else f"{best} has"
        return (
            f"Not settled: there are too few seeds to test. {lowest} the lowest median objective so"
            " far."
        )
    if (tested := _find_best_tested(comparison)) != best:
        advice = _advise_variant(comparison, tested, [])
        return (
            f"{best} has the lowest median objective, but too few seeds to test. Of the others:"
            f" {advice}"
        )
    return _advise_variant(comparison, best, others)


def _find_best_tested(comparison: Comparison) -> str:
    """The best of the variants that had seeds enough for a test; of all where none had.

    Summaries stand best first.
    """
    tested = {name for pair in comparison.pairs for name in (pair.first, pair.second)}
    return next(
        (s.name for s in comparison.summaries if s.name in tested), comparison.summaries[0].name
    )


def _advise_variant(comparison: Comparison, best: str, others: list[str]) -> str:
    """Whether to take the variant whose median is lowest, or as low as those of others and reached
    sooner.
    """
    beaten, worse, alike = _list_verdicts(comparison, best)
    if worse:
        return (
            f"Not settled: {best} has the lowest median objective, but {_list_names(worse)} did"
            " better seed by seed."
        )
    rivals = [name for name in alike if name not in others]
    if rivals:
        return (
            f"Take {best}, or as well {_list_names(rivals)}: these runs do not tell them"
            f" apart.{_describe_spent(comparison, best)}"
        )
    why = [f"it ends as low as {_list_names(others)}, sooner"] if others else []
    why += [f"it ends lower than {_list_names(beaten)}"] if beaten else []
    return f"Take {best}: {', and '.join(why)}.{_describe_spent(comparison, best)}"


def _describe_spent(comparison: Comparison, best: str) -> str:
    """The clause on the simulations of the best variant, where they are more than another's; ""
    else.
    """
    (first,) = (summary for summary in comparison.summaries if summary.name == best)
    least = min(comparison.summaries, key=lambda summary: summary.simulations.median)
    if not first.simulations.median > LEAST_TOLD_RATIO * least.simulations.median:
        return ""
    spent = (
        f"{format_number(float(round(s.simulations.median)))} simulations" for s in (first, least)
    )
    return f" It spent {next(spent)}, where {least.name} spent {next(spent)}."


def _list_verdicts(comparison: Comparison, name: str) -> tuple[list[str], list[str], list[str]]:
    """The variants that one is significantly better than, those it is worse than, and those it is
    not told from.
    """
    beaten, worse, alike = [], [], []
    for pair in comparison.pairs:
        if name not in (pair.first, pair.second):
            continue
        other = pair.second if pair.first == name else pair.first
        if not pair.significant:
            alike.append(other)
        else:
            (beaten if pair.first == name else worse).append(other)
    return beaten, worse, alike


def write_headline(comparison: Comparison) -> str:
    """Which variants lead, in a sentence."""
    if not comparison.pairs:
        return "No difference between variants was tested."
    best, *others = comparison.leaders
    if others:
        within = f"equal within {comparison.ties:.2%} of the floor"
        said = (
            f"{_list_names([best, *others])} reach the lowest median objective ({within}); {best},"
            " the fastest of them,"
        )
    else:
        said = f"{best} has the lowest median objective; it"
    beaten, worse, alike = _list_verdicts(comparison, best)
    verdicts = [f"is significantly better than {_list_names(beaten)}"] if beaten else []
    verdicts += (
        [f"is significantly worse than {_list_names(worse)} over paired seeds"] if worse else []
    )
    verdicts += [f"shows no significant difference to {_list_names(alike)}"] if alike else []
    return f"{said} {' and '.join(verdicts) or 'was not tested'}."


def split_pairs(comparison: Comparison) -> tuple[list[VariantPair], list[VariantPair]]:
    """The pairs with the reference, or with the best variant tested where there is none; and the
    others.
    """
    chosen = comparison.reference or _find_best_tested(comparison)
    near = [pair for pair in comparison.pairs if chosen in (pair.first, pair.second)]
    return near, [pair for pair in comparison.pairs if pair not in near]


def _list_names(names: list[str]) -> str:
    """Names in a sentence, or how many there are."""
    return join_words(sorted(names)) if len(names) <= 6 else f"{len(names)} other variants"


def quote_pair(comparison: Comparison, pair: VariantPair) -> str:
    """One pair of variants, as it may be quoted."""
    one, two = (comparison.gathered[name] for name in (pair.first, pair.second))
    spent = [_spent_simulations(variant) for variant in (one, two)]
    first, second = (
        f"{format_number(median)} pu²" if np.isfinite(median) else "no result"
        for median in pair.medians
    )
    if len({x for s in spent for x in (s.best, s.worst)}) == 1:
        start = f"On {pair.seeds} seeds and {format_number(spent[0].median)} simulations, "
        reached = (
            f"{pair.first} reaches a median objective of {first} against {second} for {pair.second}"
        )
    else:
        start = f"On {pair.seeds} seeds, "
        reached = (
            f"{pair.first} reaches a median objective of {first} with"
            f" {format_number(spent[0].median)} simulations (median) against {second} with"
            f" {format_number(spent[1].median)} for {pair.second}"
        )
    verdict = "is significant" if pair.significant else "is not significant"
    tests = len(comparison.pairs)
    return (
        f"{start}{reached}; the difference {verdict} (Wilcoxon signed-rank, Holm-corrected over"
        f" {tests} {'pair' if tests == 1 else 'pairs'}, p = {format_p_value(pair.corrected)};"
        f" Vargha-Delaney A = {pair.effect:.2f})."
    )


def _spent_simulations(variant: Variant) -> Spread:
    """The simulations that the finished runs of a variant made."""
    return Spread.from_values([run.simulations[-1] for run in variant.finished_runs])


def describe_friedman_test(comparison: Comparison) -> str:
    """Friedman's test, or "" where it was not made."""
    ranks = comparison.ranks
    if ranks is None:
        return ""
    order = np.argsort(ranks.mean, kind="stable")
    listed = ", ".join(f"{ranks.names[i]} {ranks.mean[i]:.2f}" for i in order[:5])
    more = f" and {len(order) - 5} more up to {max(ranks.mean):.2f}" if len(order) > 5 else ""
    differ = "differ" if ranks.p < SIGNIFICANCE_LEVEL else "do not differ significantly"
    text = (
        f"Over {ranks.seeds} seeds the mean ranks {differ} (Friedman chi-square = {ranks.chi2:.2f},"
        f" {len(order) - 1} degrees of freedom, p = {format_p_value(ranks.p)}): {listed}{more}"
    )
    if ranks.p < SIGNIFICANCE_LEVEL:
        text += (
            f"; two ranks differ significantly at {SIGNIFICANCE_LEVEL:.0%} when"
            f" {ranks.critical_difference:.2f} or more apart"
        )
        text += " (Nemenyi)"
    return text + "."


def describe_speed(comparison: Comparison) -> str:
    """Who needs fewest simulations to the hardest target."""
    target, index = min((target, i) for i, target in enumerate(comparison.targets))
    rows = sorted((s.ert["simulations"][index], s.name) for s in comparison.summaries)
    goal = f"{target:g} times the floor of {format_number(comparison.floor.value)} pu²"
    if np.isinf(rows[0][0]):
        return f"No variant ever reached {goal}."
    said = [
        f"{name} needs {format_number(float(round(ert)))}"
        for ert, name in rows[:4]
        if np.isfinite(ert)
    ]
    text = f"To reach {goal}, {', '.join(said)} simulations in expectation (ERT)"
    never = [name for ert, name in rows if np.isinf(ert)]
    return text + (f"; {_list_names(never)} never did." if never else ".")


def describe_floor(comparison: Comparison) -> str:
    """How many runs of each variant reach the floor, in a sentence."""
    shares = _describe_shares([(s.at_floor, s.runs, s.name) for s in comparison.summaries])
    value = format_number(comparison.floor.value, 5)
    source = comparison.floor.source
    return f"Runs within {FLOOR_SHARE:.0%} of the floor of {value} pu² ({source}): {shares}."


def describe_valley(comparison: Comparison) -> str:
    """How often a search ended where the floor's values are only a descent away; "" where that is
    not known.
    """
    rows = [
        (s.in_valley, s.runs - s.failures, s.name)
        for s in comparison.summaries
        if s.in_valley is not None
    ]
    if not rows:
        return ""
    return (
        "Runs that ended in the floor's valley, from where least squares reach it:"
        f" {_describe_shares(rows)}."
    )


def _describe_shares(rows: list[tuple[float, int, str]]) -> str:
    """Shares of runs in words, the largest first: (share, runs, variant)."""
    rows = sorted(rows, key=lambda row: (-row[0], row[2]))
    more = f" (the best six of {len(rows)})" if len(rows) > 6 else ""
    return ", ".join(f"{name} {round(share * n)} of {n}" for share, n, name in rows[:6]) + more


def describe_effect(effect: SwitchEffect) -> str:
    """The effect of a switch, in a sentence."""
    (switch,) = effect.switches
    verdict = (
        "no effect is shown"
        if not effect.is_significant
        else "it helps"
        if effect.factor < 1
        else "it harms"
    )
    return (
        f"Switching on {switch} multiplies the objective by {format_number(effect.factor)}"
        f" (geometric mean over {effect.seeds} seeds, 95 % bootstrap interval"
        f" {format_number(effect.low)} to"
        f" {format_number(effect.high)}, from {_list_contrasts(effect)}): {verdict}."
    )


def _list_contrasts(effect: SwitchEffect) -> str:
    """The pairs of variants that a switch was judged by, or how many."""
    pairs = [f"{with_} against {without}" for with_, without in effect.contrasts]
    return (
        " and ".join(pairs)
        if len(pairs) < 3
        else f"{len(pairs)} pairs of variants that differ in it alone"
    )


def describe_untold_effects(ablation: Ablation) -> str:
    """The sentence on effects that these variants cannot tell, and which variants would; "" where
    none is missing.
    """
    if not ablation.unknown:
        return ""
    names = "; ".join(" with ".join(key) for key in ablation.unknown)
    return (
        f"Not to be had from these {len(ablation.variants)} variants: {names}. A main effect takes"
        " two variants that differ in that switch alone, an interaction of two switches takes four"
        " that differ in those alone."
    )


def list_claims(comparison: Comparison) -> list[str]:
    """All claims, the most general first."""
    claims = [
        write_headline(comparison),
        describe_floor(comparison),
        describe_valley(comparison),
        describe_speed(comparison),
        describe_friedman_test(comparison),
    ]
    claims += [quote_pair(comparison, pair) for group in split_pairs(comparison) for pair in group]
    if comparison.ablation:
        claims += [describe_effect(effect) for effect in comparison.ablation.effects]
        claims.append(describe_untold_effects(comparison.ablation))
    return [text for text in claims if text]
