"""Arrays of numbers as a page carries them: short, and no worse than a screen shows them."""

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from tractexp.text import quoting

GREATEST_CODE = 32767  # the greatest of 16 bits; the least stands for a gap


def share_arrays(plain: dict[str, Any]) -> dict[str, Any]:
    """A chart whose traces name their packed arrays by number, so that curves of one record have
    their times once, and short: values in 16 bits, uniform times by start and step.
    """
    arrays: list[dict[str, str]] = []
    exact = set[int]()

    def share(trace: dict[str, Any], key: str) -> Any:
        """A reference to a packed array in place of the array; other values as they are."""
        value = trace[key]
        if not (isinstance(value, dict) and "bdata" in value):
            return value
        if value not in arrays:
            arrays.append(value)
        number = arrays.index(value)
        axis = plain["layout"][f"{key}axis{trace.get(f'{key}axis', '')[1:]}"]
        if axis.get("type") == "log":
            exact.add(number)
        return {"array": number}

    traces = [
        trace | {key: share(trace, key) for key in ("x", "y") if key in trace}
        for trace in plain["data"]
    ]
    short = [a if k in exact else _shorten_array(a) for k, a in enumerate(arrays)]
    return {**plain, "data": traces, "arrays": short}


def _shorten_array(packed: dict[str, str]) -> dict[str, Any]:
    """A packed array in fewer letters: no worse than a screen shows it."""
    kind = np.dtype(f"<{packed['dtype']}")
    values = np.frombuffer(base64.b64decode(packed["bdata"]), kind).astype(float)
    if kind.itemsize < np.dtype(float).itemsize:
        return {"dtype": "i2"} | _encode_values(values)
    count = len(values)
    step = (values[-1] - values[0]) / (count - 1) if count > 1 else 0.0
    even = values[0] + step * np.arange(count) if count else values
    if count and np.allclose(values, even, rtol=0, atol=1e-6 * abs(step)):
        return {"start": float(values[0]), "step": float(step), "count": count}
    return packed


def encode_curve(start: float, step: float, y: np.ndarray) -> dict[str, Any]:
    """Values (n,), every `step` from `start` on."""
    return {"start": start, "step": step} | _encode_values(y)


def _encode_values(y: np.ndarray) -> dict[str, Any]:
    """Values (n,) in 16 bits between the lowest and the highest; nan is a gap."""
    finite = np.isfinite(y)
    low, high = (float(y[finite].min()), float(y[finite].max())) if finite.any() else (0.0, 0.0)
    offset, scale = (low + high) / 2, max((high - low) / (2 * GREATEST_CODE), 1e-300)
    held = np.where(
        finite, np.round((np.where(finite, y, offset) - offset) / scale), -GREATEST_CODE - 1
    ).astype("<i2")
    packed = base64.b64encode(held.tobytes()).decode()
    return {"bdata": packed, "offset": offset, "scale": scale}


def pack_numbers(values: np.ndarray, kind: str) -> dict[str, str]:
    """Numbers as Plotly's typed arrays: exact, and a third of the length of their digits."""
    return {
        "dtype": kind,
        "bdata": base64.b64encode(np.asarray(values, dtype=f"<{kind}").tobytes()).decode(),
    }


def list_values(values: Sequence[Any] | np.ndarray) -> list[Any]:
    """Values for JSON: text is quoted, nan is a gap."""
    plain = values.tolist() if isinstance(values, np.ndarray) else list(values)
    return [quoting.html(v) if isinstance(v, str) else None if v != v else v for v in plain]
