"""What connections and estimators must satisfy."""

from collections.abc import Callable

import numpy as np

from tractexp.record.phasor_measurement import measure_fundamental
from tractexp.recording import Connection, Estimator

RATE, NOMINAL, F = 4000.0, 50.0, 48.7  # Hz: of the samples, of the grid, of the test
ROUNDING_ERROR = 1e-6


def makes_three_phases_or_one(cls: type[Connection]) -> None:
    """Voltages and currents are as many, three or one, each combines at least one channel with
    finite factors.
    """
    connection = cls()
    V, I = connection.voltage(), connection.current()
    assert len(V) == len(I), (
        f"'{cls.name}' makes {len(V)} voltages and {len(I)} currents; they must be as many"
    )
    assert len(V) in (1, 3), f"'{cls.name}' makes {len(V)} voltages: a load has three phases or one"
    for what, matrix in (("voltage", V), ("current", I)):
        assert np.isfinite(matrix).all(), f"'{cls.name}' makes a {what} of channels times {matrix}"
        assert np.any(matrix != 0, axis=1).all(), f"'{cls.name}' makes a {what} of no channel"


def is_exact_in_steady_state(cls: type[Estimator]) -> None:
    """The phasor of a steady sinusoid is exact where its frequency is given."""
    over = cls().averager(RATE, NOMINAL)
    count = 2 * over.reach + 200
    x = np.sqrt(2) * np.cos(2 * np.pi * F / RATE * np.arange(count) + 0.7)
    X = measure_fundamental(x, RATE, F, np.arange(over.reach, count - over.reach), over.means)
    off = np.abs(X - np.exp(0.7j)).max()
    assert off < ROUNDING_ERROR, (
        f"'{cls.name}' is {off:.2g} off a sinusoid of {F:g} Hz and magnitude 1"
    )


def keeps_a_window_of_sum_one_about_its_center(cls: type[Estimator]) -> None:
    """The window a record keeps has weights of sum 1, symmetric about the time stamp, within its
    length.
    """
    estimator = cls()
    window, half = estimator.window(NOMINAL), estimator.half(NOMINAL)
    assert np.isclose(window.weights.sum(), 1), (
        f"the weights of '{cls.name}' have the sum {window.weights.sum():g}"
    )
    middle = float(window.weights @ window.at)
    assert abs(middle) < 1e-9, (
        f"the window of '{cls.name}' has its center {1000 * middle:.3g} ms off its stamp"
    )
    assert np.abs(window.at).max() <= half, (
        f"the window of '{cls.name}' is longer than twice its half"
    )


CONNECTION: tuple[Callable[..., None], ...] = (makes_three_phases_or_one,)
ESTIMATOR: tuple[Callable[..., None], ...] = (
    is_exact_in_steady_state,
    keeps_a_window_of_sum_one_about_its_center,
)
SUITES = ((Connection, (), CONNECTION), (Estimator, (), ESTIMATOR))
