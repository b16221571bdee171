"""What held-out events say of explanations that were found without them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from tractexp.discrepancy.gap import SHOWN, Gap, gap
from tractexp.discrepancy.kernels import each_apart
from tractexp.discrepancy.study import Refit, Study
from tractexp.discrepancy.which import ADEQUATE, stage
from tractexp.identification.descent import descend
from tractexp.noise.model import Noise
from tractexp.record import Event

CONVINCING = 0.8  # of the explainable gap: an effect that closes as much on held-out events is not doubted
STANDS = 0.05  # p that it must else leave in a fit to all events: every second wrong name lies below
QUIETER = 3.0  # of the deviance: so much less may all events say for an explanation that the held-out ones do not show


@dataclass(frozen=True, eq=False)
class Judged:
    """The gap of one explanation on the held-out events, and the coordinates of both models there.

    `p_left` tells how often chance leaves as much as a fit to all events does, where that was asked.
    """

    gap: Gap
    study: Study
    units: list[np.ndarray]
    p_left: float = 1.0

    @property
    def helps(self) -> bool:
        """Whether the explanation is worth having beyond the events it was fitted to."""
        least = STANDS if self.gap.expected >= SHOWN else ADEQUATE  # no event of which little is expected denies it
        return self.gap.helps and self.p_left >= least


@dataclass(frozen=True, eq=False)
class Refitted:
    """An explanation fitted to fitted and held-out events together, in coordinates of the fitted ones."""

    fit: Refit
    louder: float  # by how much all events speak louder for it than the fitted ones alone, of the deviance
    p_left: float  # how often chance leaves as much as it does


def weighed(
    trained: Study, events: Sequence[Event], bare: Refit, extended: Sequence[Refit], noise: Noise,
    chain: Sequence[str], seed: int, *, doubted: bool,
) -> tuple[dict[tuple[str, ...], Judged], list[Refit]]:  # fmt: skip
    """Judge explanations on held-out events; where none helps as it was fitted, also those that all events confirm.

    Where the base model is `doubted` all events need only bear with them: the held-out ones may not show them at all.
    Several effects at once, chosen among hundreds of sets, must also leave nothing in a fit to all events, and so must
    a single one that closes less of the gap there than a true one does.
    """
    found = judged(trained, events, bare, extended)
    helping = [fit for fit in extended if found[fit.names].gap.helps]
    if not helping:
        all_of_them = together(trained, events, bare, extended, noise, chain, seed, anew=True)
        least = -QUIETER if doubted else SHOWN
        again = [refitted.fit for refitted in all_of_them if refitted.louder > least and refitted.p_left >= ADEQUATE]
        return found | (judged(trained, events, bare, again) if again else {}), again
    doubtful = [f for f in helping if len(f.names) + len(chain) > 1 or not found[f.names].gap.closed >= CONVINCING]
    for refitted in together(trained, events, bare, doubtful, noise, chain, seed) if doubtful else ():
        found[refitted.fit.names] = replace(found[refitted.fit.names], p_left=refitted.p_left)
    return found, []


def judged(
    trained: Study, events: Sequence[Event], bare: Refit, extended: Sequence[Refit]
) -> dict[tuple[str, ...], Judged]:  # fmt: skip
    """Compare the base model and extended ones, as they were fitted, on held-out events."""
    study, units, noise = carried(trained, events, [bare, *extended])
    return {
        fit.names: Judged(gap(study, units[0], unit, fit.names, noise, study.before), study, [units[0], unit])
        for fit, unit in zip(extended, units[1:], strict=True)
    }


def carried(
    trained: Study, events: Sequence[Event], fits: Sequence[Refit]
) -> tuple[Study, list[np.ndarray], Noise]:  # fmt: skip
    """Carry fits over to held-out events: everything keeps its trained value but P0 and Q0 of each event.

    Returns the study of those events, the coordinates of each fit there, and the noise of the last one.
    """
    study = _study_of(trained, events)
    units = []
    for fit in fits:
        unit = study.null.copy()
        unit[: trained.problem.space.dimension] = fit.unit[: trained.problem.space.dimension]
        units.append(_settled(study, unit, study.white(), fit.names))
    noise = study.noise(units[-1])
    return study, [_settled(study, u, noise, fit.names) for u, fit in zip(units, fits, strict=True)], noise


def together(
    trained: Study, events: Sequence[Event], bare: Refit, extended: Sequence[Refit], noise: Noise,
    chain: Sequence[str], seed: int, *, anew: bool = False,
) -> list[Refitted]:  # fmt: skip
    """Explanations fitted to fitted and held-out events together, from every setting if `anew`.

    What the fitted events leave open, such as the level of a relay between the depths of two dips, may be wrong on
    the held-out ones though the effect is there.
    """
    study = _study_of(trained, (*trained.recorded, *events))
    plain = _widened(study, trained, bare.unit)
    study.see_blur(plain)
    noise = noise.on(study.profile, study.blur)
    first = study.refit(noise, [((), plain)], chain=())[0]
    wanted = [
        (fit.names, _placed(study, start, setting))
        for fit in extended
        for start in [_widened(study, trained, fit.unit)]
        for setting in (_settings(study, fit.names) if anew else [{}])
    ]

    def told(fit: Refit) -> Refitted:
        alone = next(e for e in extended if e.names == fit.names)
        louder = (first.deviance - fit.deviance) - (bare.deviance - alone.deviance)
        p_left = stage(study, fit, noise, seed, plain=True).p_left
        unit = np.r_[fit.unit[: study.problem.space.dimension], fit.unit[study.before][: len(trained.before)]]
        return Refitted(replace(fit, unit=unit), louder, p_left)

    return each_apart(told, study.refit(noise, wanted, chain=chain))


def _study_of(trained: Study, events: Sequence[Event]) -> Study:
    """A study of other events in the same terms."""
    kernels = trained.kernels
    return Study(trained.model, trained.catalogue, events, kernels.bounds, kernels.fixed, kernels.substeps)


def _widened(study: Study, trained: Study, unit: np.ndarray) -> np.ndarray:
    """Coordinates of the fitted events as those of a study with more events after them."""
    wide = study.null.copy()
    wide[: len(unit)] = unit
    return wide


def _settings(study: Study, names: Sequence[str]) -> list[dict[str, float]]:
    """No change, and every setting of the scanned parameters of one of the effects."""
    return [{}, *(s for name in names for s in study.catalogue[name].settings)]


def _placed(study: Study, unit: np.ndarray, setting: Mapping[str, float]) -> np.ndarray:
    moved = unit.copy()
    for name, value in setting.items():
        moved[study.column[name]] = study.to_unit(name, value)
    return moved


def _settled(study: Study, unit: np.ndarray, noise: Noise, names: Sequence[str]) -> np.ndarray:
    """Fit P0 and Q0 of each event alone."""

    def rows(x: np.ndarray, lanes: np.ndarray) -> np.ndarray:
        whole = np.tile(unit, (len(x), 1))
        whole[:, study.before] = x
        return study.rows(whole, noise, (), [names] * len(x))

    moved = unit.copy()
    moved[study.before] = descend(rows, unit[study.before][None]).unit[0]
    return moved
