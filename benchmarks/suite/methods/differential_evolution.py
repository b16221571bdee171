"""SciPy's differential evolution on the error of P and Q, as toolboxes of grid operators fit."""

from scipy.optimize import differential_evolution
from third_order import ThirdOrderLoad


def fit(events):
    load = ThirdOrderLoad(events)
    found = differential_evolution(
        lambda candidates: load.measure_errors(candidates.T),
        list(zip(load.lower, load.upper, strict=True)),
        rng=0,
        maxiter=300,
        popsize=15,
        polish=False,
        vectorized=True,
        updating="deferred",
    )
    return load, found.x


def predict(model, event):
    load, values = model
    return load.predict(values, event)
