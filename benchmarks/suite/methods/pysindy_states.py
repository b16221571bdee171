"""Sparse identification of nonlinear dynamics (Brunton, Proctor and Kutz 2016; PySINDy): the
derivatives of P and Q as sparse polynomials of P, Q and U.
"""

import warnings

import numpy as np
import pysindy

DEGREE, THRESHOLD = 2, 0.1


def fit(events):
    model = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=THRESHOLD),
        feature_library=pysindy.PolynomialLibrary(degree=DEGREE),
        differentiation_method=pysindy.SmoothedFiniteDifference(),
    )
    steps = [event.t[1] - event.t[0] for event in events]
    states = [np.stack([event.P, event.Q], axis=1) for event in events]
    with warnings.catch_warnings(action="ignore"):
        model.fit(states, t=min(steps), u=[event.U[:, None] for event in events])
    return model


def predict(model, event):
    """From the state before the dip on; a polynomial that diverges ends in infinity."""
    before = event.power_before
    state = np.array([before.real, before.imag])
    step, states = event.t[1] - event.t[0], []
    for voltage in event.U:
        states.append(state)
        with np.errstate(all="ignore"):
            slope = np.asarray(model.predict(state[None], u=np.array([[voltage]])))[0]
        state = state + step * slope
        if not np.abs(state).max() < 1e3:
            state = np.full(2, np.inf)
            states += [state] * (len(event.t) - len(states))
            break
    return tuple(np.array(states).T)
