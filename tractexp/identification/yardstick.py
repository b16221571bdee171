"""How good a model of these records can get: its error over that of the best linear network of few poles.

A network knows no physics, has as many poles as predict best, and leaves harmonics, noise and what is not linear. A
model that leaves much more lacks something; one that leaves less knows something that no linear network can.
"""

from collections.abc import Sequence
from typing import Any

from tractexp.domain import domain_of
from tractexp.errors import UserError
from tractexp.identification.linear_network import best
from tractexp.identification.model_error import in_percent
from tractexp.identification.result import TRAIN, Fit, model_errors
from tractexp.wording import counted


def yardstick(fits: Sequence[Fit], error: dict[str, Any]) -> dict[str, Any]:
    """The `linear_network` of `result.json`, for a model that leaves `error` (its `model_error`) of these events.

    `poles` [{decay [1/s], frequency [Hz]}], `chosen_by`, `model_error` as that of the result, `ratio` of the errors on
    the events held out, else on those fitted; and the `sentence`, which alone is there where no network can be fitted.
    """
    events = [fit.waves or fit.event for fit in fits]
    split = sum(fit.role == TRAIN for fit in fits)
    try:
        box = best(domain_of(events[0]), events[:split], events[split:])
    except UserError as why:
        return {"sentence": f"no linear network stands beside it: {why}"}
    own = model_errors([Fit(role=fit.role, **vars(box.play(e))) for fit, e in zip(fits, events, strict=True)])
    held_out = bool(own["held_out"])
    left, model = (e["held_out"]["value"] if held_out else e["value"] for e in (own, error))
    ratio = model / left if left > 0 else None
    on = on_dips(held_out, len(events) - split if held_out else split)
    sentence = _sentence(ratio, model, len(box.poles), on)
    return {"poles": box.poles, "chosen_by": box.chosen_by, "model_error": own, "ratio": ratio, "sentence": sentence}


def poles_in_words(poles: Sequence[dict[str, float]]) -> str:
    """'18/s at 47 Hz, 45/s at 3.5 Hz'; "none" of a network without poles."""
    return ", ".join(f"{p['decay']:.2g}/s at {p['frequency']:.2g} Hz" for p in poles) or "none"


def network_in_words(poles: int) -> str:
    """What the best network of so many poles is called."""
    return f"the best linear network {'of ' + counted(poles, 'pole') if poles else 'without poles'}"


def on_dips(held_out: bool, events: int) -> str:
    """Where an error was measured."""
    return f"on the dip{'s' * (events > 1)} it {'never saw' if held_out else 'was fitted to'}"


def _sentence(ratio: float | None, model: float, poles: int, on: str) -> str:
    network = network_in_words(poles)
    if ratio is None:
        return f"{network} leaves no more than noise {on}, the physical model {in_percent(model)} of the response"
    return f"the physical model leaves {ratio:.2g} times what {network} does {on}"
