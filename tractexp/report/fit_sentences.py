"""Sentences on an identification: what rival structures make of it, and where the search ended."""

from typing import TYPE_CHECKING

from tractexp.text.wording import format_epsilon, join_words

if TYPE_CHECKING:
    from tractexp.api.identification import Identification

LEAST_TOLD_MOVE = 2.0  # standard errors from which a rival structure's move is told


def find_rival_moves(fit: "Identification") -> dict[str, tuple[str, float]]:
    """By parameter the rival structure that moves it most, and by more than it scatters; and the
    value there.
    """
    far: dict[str, tuple[str, float]] = {}
    for rival in fit.result.rival_structures:
        for e in (fit.parameters[name] for name in rival["parameters"]):
            value, before = rival["parameters"][e.name], far.get(e.name, ("", e.value))[1]
            scatter = LEAST_TOLD_MOVE * (e.standard_error or 0.0)
            if abs(value - e.value) > max(scatter, abs(before - e.value)):
                far[e.name] = rival["name"], value
    return far


def describe_rivals(fit: "Identification") -> list[str]:
    """A sentence on each rival structure: the parameters that it moves most, and to where."""
    by_name: dict[str, list[str]] = {}
    for name, (structure, value) in sorted(find_rival_moves(fit).items()):
        by_name.setdefault(structure, []).append(f"{name} {value:.4g}")
    return [
        f"with {name}, which fits as well: {', '.join(values)}" for name, values in by_name.items()
    ]


def describe_search_end(fit: "Identification") -> str:
    """Where the optimizer itself ended, in one line; "" where that is not known."""
    result, search = fit.result, fit.result.search
    if not search:
        return ""
    errors = ", ".join(
        f"{name} {format_epsilon(search[name])}" for name in ("epsilon_p", "epsilon_q")
    )
    return (
        f"search: {result.optimizer} {search['status']}: objective {search['objective']:.4g} pu²"
        f" (the estimate's is {result.objective:.4g}), {errors}, {search['simulations']}"
        f" simulations in {search['seconds']:.2f} s{_describe_search_difference(fit)}"
    )


def _describe_search_difference(fit: "Identification") -> str:
    """Where the search's end differs from the estimate, as the end of a sentence; "" where it does
    not.
    """
    result = fit.result
    if not (away := fit.parameters.outside_interval):
        return ""
    ratio = result.search["objective"] / result.objective if result.objective else float("inf")
    why = (
        f"it stopped short of the minimum, at {ratio:.3g} times its objective"
        if ratio > 1
        else "it is elsewhere"
    )
    lie = "lies" if len(away) == 1 else "lie"
    return f"; its {join_words(away)} {lie} outside the estimate's interval: {why}"
