"""The generated code of a model with effects beside it, `kernels`: the same numbers from each, in
steps as short as a fit asks for.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from made_context import bench
from made_dips import FAST, base, events, investigate

from tractexp.errors import RefusedEffect
from tractexp.inference import kernels
from tractexp.inference.injection import PUSHES
from tractexp.inference.kernels import Family
from tractexp.inference.problem import Problem


def test_a_fit_in_the_stiff_part_of_the_box_asks_for_the_steps_of_the_whole_box(monkeypatch):
    monkeypatch.setattr(kernels, "LONGEST_SEARCH_STEP", 1.0)
    made = bench(base(), events(recorder=FAST))
    own, at = made.kernels, made.coordinates
    usual = own.bare.space.from_unit(at.null[at.base])[None]
    fast = usual.copy()
    fast[0, own.bare.space.names.index("T_prime")] = 0.006
    fast[0, own.bare.space.names.index("M")] = 0.001
    assert own.substeps < own.box_substeps
    assert own.substeps < own.bare.steps_at(fast)
    assert own.too_coarse(np.concatenate([usual, fast]))
    assert not own.too_coarse(usual)


def test_an_investigation_starts_anew_with_shorter_steps_where_its_fits_ask_for_them(monkeypatch):
    monkeypatch.setattr(kernels, "LONGEST_SEARCH_STEP", 1.0)
    monkeypatch.setattr(Problem, "steps_at", lambda own, values: 256)
    said: list[str] = []
    made = events(count=1, recorder=FAST)
    found = investigate(made, effects=("stator_resistance",), progress=said.append)
    own = found.steps.context.kernels
    assert said.count("the fits lie where the motor is fast: again with shorter steps") == 1
    assert (
        own.substeps
        == own.box_substeps
        > own.bare.with_steps_of(kernels.STEP_SHARE).step.substeps.max()
    )


def test_candidates_at_their_null_leave_the_base_model():
    """All kernels by which they are tested, every one at its null, give the base
    model's residuals.
    """
    made = bench(base(), events(), only=())
    alone, null = made.kernels.bare, made.coordinates.null
    values = alone.space.from_unit(null[made.coordinates.base])
    response = alone.model.simulate(alone.drive, alone.full(values), made.problem.step.substeps)
    for beside in ("stator_resistance", "feeder_impedance", PUSHES):
        rows = made.residuals(null[None], (), beside)[0]
        assert rows[0] == pytest.approx(response.P[0] - alone.drive.measurements[0], abs=1e-10)


@pytest.mark.parametrize("beside", ["stator_resistance", "feeder_impedance", PUSHES])
def test_a_sets_own_kernel_gives_what_those_with_more_beside_it_give(beside):
    made = bench(base(), events(), only=())
    at = made.coordinates
    unit = at.null.copy()
    unit[at.sizes(["stator_resistance"])] = at.to_unit("R_s", 0.02)
    own, wider = (made.residuals(unit[None], ("stator_resistance",), more) for more in ("", beside))
    assert own == pytest.approx(wider, abs=1e-10)


def test_what_changes_nothing_is_exactly_zero():
    """Of two kernels the difference would be rounding, and a direction of its own once it is scaled
    to length one.
    """
    made = bench(base(), events(), only=())
    at = made.coordinates
    unit, names = at.null.copy(), ("stator_resistance", "feeder_impedance", PUSHES)
    unit[at.sizes(["stator_resistance"])] = at.to_unit("R_s", 0.02)
    assert not made.changes(unit, np.array([unit] * 3), ("stator_resistance",), names).any()
    moved = at.place_values(unit, {"X_f": 0.02})
    assert made.changes(unit, moved[None], ("stator_resistance",), ("feeder_impedance",)).any()


class Narrow(Family):
    """A family in which effects `b` and `m` do not go together."""

    def with_effects(self, names):
        names = {*names}
        why = "the model has a state 'x' already"

        def clash(more=()):
            return {"b", "m"} <= {*names, *more}

        def compiled():
            if clash():
                raise RefusedEffect("m", why)

        def acceptance(effect):
            return SimpleNamespace(refusal=why if clash([effect.name]) else None)

        return SimpleNamespace(names=names, compile=compiled, acceptance=acceptance)


def narrow():
    some = type("", (dict,), {"of_load": ("a", "b", "c", "i"), "of_measurement": ()})
    effects = {
        n: SimpleNamespace(effect=SimpleNamespace(name=n, iterates=n == "i")) for n in "abcim"
    }
    return Narrow(None, some(effects))


def test_what_a_member_does_not_take_beside_it_is_not_tested_there():
    here = narrow()
    for names, tested in (((), "abc"), (("a", "b"), "abc"), (("m",), "acm")):
        assert here.build_model(here.key(names, beside="c")).names == {*tested}
    assert here.build_model(here.key(("m",), beside=PUSHES)).names == {"m", PUSHES}
    assert here.build_model(here.key(("m", "a"))).names == {"m", "a"}


def test_an_effect_that_iterates_and_the_pushes_are_simulated_by_themselves():
    """One such effect beside all others made each of their columns thirty times as dear."""
    here = narrow()
    assert here.key(("a",), beside="i") == ({"a"}, {"i"})
    assert here.key(("a", "i"), beside=PUSHES) == ({"a", "i"}, {PUSHES})
    # the same for all sets of cheap effects
    assert here.key(("a", "i"), beside="b") == ({"i"}, {"a", "b", "c"})
