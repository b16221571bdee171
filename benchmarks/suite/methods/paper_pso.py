"""Particle swarm optimization with the paper's settings, and nothing after it."""

from third_order import ThirdOrderLoad

from tractexp.configuration.plugin import build
from tractexp.identification.search import search


def fit(events):
    load = ThirdOrderLoad(events)
    return load, search(load.problem, build("optimizer", {"name": "pso"}), 0).values


def predict(model, event):
    load, values = model
    return load.predict(values, event)
