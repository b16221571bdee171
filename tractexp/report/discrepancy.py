"""The page of an investigation: noise, disagreement, where, which, how sure, added, smaller, in that order."""

from pathlib import Path
from typing import Any

import numpy as np

from tractexp.discrepancy.bench import Bench
from tractexp.discrepancy.discrepancy_json import parameters, recommendation
from tractexp.discrepancy.investigate import Investigation
from tractexp.discrepancy.judgement import judgements
from tractexp.identification.surprises import SMALLEST_P
from tractexp.report import style
from tractexp.report.page import Page

KIND = {"none": "good", "named": "good", "tied": "plain", "unexplained": "bad"}

CAPTIONS = {
    "gap": "Before and after on the fitted events, measured less calculated.",
    "gap_held_out": "Before and after on the held-out events, measured less calculated.",
    "unexplained": "What the nearest candidates leave of the base model's residuals (gray): what is missing looks so.",
}


def report(folder: Path, found: Investigation, title: str) -> list[Path]:
    """Write the figures and discrepancy.html into `folder`; returns their paths."""
    figures = [residuals(folder / "residuals.svg", found), smaller(folder / "gap.svg", found, held=False)]
    if found.judged is not None:
        figures.append(smaller(folder / "gap_held_out.svg", found, held=True))
    if found.verdict.nearest is not None:
        figures.append(left(folder / "unexplained.svg", found))
    return [*figures, page(folder / "discrepancy.html", found, figures, title)]


def page(path: Path, found: Investigation, figures: list[Path], title: str) -> Path:
    """Tell the investigation to a reader who was not there."""
    names = " and ".join(found.names)
    made = Page(f"Missing effect: {title}", f"{found.bench.model.title}, {len(found.bench.events)} events fitted")
    made.verdict(f"{found.verdict.word.upper()} {names}".strip(), found.verdict.reason, kind=KIND[found.verdict.word])
    made.heading("1 Noise").text(
        f"{found.last.noise.describe()}. It is estimated where nothing happens, from what the fit leaves there, and"
        " so contains what smoothing leaves of the voltage's noise. Time skew, measurement window and load drift are"
        " free in every fit, each held by what is physically likely."
    )
    if (window := found.bench.records.window) is not None:
        made.text(
            f"{window.describe().capitalize()}, of voltage and current alike: any other window would"
            " make the voltage bend where the power does not. The voltage that the load saw is reckoned back from the"
            " record, and the current of the model is averaged as the recorder does. The extended configuration does"
            " not do so."
        )
    made.heading("2 Is there a disagreement?").text(_gate(found))
    made.heading("3 Where")
    if found.places:
        rows = [[p.event, p.channel, f"{p.start:.3f}", f"{p.end:.3f}", f"{p.share:.0%}"] for p in found.places]
        made.table(["event", "channel", "from [s]", "to [s]", "share of the excess"], rows)
    else:
        made.text("No interval holds more energy than chance leaves there.")
    made.figure(figures[0], "What the base model leaves; shaded: more than chance, at a family-wise error of "
                            f"{found.bench.criteria.false_alarms:.0%}.")  # fmt: skip
    _which(made, found)
    _sure(made, found)
    _added(made, found)
    made.heading("7 Smaller")
    made.table(["events", "", "epsilon_p", "epsilon_q", "chi2 per sample", "gap closed"], _gap_rows(found))
    for figure in figures[1:]:
        made.figure(figure, CAPTIONS[figure.stem])
    made.heading("Next").text(recommendation(found))
    return made.write(path)


def _gate(found: Investigation) -> str:
    first = found.first
    best = first.scores[0] if first.scores else None
    critical = first.chance.critical_p(found.bench.criteria.false_alarms)
    text = f"What the base fit leaves would come about by chance with p = {first.p_left:.2g}"
    text += f"; {first.loudest} stands out." if not first.adequate else "."
    if best is None:
        return text
    p, alpha = max(best.p, SMALLEST_P), found.bench.criteria.false_alarms
    return (
        f"The most helpful single effect, {best.name}, lowers the deviance by {best.drop:.1f} (p = {p:.2g}; chance"
        f" gives less than {critical:.2g} to the best of all candidates in {alpha:.0%} of cases). {text}"
    )


def _which(made: Page, found: Investigation) -> None:
    made.heading("4 Which")
    rows = []
    for j in judgements(found):
        size = ""
        if j.score is not None:
            size = ", ".join(f"{n} {v:.3g} ± {j.score.deviation[n]:.2g}" for n, v in j.score.size.items())
        rows.append([j.name, j.status, "" if j.score is None else f"{j.score.drop:.1f}", size, j.why])
    made.table(
        ["effect", "verdict", "drop of deviance", "one-step size", "why"], rows,
        "Scores at the chosen model, all nuisances projected out.", words=(1, 3, 4),
    )  # fmt: skip


def _sure(made: Page, found: Investigation) -> None:
    made.heading("5 How sure")
    rows = [
        [" and ".join(r.fit.names) or "the base model", f"{r.fit.deviance:.1f}", f"{r.behind:.1f}", f"{r.distance:.1f}",
         "rejected" if r.rejected else "adequate" if r.adequate else "not adequate",
         "" if r.tests is None else f"{r.tests.p_left:.2g}"]
        for r in found.survivors.rivals[:12]
    ]  # fmt: skip
    made.table(
        ["set", "deviance", "behind", "distance of the curves", "verdict", "p of adequacy"], rows,
        "Every set of this size that was refitted. A set is rejected when, were it true, the best would not fit so"
        " well.", words=(4,),
    )  # fmt: skip
    if found.verdict.nearest is not None:
        near = found.verdict.nearest
        held = f"{near.held_out:.0%}" if np.isfinite(near.held_out) else ""
        rows = [[" and ".join(near.names), f"{near.fitted:.0%}", held]]
        rows += [[" and ".join(names), f"{share:.0%}", ""] for names, share in near.others]
        made.table(["nearest candidates", "explains on the fitted events", "on the held-out events"], rows,
                   "None of them is adequate. Shares of the deviance in excess of the noise.")  # fmt: skip
    if len(found.verdict.sets) > 1:
        made.text(
            "These cannot be told apart on these events: " + "; ".join(" and ".join(s) for s in found.verdict.sets)
        )


def _added(made: Page, found: Investigation) -> None:
    made.heading("6 Added")
    if not found.names:
        made.text("Nothing was added.")
        return
    from tractexp.model.model import compose

    base = found.bench.load
    effects = [found.catalogue[n].effect for n in found.names]
    before, after = base.latex(), compose(base.motor, base.static, [*base.effects, *effects]).latex()
    made.text("Equations that changed or came in:")
    old = {line.split("=")[0]: line for line in before}
    for line in after:
        if line not in before and "|_0" not in line:
            was = old.get(line.split("=")[0])
            if was is not None:
                made.text("before").equation(was).text("after")
            made.equation(line)
    with made.folded("All equations of the extended model"):
        for line in after:
            made.equation(line)
    rows = []
    for name, at in parameters(found).items():
        error = at["standard_error"]
        rows.append([name, f"{at['value']:.5g}", f"{error:.2g}" if np.isfinite(error) else "at its bound"])
    made.table(["parameter", "value", "standard error"], rows)


def _gap_rows(found: Investigation) -> list[list[str]]:
    rows = []
    for label, gap in (("fitted", found.train), ("held out", found.validate)):
        if gap is None:
            continue
        for stage, c in (("before", gap.before), ("after", gap.after)):
            closed = f"{gap.closed:.0%}" if stage == "after" and np.isfinite(gap.closed) else ""
            rows.append([label, stage, f"{c.epsilon_p:.3%}", f"{c.epsilon_q:.3%}", f"{c.chi2_per_sample:.3f}", closed])
    return rows


def residuals(path: Path, found: Investigation) -> Path:
    """The base model's residuals of every event, with the intervals that stand out shaded."""
    calculated = found.train.before.calculated
    return _panels(path, found.bench, [("base model", calculated, None)], found.places)


def left(path: Path, found: Investigation) -> Path:
    """What the nearest candidates leave of the base model's residuals."""
    assert found.verdict.nearest is not None
    before = ("base model", found.train.before.calculated, style.BEHIND)
    return _panels(path, found.bench, [before, ("nearest candidates", found.verdict.nearest.calculated, None)], ())


def smaller(path: Path, found: Investigation, held: bool) -> Path:
    """Residuals before and after, on the fitted or the held-out events."""
    bench, gap = found.bench, found.train
    if held:
        assert found.judged is not None
        bench, gap = found.judged.bench, found.judged.gap
    pairs = [("before", gap.before.calculated, style.MEASURED), ("after", gap.after.calculated, None)]
    return _panels(path, bench, pairs if found.names else pairs[:1], ())


def _panels(path: Path, bench: Bench, curves: list[tuple[str, np.ndarray, str | None]], places: Any) -> Path:
    """One column per event (at most four), P above Q."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    events = bench.events[:4]
    with rc_context(style.SETTINGS):
        figure = Figure(figsize=(max(4.2, 2.9 * len(events)) + 1, 4.4))
        panels = figure.subplots(2, len(events), sharex="col", sharey="row", squeeze=False)
        for e, event in enumerate(events):
            part = bench.drive.part(e)
            for c, (name, color) in enumerate((("P", style.ACTIVE), ("Q", style.REACTIVE))):
                panel, measured = panels[c, e], getattr(event.record, name)
                for place in places:
                    if (place.event, place.channel) == (event.record.name, name):
                        panel.axvspan(place.start, place.end, color="#F2C14E", alpha=0.35, linewidth=0)
                for label, made, chosen in curves:
                    x, y = style.thin(event.record.t, measured - made[c, part])
                    panel.plot(x, y, color=chosen or color, linewidth=0.8, label=f"{name} {label}")
                panel.axhline(0.0, color=style.FAINT, linewidth=0.6, zorder=0.5)
                if e == 0:
                    panel.set_ylabel(f"residual of {name} [pu]")
                    panel.legend(loc="best", frameon=True, framealpha=0.85, edgecolor="none")
            panels[0, e].set_title(event.record.name)
            panels[1, e].set_xlabel("t [s]")
        wide = figure.get_figwidth()
        figure.subplots_adjust(left=0.8 / wide, right=1 - 0.2 / wide, bottom=0.11, top=0.93, hspace=0.1, wspace=0.08)
        return style.save(figure, path)
