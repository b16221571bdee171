"""Resistance and inductance in series, which no code of the product integrates, are named where
they are in a static load, and not where they are not.
"""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tractexp

OMEGA, RATE = 100 * np.pi, 500.0
DIPS = ((0.35, 0.12), (0.2, 0.2), (0.45, 0.15))  # depth [pu], length [s]
NOISE = 0.001  # pu


def find_size(t, depth, length):
    """The voltage's size [pu], with edges of a cycle as a recorder has them."""
    rise = [np.clip((t - at) / 0.02, 0.0, 1.0) for at in (0.0, length)]
    shape = [x**2 * (3 - 2 * x) for x in rise]
    return 1 - depth * (shape[0] - shape[1])


def record(dip, rng, share):
    """A static load of 1 pu of fixed elements, of which a share is the branch."""
    t = np.arange(-0.3, 0.8, 1 / RATE)
    R, X = np.array([0.8, 0.6]) * 0.8 / share if share else (0.0, 0.0)
    U = find_size(t, *dip)
    P, Q = (1 - share) * U**2, 0.2 * U**2
    if share:
        L = X / OMEGA
        balance = lambda now, i: (find_size(now, *dip) - (R + 1j * X) * i) / L  # noqa: E731
        begun = [1 / (R + 1j * X)]
        settings = {"rtol": 1e-9, "atol": 1e-11, "max_step": 2e-3}
        (i,) = solve_ivp(balance, (t[0], t[-1]), begun, "DOP853", t, **settings).y
        P, Q = P + (U * np.conj(i)).real, Q + (U * np.conj(i)).imag
    noise = NOISE * rng.standard_normal((2, len(t)))
    P, Q = P + noise[0], Q + noise[1]
    (event,) = tractexp.read(t=t, U=U, P=P, Q=Q, name=f"dip of {dip}", frequency=50.0)
    return event


@pytest.mark.parametrize(
    ("share", "verdict", "named"), [(0.4, "named", ["inductive_static_load"]), (0.0, "none", [])]
)
def test_a_branch_of_the_static_load_is_named_where_it_is(share, verdict, named):
    rng = np.random.default_rng(3)
    events = [record(dip, rng, share) for dip in DIPS]
    model = tractexp.compose(motor="none", static="exponential")
    found = tractexp.investigate(events[:2], model, validate=events[2:], progress=False)
    assert (found.verdict, found.content["effects"]) == (verdict, named)
