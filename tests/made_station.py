"""A station that tests write themselves: COMTRADE files of a recorder's years, every load on one
bus, each of the same machines in all dips, with more or fewer of them running by hour and weekday.
"""

import functools
from datetime import datetime, timedelta

import numpy as np
from made_recordings import RATE, recording, waves

import tractexp
from tractexp.filetypes import comtrade_writer
from tractexp.model.drive import Drive, Excitation

START, YEARS = datetime(2021, 1, 4), 5.0
MACHINES = (  # constants per unit of the motors' power
    {"T_prime": 0.12, "X_prime": 0.15, "C": 0.9, "M": 0.011},
    {"T_prime": 0.08, "X_prime": 0.18, "C": 0.92, "M": 0.008},
    {"T_prime": 0.16, "X_prime": 0.13, "C": 0.88, "M": 0.014},
    {"T_prime": 0.1, "X_prime": 0.2, "C": 0.91, "M": 0.006},
)
STATICS = ({"p_v": 1.4, "q_v": 3.0}, {"p_v": 1.0, "q_v": 2.4}, {"p_v": 1.7, "q_v": 3.4})
SHARES, SWING, WEEKEND, SCATTER = (0.5, 0.4, 0.6, 0.45), 0.12, -0.1, 0.02


def expect_share(load, moment):
    """The motors' part of P at a moment, without what differs by chance."""
    hour = moment.hour + moment.minute / 60
    by_hour = SWING * np.cos(2 * np.pi * (hour - 14) / 24)
    return SHARES[load % 4] + by_hour + (WEEKEND if moment.weekday() > 4 else 0.0)


def draw_load(load, share, power, U):
    """P and Q (2, N) [pu] of a load that draws `power` before its voltage U (N,) [pu] dips."""
    torque = share * power.real
    machine = MACHINES[load % 4]
    known = {**machine, **STATICS[load % 3], "T_m": torque}
    known |= {"X_prime": machine["X_prime"] / torque, "M": machine["M"] * torque}
    model = compose_model()
    values = np.array([[known[name] for name in model.names]])
    event = Excitation(1 / RATE, U, U, U, 1.0, power.real, power.imag)
    return model.simulate(Drive.from_events([event]), values, 2).outputs[:, 0]


@functools.cache
def compose_model():
    return tractexp.compose().model


def draw_voltage(depth, duration, length=1.6, start=0.5, edge=0.01):
    """Times and voltage (N,) [s, pu] of a dip with straight edges."""
    t = np.arange(round(length * RATE)) / RATE
    fall, back = (np.clip((t - at) / edge, 0.0, 1.0) for at in (start, start + duration))
    return t, 1 - depth * (fall - back)


def make_station(folder, loads=2, dips=12, faulty=(), seed=0, noise=1e-3, write=True):
    """Write so many dips of so many loads; those `faulty` by number with a current that the
    recorder clips. {(load, dip): share} and the moments of the dips.
    """
    rng = np.random.default_rng(seed)
    shares, moments = {}, []
    for k in range(dips):
        moment = START + timedelta(days=365 * YEARS * (k + rng.random()) / dips)
        moments.append(moment)
        t, U = draw_voltage(rng.uniform(0.15, 0.6), rng.uniform(0.08, 0.25))
        rows, names = [], ["UA", "UB", "UC"]
        for load in range(loads):
            share = expect_share(load, moment) + SCATTER * rng.standard_normal()
            size = rng.uniform(0.5, 1.0)
            P, Q = draw_load(load, share, 0.9 + 0.35j, U)
            values = waves(t, U, size * P, size * Q)
            rows += [*values[3:]] if rows else [*values]
            names += [f"T{load + 1} I{phase}" for phase in "ABC"]
            shares[load, k] = share
        values = np.array(rows)
        values += (
            noise * np.abs(values).max(axis=1, keepdims=True) * rng.standard_normal(values.shape)
        )
        if k in faulty:
            clip_currents(values[3:])
        file = folder / f"{moment:%Y}" / f"{moment:%Y%m%d_%H%M%S}.cfg"
        if write:
            comtrade_writer.write(recording(values, names, start=moment), file, "BINARY", 1999)
    return shares, moments


def clip_currents(currents):
    """Cut currents (K, N) off where a recorder's converter ends, a tenth above what is drawn before
    the dip.
    """
    top = 1.1 * np.abs(currents[:, : currents.shape[1] // 5]).max(axis=1, keepdims=True)
    np.clip(currents, -top, top, out=currents)
