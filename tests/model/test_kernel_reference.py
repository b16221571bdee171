"""Every model of the catalogue against what kernels compiled by Numba gave, stored before those
went.
"""

import json

import kernel_reference
import numpy as np
import pytest

CASES = [*kernel_reference.stored()]
# relative: by which candidates are moved, to see what they make of a rounding
NUDGES = (1e-12, -1e-12, 3e-12)
CHAOTIC = 1e-8  # relative: of a candidate whose sums follow a nudge so far, digits say nothing
SAME = 1e-11  # relative, beside ten times what a nudge does
LANES = (1, 2, 7, 8, 9, 57)


def named(case):
    of = case[0]
    parts = [of["domain"], of["motor"], of["static"], *of["effects"], of["integration"]]
    return " ".join(parts).replace(" classical", "")


@pytest.mark.parametrize("case", CASES, ids=named)
def test_a_model_gives_what_its_kernel_by_numba_gave(case):
    of, before = case
    model, values = kernel_reference.model(of), before["values"].astype(float)
    now, *nudged = (
        kernel_reference.played(model, values * (1 + nudge)) for nudge in (0.0, *NUDGES)
    )
    fits = before["miss"] == 0
    assert np.array_equal(now["miss"] == 0, fits)
    with np.errstate(all="ignore"):
        moved = np.max([np.abs(one["sums"] - now["sums"]) for one in nudged], axis=0)
        chaotic = (moved > CHAOTIC * np.abs(now["sums"])).any(axis=(0, 1))
        compared = np.broadcast_to(fits[:, None] & ~chaotic, moved.shape)
        off = np.abs(now["sums"] - before["sums"])
        allowed = SAME * np.abs(before["sums"]) + 10 * moved
    finite = np.isfinite(before["sums"])
    assert np.array_equal(np.isfinite(now["sums"])[compared], finite[compared])
    assert (off <= allowed)[compared & finite].all()
    assert (compared & finite)[..., :25].any(axis=(1, 2)).all()
    shown = compared.all(axis=(0, 1)) & finite.all(axis=(0, 1))
    shown = shown[list(kernel_reference.SHOWN)]
    size = np.abs(before["outputs"][:, shown]).max(initial=1.0)
    assert np.abs(now["outputs"] - before["outputs"])[:, shown].max(initial=0.0) < SAME * size


@pytest.mark.parametrize("case", CASES[:: len(CASES) // 12], ids=named)
def test_a_lane_has_its_bits_wherever_it_stands_and_in_any_batch(case):
    of, before = case
    model, values = kernel_reference.model(of), before["values"].astype(float)
    whole = kernel_reference.played(model, values)
    fits = whole["miss"] == 0
    for n in LANES:
        some = (np.arange(n) * 5 + 3) % len(values)
        part = kernel_reference.played(model, values[some], shown=False)
        assert np.array_equal(part["miss"], whole["miss"][:, some])
        sums = np.where(fits[:, None], whole["sums"], 0.0)[..., some]
        assert np.array_equal(
            np.where(fits[:, None, some], part["sums"], 0.0), sums, equal_nan=True
        )


def test_the_reference_has_refused_and_diverging_candidates_of_both_domains():
    for domain in ("phasors", "waves"):
        mine = [before for of, before in CASES if of["domain"] == domain]
        assert len(mine) > 40
        assert sum((before["miss"] > 0).sum() for before in mine) > 100
        assert sum((~np.isfinite(before["sums"])).sum() for before in mine) > 10
    assert {"double_cage", "motor_groups", "none"} <= {of["motor"] for of, _ in CASES}
    assert any(of["integration"] == "printed" for of, _ in CASES)
    assert json.dumps([of for of, _ in CASES]).count("library") >= 2
