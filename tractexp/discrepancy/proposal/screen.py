"""The screen: what every term of the library would gain at the base fit, in one linear step.

A term's column is what a small size of it changes, simulated along the fitted trajectory; thousands
of them run side by side in the library's kernel, which costs less than assembling them of pushes.
Columns are whitened and the base model's parameters, P0 and Q0 of each event and the faults of the
measurement projected out. The rank is a shortlist.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from tractexp.discrepancy.proposal.library import Term
from tractexp.discrepancy.proposal.term_context import Setting, list_sizes, place
from tractexp.inference.context import Context
from tractexp.inference.cores import map_on_cores
from tractexp.noise import Noise
from tractexp.noise.span import project_out

TERM_STEP = 0.02  # of a size's relevant value: how large a term is whose column is taken
COLUMNS_AT_ONCE = 384  # columns held at once
QUARTER = float(np.pi / 2)
LEAST_COLUMN_SHARE = 1e-8  # of a column's square: what the nuisances leave of it at least

Members = list[tuple[Term, Setting]]  # at one setting of one signal, which share columns
Batch = list[Members]


@dataclass(frozen=True, eq=False)
class ScreeningFit:
    """A fit with all that may give way projected out. R = C N rows of the records, then those of
    the priors.
    """

    context: Context  # of terms
    unit: np.ndarray  # (D,)
    noise: Noise
    raw: np.ndarray  # (C, N) residuals of the fit
    Q: np.ndarray  # (R, k) orthonormal nuisances
    r: np.ndarray  # (R,) the fit's residual, projected

    @classmethod
    def from_coordinates(cls, context: Context, unit: np.ndarray, noise: Noise) -> "ScreeningFit":
        """At coordinates (D,). The base model's parameters give way though they rest on their
        bounds.
        """
        raw, rows = context.linearize(unit, noise, context.coordinates.nuisances(()), ())
        Q = np.linalg.qr(rows[1:].T)[0]
        ground = cls(context, unit, noise, raw, Q, rows[0])
        return replace(ground, r=ground.off(rows[:1])[0])

    def off(self, rows: np.ndarray) -> np.ndarray:
        """Rows (n, R) without what the nuisances explain."""
        return project_out(rows, self.Q.T)

    def columns(self, points: np.ndarray, spans: np.ndarray, kind: str) -> np.ndarray:
        """What points (n, D) of one kind of terms change for each unit of their size, whitened (n,
        C N).
        """
        raw = self.context.residuals(points, (kind,))
        raw -= self.raw
        raw /= spans[:, None, None]
        return self.context.whiten(self.noise, np.nan_to_num(raw, copy=False))


@dataclass(frozen=True, eq=False)
class TermScore:
    """A term at one setting: by how much its best size lowers the deviance, and that size."""

    term: Term
    setting: Setting
    drop: float
    sizes: tuple[float, ...]


def screen_terms(ground: ScreeningFit, terms: Sequence[Term]) -> list[TermScore]:
    """Every term at every setting of its grid, the most promising first."""
    every = [(t, s) for t in terms for s in t.signal.settings]
    return sorted(_score_each(ground, every), key=lambda s: -s.drop)


def compute_library_p(term: Term, drop: float, tries: int) -> float:
    """At most how often noise alone lowers the deviance as much by the best of so many tries, if
    all had as many sizes as this term: their number times the p of one.
    """
    phases = sum(shape.name == "phase" for shape in term.signal.shapes)
    sizes = len(term.balance.sizes) * (1 + phases)
    return min(tries * float(chdtrc(sizes, max(drop, 0.0))), 1.0)


def score_terms(ground: ScreeningFit, wanted: Sequence[tuple[Term, Setting]]) -> list[TermScore]:
    """Score terms at settings of their own, in this order; a phase is found, not given."""
    by_key = {(s.term.name, _key_setting(s.setting)): s for s in _score_each(ground, wanted)}
    return [
        by_key[t.name, _key_setting({k: v for k, v in s.items() if k != "phase"})]
        for t, s in wanted
    ]


def _key_setting(setting: Setting) -> tuple:
    """What tells two settings apart: all but the phase."""
    return tuple(sorted((k, v) for k, v in setting.items() if k != "phase"))


def _score_each(
    ground: ScreeningFit, wanted: Sequence[tuple[Term, Setting]]
) -> Iterator[TermScore]:
    """Each term with its score. Balances of a signal share columns."""
    ground.noise.prepare(ground.context.drive, ground.context.valid)
    scored = lambda batch: _score_batch(ground, batch)  # noqa: E731
    return itertools.chain(*map_on_cores(scored, _cut_batches(wanted), ground.context.effort))


def _cut_batches(wanted: Sequence[tuple[Term, Setting]]) -> list[Batch]:
    """Terms at settings in batches of one kind whose columns are held at once; those of one signal
    together.
    """
    groups: dict[tuple, Members] = {}
    for t, s in wanted:
        groups.setdefault((t.signal.kind, t.signal.name, t.clock, _key_setting(s)), []).append(
            (t, s)
        )
    batches: list[Batch] = []
    for members in sorted(groups.values(), key=_find_kind):
        full = batches and sum(map(len, batches[-1])) * 2 >= COLUMNS_AT_ONCE
        if not batches or full or _find_kind(batches[-1][0]) != _find_kind(members):
            batches.append([])
        batches[-1].append(members)
    return batches


def _find_kind(members: Members) -> str:
    """The kind of signal that all members have."""
    return members[0][0].signal.kind


def _score_batch(ground: ScreeningFit, batch: Batch) -> list[TermScore]:
    """The scores of terms that are simulated together."""
    at = ground.context.coordinates
    index = {}
    points = []
    spans = []
    blocks = []
    for members in batch:
        for t, s in members:
            rows = []
            for (size, label), k in zip(list_sizes(t), range(len(t.balance.sizes)), strict=True):
                for phase in (0.0, QUARTER) if "phase" in s else (None,):
                    setting = dict(s) if phase is None else {**s, "phase": phase}
                    key = (label, t.signal.name, t.clock, tuple(sorted(setting.items())))
                    if key not in index:
                        index[key] = len(points)
                        sizes = [
                            TERM_STEP * size.relevant if i == k else 0.0
                            for i in range(len(t.balance.sizes))
                        ]
                        points.append(place(at, ground.unit, t, setting, sizes))
                        spans.append(TERM_STEP * size.relevant)
                    rows.append(index[key])
            blocks.append((t, s, rows))
    columns = ground.columns(np.array(points), np.array(spans), blocks[0][0].signal.kind)
    seen = columns.shape[1]
    side = columns @ ground.r[:seen]
    along = columns @ ground.Q[:seen]
    scored = []
    for t, s, rows in blocks:
        # what the nuisances explain taken away
        gram = columns[rows] @ columns[rows].T - along[rows] @ along[rows].T
        inverse = _invert(gram, np.einsum("nr,nr->n", columns[rows], columns[rows]).max())
        sizes = -inverse @ side[rows]
        scored.append(_build_term_score(t, s, sizes, float(-sizes @ side[rows])))
    return scored


def _invert(gram: np.ndarray, whole: float) -> np.ndarray:
    """The pseudo-inverse (k, k); directions of which the nuisances leave nothing of `whole` are
    none.
    """
    if len(gram) == 1:
        return 1 / gram if gram[0, 0] > LEAST_COLUMN_SHARE * whole + 1e-12 else np.zeros((1, 1))
    values, vectors = np.linalg.eigh(gram)
    large = values > max(LEAST_COLUMN_SHARE * whole, 1e-12)
    return (vectors[:, large] / values[large]) @ vectors[:, large].T


def _build_term_score(t: Term, setting: Setting, sizes: np.ndarray, drop: float) -> TermScore:
    """A score; of two phases the amplitude, and the phase of the larger balance."""
    if "phase" not in setting:
        return _limit_sizes(TermScore(t, dict(setting), drop, tuple(sizes.tolist())))
    pairs = sizes.reshape(-1, 2)
    turned = pairs[:, 0] + 1j * pairs[:, 1]
    phase = float(np.angle(turned[np.abs(turned).argmax()]))
    amplitudes = (turned * np.exp(-1j * phase)).real
    return _limit_sizes(TermScore(t, {**setting, "phase": phase}, drop, tuple(amplitudes.tolist())))


def _limit_sizes(score: TermScore) -> TermScore:
    """A score with sizes that its bounds allow: a column of nearly nothing needs a size beyond all
    of them.
    """
    over = max(
        abs(k) / size.bound for k, size in zip(score.sizes, score.term.balance.sizes, strict=True)
    )
    if over <= 1:
        return score
    c = 1 / over
    return replace(score, drop=score.drop * (2 * c - c**2), sizes=tuple(c * k for k in score.sizes))
