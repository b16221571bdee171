"""This program's investigation: the paper's load with what is found missing. Of several dips the
last is held out. Only what is `named`, or tied, is said to be missing; a candidate is silence.
"""

import numpy as np
from third_order import read_dip

import tractexp


def fit(events):
    dips = [read_dip(event) for event in events]
    split = max(1, len(dips) - 1)
    return tractexp.investigate(dips[:split], validate=dips[split:], progress=False)


def predict(model, event):
    response = model.fit.predict(read_dip(event))
    return response.P, response.Q, np.array(response.band) if response.band else None


def name(model):
    return model.content["name_sets"] if model.verdict in ("named", "tied") else []
