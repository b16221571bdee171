"""What others would pick by the same candidates: sparse regression on the residual of the base
model.

Akaike's and Schwarz's criteria and the error alone need each candidate's deviance only
(`hidden_effects_evidence`).
"""

import warnings

import numpy as np


def sparse(found) -> list[str]:
    """The effects that sequentially thresholded least squares keeps of an `Investigation`, by name.

    Rows are what the base model leaves of P and Q, columns what each candidate would change there,
    at its best setting; both whitened, the base model's parameters and faults of the measurement
    projected out, so that a coefficient of a column of length 1 is in standard deviations. The
    threshold is what one of the columns exceeds by chance in 5 % of cases. Source: Brunton, Proctor
    and Kutz 2016, by PySINDy.
    """
    from pysindy import STLSQ
    from scipy.stats import norm

    projection = found.first.projection
    best = {(s.name, tuple(s.setting.items())) for s in found.first.scores}
    owners, columns = [], []
    for column, block in zip(projection.columns, projection.blocks, strict=True):
        if (column.candidate.name, tuple(column.setting.items())) in best:
            lengths = np.linalg.norm(block, axis=1)
            seen = lengths > 1e-9 * lengths.max(initial=1e-300)
            owners += [column.candidate.name] * int(seen.sum())
            columns += list(block[seen] / lengths[seen, None])
    if not columns:
        return []
    threshold = float(norm.isf(0.05 / (2 * len(columns))))
    regression = STLSQ(threshold=threshold, alpha=1e-6)
    with warnings.catch_warnings(action="ignore"):  # that nothing is kept is an answer
        regression.fit(np.array(columns).T, projection.r[0][:, None])
    return sorted(
        {owner for owner, value in zip(owners, np.ravel(regression.coef_), strict=True) if value}
    )
