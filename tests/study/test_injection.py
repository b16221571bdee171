"""Perturbations of the balances, `Injection`."""

import numpy as np
from wave_records import case, events

from tractexp.configuration.plugin import get
from tractexp.inference.injection import Injection
from tractexp.inference.problem import Problem
from tractexp.model.model import compose
from tractexp.record import convert_to_waves


def test_a_push_of_waveforms_is_the_terminal_current():
    seed = 4, 0
    (event,) = events(case(seed, 1), seed)
    static = get("model/static", "constant_impedance")()
    model = compose(get("model/motor", "none")(), static, [Injection()], domain="waves")
    problem = Problem(model, [event], substeps=1)
    pushes = [
        {"window_on": -500.0, "window_off": 500.0, **push}
        for push in ({}, {"push_P": 0.1}, {"push_Q": 0.1})
    ]
    values = np.array([[push.get(name, 0.0) for name in problem.space.names] for push in pushes])
    drawn = model.simulate(problem.drive, values, 1).outputs
    moved = (drawn[0] + 1j * drawn[1] - drawn[0, 0] - 1j * drawn[1, 0]) * convert_to_waves(
        event
    ).turn.conj()
    assert np.abs(moved[1] - 0.1).max() < 1e-9
    assert np.abs(moved[2] + 0.1j).max() < 1e-9
