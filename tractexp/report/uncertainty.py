"""Figures of what is known: correlation and residuals."""

from pathlib import Path

import numpy as np

from tractexp.identification.residual_tests import LAGS, autocorrelation
from tractexp.identification.uncertainty import Uncertainty
from tractexp.report import style


def correlation(path: Path, known: Uncertainty) -> Path:
    """The correlation of the estimates, each number on its color; parameters that trade stand out."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    names, matrix = known.names, known.information.correlation
    d = len(names)
    with rc_context(style.SETTINGS):
        size = 1.4 + 0.52 * d
        figure = Figure(figsize=(size + 0.6, size), layout="constrained")
        panel = figure.subplots()
        panel.pcolormesh(matrix, cmap="RdBu_r", vmin=-1.4, vmax=1.4, edgecolors="white", linewidth=1.2)
        for i in range(d):
            for j in range(d):
                strong = i != j and abs(matrix[i, j]) >= 0.8
                text = "" if i == j else f"{matrix[i, j]:+.2f}"
                panel.text(j + 0.5, i + 0.5, text, ha="center", va="center", fontsize=7.5,
                           fontweight="bold" if strong else "normal")  # fmt: skip
        panel.set(xticks=np.arange(d) + 0.5, yticks=np.arange(d) + 0.5, aspect="equal")
        panel.set_xticklabels(names, rotation=45, ha="right")
        panel.set_yticklabels(names)
        panel.invert_yaxis()
        panel.grid(False)
        panel.tick_params(length=0)
        for spine in panel.spines.values():
            spine.set_visible(False)
        return style.save(figure, path)


def residuals(path: Path, known: Uncertainty) -> Path:
    """What the fit leaves of each event: whitened residuals over time, and how they correlate with themselves."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    likelihood = known.likelihood
    drive, events = likelihood.problem.drive, likelihood.problem.events
    white = likelihood.rows(known.unit[None])[0].reshape(2, -1)
    with rc_context(style.SETTINGS):
        figure = Figure(figsize=(8.0, 0.4 + 2.0 * len(events)), layout="constrained")
        panels = figure.subplots(len(events), 2, squeeze=False, width_ratios=(2.2, 1.0))
        for e, (event, (left, right)) in enumerate(zip(events, panels, strict=True)):
            part = drive.part(e)
            for c, color in enumerate((style.ACTIVE, style.REACTIVE)):
                seen = likelihood.known[c, part]
                rows = white[c, part][seen]
                left.plot(*style.thin(event.record.t[seen], rows), color=color, linewidth=0.7, alpha=0.8, label="PQ"[c])
                lags = min(LAGS, len(rows) // 4)
                right.vlines(np.arange(1, lags + 1) + 0.3 * c, 0, autocorrelation(rows, lags), color=color, linewidth=2)
            left.axvspan(event.t_start, event.t_end, color="#F1F1F1", zorder=0)
            left.set(title=f"{event.record.name}: whitened residual (dip shaded)", ylabel="standard deviations")
            chance = 1.96 / np.sqrt(max(np.count_nonzero(likelihood.known[0, part]), 1))
            right.axhspan(-chance, chance, color="#F1F1F1", zorder=0)
            right.set(title="autocorrelation (chance shaded)")
            left.legend(loc="upper right", ncols=2)
        panels[-1, 0].set_xlabel("t [s]")
        panels[-1, 1].set_xlabel("lag [samples]")
        return style.save(figure, path)
