"""Sparse identification of nonlinear dynamics (Brunton, Proctor and Kutz 2016; PySINDy): the next P
and Q as sparse polynomials of these and of the voltage now and next.

All are deviations from before the dip. Of several degrees and thresholds the model is taken that
simulates the given dips best: one step ahead they all look alike.
"""

import itertools
import warnings

import numpy as np
import pysindy

DEGREES, THRESHOLDS = (1, 2), (1e-4, 1e-3, 1e-2, 3e-2)
RIDGE = 1e-6
DIVERGED = 1e3  # pu


def fit(events):
    states = [np.stack([event.P, event.Q], axis=1) - split_power(event) for event in events]
    inputs = [find_inputs(event) for event in events]

    def measure_error(model):
        pairs = zip(states, inputs, strict=True)
        return sum(float(np.nansum((simulate(model, u) - x) ** 2)) for x, u in pairs)

    tried = itertools.product(DEGREES, THRESHOLDS)
    return min((fit_polynomial(states, inputs, *one) for one in tried), key=measure_error)


def predict(model, event):
    P, Q = (simulate(model, find_inputs(event)) + split_power(event)).T
    return P, Q


def split_power(event):
    return np.array([event.power_before.real, event.power_before.imag])


def find_inputs(event):
    """The voltage's deviation at each sample and at the next one (N, 2) [pu]."""
    deviation = event.U - event.U[: event.start].mean()
    return np.stack([deviation, np.append(deviation[1:], deviation[-1])], axis=1)


def fit_polynomial(states, inputs, degree, threshold):
    """Coefficients (2, k) and the powers (k, 4) that they belong to."""
    library = pysindy.PolynomialLibrary(degree=degree, include_bias=False)
    optimizer = pysindy.STLSQ(threshold=threshold, alpha=RIDGE)
    found = pysindy.DiscreteSINDy(optimizer=optimizer, feature_library=library)
    with warnings.catch_warnings(action="ignore"):  # a threshold above all that there is
        found.fit(states, t=1, u=inputs)
    return np.asarray(found.coefficients()), found.feature_library.powers_


def simulate(model, inputs):
    """Deviations (N, 2) [pu] of P and Q from the steady state on; what diverges is held."""
    coefficients, powers = model
    states = np.zeros((len(inputs), 2))
    for k, now in enumerate(inputs[:-1]):
        features = np.prod(np.append(states[k], now) ** powers, axis=1)
        states[k + 1] = np.clip(coefficients @ features, -DIVERGED, DIVERGED)
    return states
