"""The best linear network of few poles from the voltage to the current: no physics."""

from third_order import read_dip

import tractexp


def fit(events):
    return tractexp.linear_network([read_dip(event) for event in events], progress=False)


def predict(model, event):
    response = model.predict(read_dip(event))
    return response.P, response.Q
