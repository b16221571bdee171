"""Sets of effects that predict alike, over a grid of dips that were not recorded: the dip from
which they part, and by how much.

Of tied sets those that no dip tells apart are one class: what they predict is known, which of them
is right is not. Classes part where the power that they calculate differs, by rms from the dip on,
by more of the response than the records show of them.
"""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from tractexp.discrepancy.evidence import SLIGHT_ERROR
from tractexp.discrepancy.next_event.imagined import ImaginedDip, drive_imagined
from tractexp.inference.context import Context
from tractexp.inference.fitting import Names, Refit
from tractexp.inference.model_error import format_percent
from tractexp.model.drive import Drive
from tractexp.text.wording import join_words

GRID_DEPTHS = (0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
GRID_DURATIONS = (0.04, 0.1, 0.2, 0.5, 1.0)  # s
GRID_JUMPS = (0.0, 20.0)  # degrees
GRID_UNBALANCES = (0.0, 0.5)  # of the depth


@dataclass(frozen=True)
class EffectClass:
    """Sets of effects that no dip tells apart.

    Attributes
    ----------
    sets : tuple of tuples of names
        The tied sets.
    part_at : ImaginedDip or None
        The mildest dip in which one of them differs from a set of another class; None where there
        is no other.
    by : float
        The share of the response by which they differ there; without another class the most that
        its sets differ by, nan where the motor stalls in all.
    """

    sets: tuple[Names, ...]
    part_at: ImaginedDip | None
    by: float

    def to_dict(self) -> dict[str, Any]:
        """As `discrepancy.json` has it."""
        part_at = self.part_at and {**self.part_at.to_dict(), "words": self.part_at.words}
        return {"sets": [list(names) for names in self.sets], "part_at": part_at, "by": self.by}


def describe_classes(classes: Sequence[EffectClass]) -> str:
    """How many classes there are and from which dip they part, as the end of a sentence."""
    parting = [(one.part_at, one.by) for one in classes if one.part_at is not None]
    if not parting:
        (one,) = classes
        if np.isnan(one.by):
            return "one class: the motor stalls in all of them in every dip that was tried"
        share = format_percent(one.by)
        return f"one class: they predict alike within {share} of the response in every dip tried"
    dip, by = min(parting, key=lambda pair: pair[0].burden)
    sentence = (
        f"{len(classes)} classes: they predict alike in milder dips, and part by"
        f" {format_percent(by)} of the response in {dip.words}"
    )
    alike = [map(join_words, one.sets) for one in classes if len(one.sets) > 1]
    never = [f"; no dip tried parts {join_words([*sets])}" for sets in alike]
    return "".join([sentence, *never])


def compare_predictions(
    context: Context, fits: Sequence[Refit], sets: Sequence[Names], error: float
) -> tuple[EffectClass, ...]:
    """The classes of tied sets, by their fits, which miss `error` of the response of the
    records.
    """
    dips = sorted(imagine_grid(context, fits), key=lambda dip: dip.burden)
    drive = Drive.from_events([drive_imagined(context, dip) for dip in dips])
    at = context.coordinates
    power = [
        context.kernels.simulate(fit.names, at.without_faults(fit.unit, ())[None], drive)[0]
        for fit in fits
    ]
    apart = np.array([measure_parting(power, drive, e) for e in range(len(dips))])
    is_parted = apart > max(error, SLIGHT_ERROR)
    classes = group_alike(np.logical_or.reduce(is_parted, axis=0))
    if len(classes) == 1:
        known = apart[np.isfinite(apart)]
        return (EffectClass(tuple(sets), None, float(known.max()) if known.size else np.nan),)
    found = []
    for members in classes:
        others = [k for k in range(len(sets)) if k not in members]
        between = np.ix_(range(len(dips)), members, others)
        first = int(is_parted[between].any(axis=(1, 2)).argmax())
        by = float(apart[between][first][is_parted[between][first]].max())
        found.append(EffectClass(tuple(sets[k] for k in members), dips[first], by))
    return tuple(found)


def group_alike(is_parted: np.ndarray) -> list[list[int]]:
    """Places grouped so that none is parted from another of its group, by `is_parted` (n, n): each
    in turn joins the first group that it may.
    """
    groups: list[list[int]] = []
    for k, row in enumerate(is_parted):
        joined = next((group for group in groups if not row[group].any()), None)
        if joined is None:
            groups.append([k])
        else:
            joined.append(k)
    return groups


def imagine_grid(context: Context, fits: Sequence[Refit]) -> list[ImaginedDip]:
    """Dips of 5 to 70 % for 40 ms to 1 s, with and without a phase jump, and unbalanced where one
    of the sets reads it.
    """
    domain = context.domain
    reads = context.catalogue.list_channels(name for fit in fits for name in fit.names)
    unbalances = GRID_UNBALANCES if not domain.further or "U2" in reads else GRID_UNBALANCES[:1]
    durations = [one for one in GRID_DURATIONS if one < domain.dips.length]
    every = itertools.product(GRID_DEPTHS, durations, GRID_JUMPS, unbalances)
    return [
        ImaginedDip(depth, duration, jump=jump, unbalance=unbalance, domain=domain)
        for depth, duration, jump, unbalance in every
    ]


def measure_parting(power: Sequence[np.ndarray], drive: Drive, event: int) -> np.ndarray:
    """How far sets differ in an event.

    Parameters
    ----------
    power : sequence of n arrays [pu]
        What each set calculates.
    drive : Drive
        The events.
    event : int
        Which of them, from 0.

    Returns
    -------
    array (n, n)
        The rms difference of each two sets over the rms of their mean response; nan where the
        motor stalls or diverges in both, infinite where in one.
    """
    part = drive.part(event)
    changes = [one[:, part] - one[:, part][:, :1] for one in power]
    sizes = [float(np.linalg.norm(change)) for change in changes]
    shares = np.zeros((len(power), len(power)))
    for a, b in itertools.combinations(range(len(power)), 2):
        alive = np.isfinite([sizes[a], sizes[b]])
        share = np.inf if alive.any() else np.nan
        if alive.all():
            whole = (sizes[a] + sizes[b]) / 2
            share = float(np.linalg.norm(changes[a] - changes[b])) / max(whole, 1e-30)
        shares[a, b] = shares[b, a] = share
    return shares
