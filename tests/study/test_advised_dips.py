"""The further dip that a fit is advised to be given, `advise`: what it promises it then gives."""

import re
from dataclasses import replace

import numpy as np
import pytest
import uncertainty as study
from printed_events import problem, records

from tractexp.configuration.plugin import get
from tractexp.errors import UserError
from tractexp.identification.adequacy import Adequacy, Grade
from tractexp.identification.advice import advise
from tractexp.identification.plan import DipShape, forecast_intervals
from tractexp.identification.profile import check_by_profiles
from tractexp.model.model import compose

GOOD = Adequacy(Grade.ADEQUATE, "the model describes this load: use it", 0.5)


def dip(depth, seed):
    """One with noise of 0.6 %, under a name of its own."""
    (event,) = records((depth,), 0.006, seed)
    return replace(event, record=replace(event.record, name=f"dip {seed}"))


def test_a_further_dip_as_advised_gives_what_was_promised_and_a_repetition_does_not():
    """C is ± 8 % by curvature and weak only because its profile runs into the bound."""

    def judged(*dips):
        fitted = problem([dip(*one) for one in dips])
        return check_by_profiles(study.judged(fitted, study.TYPICAL).uncertainty)

    known = judged((0.2, 1))
    (said,) = [sentence for sentence in advise(known, GOOD) if sentence.startswith("for C:")]
    assert 0.07 < known.half[2] / known.values[2] < 0.1
    assert known.profiled["C"][1] == 0.99
    low, high, goal = re.search(
        r"dip of (\S+) to (\S+) % for 234 ms.* ± (\S+) % or better", said
    ).groups()
    assert 20 < float(low) < 60 < float(high)  # as deep as the one recorded is not among them
    assert (
        "its interval now reaches its bound 0.99, and if it does so then, ask whether"
        " model.bounds.C" in said
    )
    advised, repeated = judged((0.2, 1), (0.6, 13)), judged((0.2, 1), (0.2, 12))
    assert advised.verdicts["C"].word == study.IDENTIFIED
    assert advised.half[2] / advised.values[2] < 1.1 * float(goal) / 100
    assert repeated.half[2] / repeated.values[2] > 1.3 * float(goal) / 100


def test_advice_for_a_model_that_no_planned_dip_can_hold_has_no_figures():
    """Such a model reads more than the voltage, so that nothing can be forecast; what is open must
    be said still.
    """
    static, f = get("model/static", "exponential_frequency")(), np.full(1000, 50.0)
    (event,) = records((0.2,), 0.015, seed=5)
    event = replace(event, record=replace(event.record, f=f + 0.2 * (event.record.t > 0.3)))
    case = problem([event], load=compose(get("model/motor", "electromechanical")(), static))
    known = study.judged(case, np.array([*study.TYPICAL, 0.0, 0.0])).uncertainty
    said = advise(known, GOOD)[-1]
    words = {name: verdict.word for name, verdict in known.verdicts.items()}
    poor = [name for name, word in words.items() if word in (study.WEAK, study.UNIDENTIFIED)]
    assert "q_f" in poor
    assert said.startswith(
        f"for {', '.join(poor)}: record a dip of another depth and fit it together"
    )
    sentence = (
        "a voltage alone, but of this model the model/static 'exponential_frequency' reads f:"
        " nothing can be planned"
    )
    with pytest.raises(UserError, match=sentence):
        forecast_intervals(case, known.values, DipShape.from_event(event))
