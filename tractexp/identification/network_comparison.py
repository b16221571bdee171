"""How good a model of these records can get: its error over that of the best linear network of few
poles.

A network knows no physics, has as many poles as the fitted events ask for, and leaves noise and
what is not linear. A model that leaves much more lacks something; one that leaves less knows
something that no linear network can.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tractexp.domain import find_domain
from tractexp.errors import UserError
from tractexp.identification.fit import TRAIN, Fit, tabulate_model_errors
from tractexp.identification.linear_network import BlackBox, choose_network, fit_black_boxes
from tractexp.inference.model_error import STALL, format_percent
from tractexp.text.wording import count_noun


def compare_with_network(fits: Sequence[Fit], error: Mapping[str, Any]) -> dict[str, Any]:
    """The error of a model beside that of the best linear network: `linear_network` of
    `result.json`.

    Parameters
    ----------
    fits : sequence of Fit
        What the model calculates of all events, the fitted ones first.
    error : mapping
        The `model_error` of the result.

    Returns
    -------
    dict
        `poles` [{decay [1/s], frequency [Hz], admittance [pu]}], `chosen_by`, `model_error` and
        `events` as those of the result, `ratio` of the errors on the events held out, else on those
        fitted, and the `sentence`. Where no network can be fitted the sentence alone is there.
    """
    split = sum(fit.role == TRAIN for fit in fits)
    try:
        box, played = play_network(fits)
    except UserError as why:
        return {"sentence": f"no linear network stands beside it: {why}"}
    own = tabulate_model_errors(played)
    judged = slice(split, None) if split < len(fits) else slice(split)
    left, model = (e["held_out"]["value"] if e["held_out"] else e["value"] for e in (own, error))
    ratio = model / left if left > 0 and np.isfinite(model) else None
    dips = "dips" if len(fits[judged]) > 1 else "dip"
    on = f"on the {dips} it {'never saw' if own['held_out'] else 'was fitted to'}"
    sentence = _describe_ratio(ratio, model, len(box.poles), on)
    if np.isfinite(model):
        sentence += _describe_currents(fits[judged], played[judged])
    return {
        "poles": box.poles,
        "chosen_by": box.chosen_by,
        "model_error": own,
        "events": [one.to_dict() for one in played],
        "ratio": ratio,
        "sentence": sentence,
    }


def play_network(fits: Sequence[Fit]) -> tuple[BlackBox, list[Fit]]:
    """The best linear network of the fitted events, and what it calculates of all of them.

    Parameters
    ----------
    fits : sequence of Fit
        The fitted events first.

    Returns
    -------
    BlackBox
        The network.
    list of Fit
        In the order of `fits`.

    Raises
    ------
    UserError
        Where none can be fitted.
    """
    events = [fit.waves or fit.event for fit in fits]
    split = sum(fit.role == TRAIN for fit in fits)
    box = choose_network(fit_black_boxes(find_domain(events[0]), events[:split]), events[:split])
    pairs = zip(fits, events, strict=True)
    return box, [Fit(role=fit.role, **vars(box.play(event))) for fit, event in pairs]


def describe_poles(poles: Sequence[dict[str, float]]) -> str:
    """The poles of a network as text; "none" of one without.

    Examples
    --------
    >>> describe_poles([{"decay": 17.6, "frequency": 47.5}])
    '17.6/s at 47.5 Hz'
    """
    return ", ".join(f"{p['decay']:.3g}/s at {p['frequency']:.3g} Hz" for p in poles) or "none"


def describe_network(poles: int) -> str:
    """What the best network of so many poles is called in a sentence.

    Examples
    --------
    >>> describe_network(0), describe_network(2)
    ('the best linear network without poles', 'the best linear network of 2 poles')
    """
    return (
        f"the best linear network {'of ' + count_noun(poles, 'pole') if poles else 'without poles'}"
    )


def _describe_ratio(ratio: float | None, model: float, poles: int, on: str) -> str:
    """How the model's error stands beside that of the best network, on the events that `on`
    names.
    """
    network = describe_network(poles)
    if not np.isfinite(model):
        return f"{STALL} in the physical model {on}, beside {network}"
    if ratio is None:
        return (
            f"{network} leaves no more than noise {on}, the physical model"
            f" {format_percent(model)} of the response"
        )
    return f"the physical model leaves {ratio:.2g} times what {network} does {on}"


def _describe_currents(fits: Sequence[Fit], played: Sequence[Fit]) -> str:
    """The clause that compares the errors of the currents, which hold more than P and Q; "" of
    phasors.
    """
    model, left = (
        float(np.sqrt(np.mean([(one.epsilon_i or 0.0) ** 2 for one in of])))
        for of in (fits, played)
    )
    if not left:
        return ""
    return (
        f", and of the currents {model / left:.2g} times (epsilon_i {format_percent(model)} against"
        f" {format_percent(left)})"
    )
