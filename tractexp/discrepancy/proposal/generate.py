"""A term as a plugin: an effect of its own, with the functions of the library copied into its file.

The file needs nothing of the library. Its parameters start at what was fitted; the size has the
null 0.
"""

import inspect
import re
from collections.abc import Callable, Mapping

from tractexp.discrepancy.proposal import shapes
from tractexp.discrepancy.proposal.library import Term
from tractexp.text import quoting

NAME = "proposed_effect"  # of the file, and so of the effect
PLUGIN = f"{NAME}.py"  # beside the page
PREFIX = "proposed_"  # of the parameters, which share a model with others
HELPERS = ("step_at_zero", "round_corner", "step_at_instant")
CONSTANTS = ("SHARP", "FALLEN", "RISEN")
HEAD = '''"""{headline}, as the data propose it."""

{imports}

SOURCE = "proposed by the data; tractexp, docs/missing-effects.md"
{constants}
'''
CLASS = '''
@plugin
class ProposedEffect(Effect):
    """{headline}.

        {latex}

    {time}At a size of 0 the base model.

    Source: proposed by tractexp's missing-effect workflow from {records}; no textbook.
    Departures: what it stands for physically is for an engineer to say.
    """

{parameters}

    order = 2
    relevant = {relevant}

    def edit(self, eq, {arguments}):
{body}
'''
TIME = (
    "It is a function of time, not of the voltage: it holds for events that it happens in.\n\n    "
)


def list_term_parameters(term: Term) -> dict[str, str]:
    """The parameters of a term by the names they have in its plugin, to their own names."""
    own = [*(s.name for s in term.balance.sizes), *(s.name for s in term.signal.shapes)]
    return {PREFIX + name: name for name in own}


def write_source(term: Term, values: Mapping[str, float], records: str) -> str:
    """The text of a plugin file for a term with these sizes and this setting."""
    functions = [
        _copy_source(term.signal.build, "signal"),
        _copy_source(term.balance.build, "balance"),
    ]
    if term.clock is not None:
        functions.insert(0, _copy_source(term.clock.build, "clock"))
    helpers = [
        inspect.getsource(getattr(shapes, h))
        for h in HELPERS
        if any(f"{h}(" in f for f in functions)
    ]
    functions = [*helpers, *functions]
    constants = [
        f"{c} = {getattr(shapes, c):g}"
        for c in CONSTANTS
        if any(re.search(rf"\b{c}\b", f) for f in functions)
    ]
    relevant = ", ".join(f'"{PREFIX}{s.name}": {s.relevant!r}' for s in term.balance.sizes)
    sites = ", sites" if any("sites." in f for f in functions) else ""
    headline = quoting.python(f"{term.words[:1].upper()}{term.words[1:]}")
    text = HEAD.format(
        headline=headline,
        constants="\n".join(constants),
        imports=f"from tractexp.extend import Effect, Parameter, plugin{sites}",
    )
    text += "".join(f"\n\n{f}" for f in functions)
    return (
        text.replace("\n\n\n\n", "\n\n\n")
        + "\n"
        + CLASS.format(
            headline=headline,
            latex=quoting.python(term.latex),
            time=TIME if term.clock else "",
            records=quoting.python(records),
            parameters="\n".join(_declare_parameters(term, values)),
            relevant=f"{{{relevant}}}",
            arguments=", ".join(list_term_parameters(term)),
            body="\n".join(_write_body(term)),
        )
    )


def _copy_source(function: Callable[..., object], name: str) -> str:
    """The text of a function under another name."""
    return re.sub(r"^def \w+", f"def {name}", inspect.getsource(function)).replace(
        "  # noqa: N802", ""
    )


def _declare_parameters(term: Term, values: Mapping[str, float]) -> list[str]:
    """The lines of the effect that declare its parameters."""
    lines = []
    for p in term.parameters(values, PREFIX):
        null = "" if p.null is None else f", null={p.null}"
        null += f", power_exponent={p.power_exponent}" if p.power_exponent else ""
        unit, about, symbol = map(quoting.python, (p.unit, p.about, p.symbol))
        text = f'"{unit}", "{about}", SOURCE, "{symbol}"{null}'
        lines.append(f"    {p.name} = Parameter({p.default!r}, {p.bounds!r}, {text})")
    return lines


def _write_body(term: Term) -> list[str]:
    """The lines of the effect that edit the equations."""
    shaped = [f"{s.name}={PREFIX}{s.name}" for s in term.signal.shapes]
    clock = ["clock=clock(eq)"] if term.clock else []
    sized = [f"{s.name}={PREFIX}{s.name}" for s in term.balance.sizes]
    return [
        f'        g = eq.define("{PREFIX}signal", signal({", ".join(["eq", *clock, *shaped])}),'
        ' "g")',
        f"        balance({', '.join(['eq', 'g', *sized])})",
    ]
