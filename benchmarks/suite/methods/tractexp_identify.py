"""This program's identification: the paper's load by its default search, then the estimate."""

import numpy as np
from third_order import read_dip

import tractexp


def fit(events):
    return tractexp.identify([read_dip(e) for e in events], check_intervals=False, progress=False)


def predict(model, event):
    response = model.predict(read_dip(event))
    return response.P, response.Q, np.array(response.band) if response.band else None
