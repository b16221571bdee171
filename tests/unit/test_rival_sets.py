"""The table of the sets that were fitted, `compare_rivals`, of one size, `rank_rivals`."""

from types import SimpleNamespace

import numpy as np
from made_sets import fitted

from tractexp.discrepancy import rival_sets
from tractexp.discrepancy.rival_sets import compare_rivals, rank_rivals
from tractexp.inference.criteria import Criteria


def test_the_chosen_set_comes_first_with_its_own_tests_though_another_fits_better(monkeypatch):
    """Of two that fit alike the one that asks for no further effect is chosen, and its tests are
    not the other's.
    """
    chosen, better, far = (
        fitted(104.0, 1, "chosen"),
        fitted(100.0, 1, "better"),
        fitted(300.0, 1, "far"),
    )
    bare = fitted(1000.0, 0)
    rows = np.array([[0.0, 0.0], [2.0, 0.0], [14.0, 0.0]])
    at = SimpleNamespace(
        criteria=Criteria(),
        catalogue=SimpleNamespace(textbook=lambda names: names),
        coordinates=SimpleNamespace(parameters=lambda names: []),
        rows=lambda *_: rows,
    )
    monkeypatch.setattr(rival_sets, "refit_from", lambda *_: bare)
    monkeypatch.setattr(rival_sets, "refit", lambda *_: [better, chosen, far])
    monkeypatch.setattr(
        rival_sets, "examine_fit", lambda quiet, fit, *_, **__: SimpleNamespace(fit=fit, p_left=0.0)
    )
    last = SimpleNamespace(fit=chosen, noise=None, p_left=1.0)
    explained = SimpleNamespace(
        base=SimpleNamespace(context=at, quiet=None),
        last=last,
        chosen=chosen,
        faults=(),
        steps=[SimpleNamespace(fit=bare, p_left=0.0)],
        refits={f.names: f for f in (bare, better, chosen, far)},
    )
    evidence = compare_rivals(explained, 0)
    assert [
        (row.fit.names, row.behind, row.tests and row.tests.fit.names) for row in evidence.rows
    ] == [
        (("chosen",), 0.0, ("chosen",)),
        (("better",), -4.0, ("better",)),
        (("far",), 196.0, None),
    ]


def test_sets_of_another_size_are_no_rivals(monkeypatch):
    fits = [fitted(1000.0, 0), fitted(100.0, 1, "a"), fitted(90.0, 2, "a", "b")]
    explained = SimpleNamespace(
        base=SimpleNamespace(
            context=SimpleNamespace(catalogue=SimpleNamespace(textbook=lambda names: names))
        ),
        last=SimpleNamespace(noise=None),
        chosen=fits[1],
        steps=[SimpleNamespace(fit=fits[0])],
        refits={fit.names: fit for fit in fits},
    )
    by_names = {fit.names: fit for fit in fits}
    monkeypatch.setattr(rival_sets, "refit_from", lambda *_: fits[0])
    monkeypatch.setattr(
        rival_sets, "refit", lambda context, noise, starts: [by_names[names] for names, _ in starts]
    )
    (row,) = rank_rivals(explained)
    assert (row.names, row.lowered, row.behind) == (("a",), 900.0, 0.0)
