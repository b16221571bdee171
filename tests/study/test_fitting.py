"""Descents of many sets of effects at once, `refit`: the same on any number of cores, and counted
as they end.
"""

from contextlib import contextmanager

import numpy as np
from made_context import bench
from made_dips import FEW, LOUD, base, events

from tractexp.inference import cores, fitting
from tractexp.inference.base_fit import fit_base_model
from tractexp.inference.fit_effort import FITS_AT_ONCE
from tractexp.inference.fitting import refit


def test_descents_on_several_cores_say_how_many_have_ended(monkeypatch):
    @contextmanager
    def parts(total):
        counted.append(total)
        yield lambda: counted.append("ended")

    counted = []
    fit = fit_base_model(bench(base(), events(noise=LOUD)))
    monkeypatch.setattr(fit.context.effort, "parts", parts)
    starts = [((name,), fit.fit.unit) for name in FEW] * FITS_AT_ONCE
    # what was fitted before is read back at once
    monkeypatch.setattr(fitting.store.DESCENTS, "read", lambda key: None)
    refit(fit.context, fit.noise, starts)
    assert counted == [3, "ended", "ended", "ended"]


def test_fits_and_what_they_spend_do_not_depend_on_the_number_of_cores(monkeypatch):
    """Products of matrices round by how many rows they have: the same descents go together on any
    machine.
    """
    fit = fit_base_model(bench(base(), events(), ("stator_resistance",)))
    moved = np.clip(fit.fit.unit + np.linspace(-0.02, 0.02, 9)[:, None], 0.0, 1.0)
    monkeypatch.setattr(fitting.store, "compute_key", lambda *_: "")  # nothing is stored
    found = []
    for number in (1, 3):
        monkeypatch.setattr(cores, "count_cores", lambda number=number: number)
        before = fit.context.effort.total
        fits = refit(fit.context, fit.noise, [(("stator_resistance",), unit) for unit in moved])
        found.append((fits[0].unit, fits[0].deviance, fit.context.effort.total - before))
    np.testing.assert_array_equal(found[0][0], found[1][0])
    assert found[0][1:] == found[1][1:]
    assert found[0][2] > 9
