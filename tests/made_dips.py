"""Dips of the independent generator of `tests/oracle/hidden_effects`, as events that one
investigates.
"""

import tractexp
from hidden_effects import Case, Noise, Recorder, make
from tractexp.configuration.plugin import get
from tractexp.model.model import compose
from tractexp.record import Record, detect

FEW = ("stator_resistance", "speed_dependent_torque", "exponential_recovery")
SLOW = Recorder(rate=250.0, samples=500)  # an investigation takes as long as there are samples
FAST = Recorder()  # 500 samples a second, where half of them do not show what is to be shown
QUIET, LOUD = Noise(0.002), Noise(0.005)


def base():
    """The model without any effect, whose motor and static load are those of the generator."""
    return compose(get("model/motor", "electromechanical")(), get("model/static", "exponential")())


def events(effect=None, size=1.0, seed=3, count=2, noise=QUIET, recorder=SLOW, **settings):
    """So many dips of one load that has the effect."""
    records = make(
        Case(effect, size, events=count, noise=noise, recorder=recorder, **settings), seed
    )
    return [
        detect(Record(f"event{k + 1}", **r, source=f"made {k + 1}").check())
        for k, r in enumerate(records)
    ]


def investigate(made, validate=(), effects=FEW, **settings):
    """What is found missing in them by a user who tests few effects."""
    settings = {"progress": False, **settings}
    return tractexp.investigate(made, validate=validate, effects=effects, **settings)
