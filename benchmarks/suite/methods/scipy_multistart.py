"""SciPy's bounded least squares from twenty random starts."""

import numpy as np
from scipy.optimize import least_squares
from third_order import ThirdOrderLoad

STARTS, SEED = 20, 0


def fit(events):
    load = ThirdOrderLoad(events)
    rng = np.random.default_rng(SEED)
    starts = rng.uniform(load.lower, load.upper, (STARTS, len(load.lower)))
    width = load.upper - load.lower
    ends = [
        least_squares(
            load.find_residuals, start, bounds=(load.lower, load.upper), x_scale=width, max_nfev=60
        )
        for start in starts
    ]
    return load, min(ends, key=lambda end: end.cost).x


def predict(model, event):
    load, values = model
    return load.predict(values, event)
