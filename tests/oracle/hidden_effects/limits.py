"""The size at which an effect can just be told from the base model, by the generator's own
sensitivities.

Source: Rao's score test with nuisance directions projected out; the non-centrality of an effect of
size eta with the whitened, projected signature s is eta² |s|². Small effects, Gaussian noise: an
approximation for large limits.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from hidden_effects.effects import CATALOG, MEASUREMENT, PHYSICAL
from hidden_effects.generator import Case, Scene, scene
from hidden_effects.noise import Noise
from independent import Load

STEP = 0.05  # of a size or, relative, of a parameter of the load
WEAK = 1.0  # prior standard deviation of the relative deviation of a parameter
MACHINE, STATIC = ("Xs", "Xm", "Rr", "Xr", "H"), ("p_v", "q_v")


@lru_cache(maxsize=4096)
def detection_limit(case: Case, seed: int, power: float = 0.9, level: float = 0.05) -> float:
    """Size of the case's one effect that a test of the whole catalogue finds with probability
    `power`.

    `level` is the family-wise false alarm over the catalogue (Bonferroni). The parameters of the
    load, the static load of each event, and skew, window and drift are projected out. Only the
    level and the color of the noise count, and only P and Q: for effects on the voltage channel
    this is a rough guide.
    """
    return float(needed(power, level) ** 0.5 / np.linalg.norm(projected(case, seed)))


def joint_limit(
    case: Case, seed: int, power: float = 0.9, level: float = 0.05
) -> tuple[float, ...]:
    """Sizes of the case's effects at which together they are seen beside the best single effect of
    the catalogue.

    Each is the same multiple of its own `detection_limit`; what the one effect of the catalogue
    that could take most of the sum takes is projected out, with its details as they are drawn here.
    Otherwise as there.
    """
    case = replace(case, swing=case.needs("swing"), negative=case.needs("negative"))
    own = [replace(case, effect=name, size=1.0) for name, _ in case.hidden]
    limits = [detection_limit(one, seed, power, level) for one in own]
    together = sum(limit * projected(one, seed) for one, limit in zip(own, limits, strict=True))
    left = [float(np.linalg.norm(together))]
    for rival in PHYSICAL:  # faults of the measurement are projected out already
        other = projected(replace(case, effect=rival, size=1.0), seed)
        if (size := other @ other) > 0:
            left.append(float(np.linalg.norm(together - other * (other @ together) / size)))
    multiple = needed(power, level) ** 0.5 / min(left)
    return tuple(float(multiple * limit) for limit in limits)


def needed(power: float, level: float) -> float:
    """Non-centrality that a test of the whole catalogue (Bonferroni, two-sided) finds with this
    probability.
    """
    from scipy.stats import norm

    return float((norm.isf(level / (2 * len(CATALOG))) + norm.isf(1 - power)) ** 2)


def projected(case: Case, seed: int) -> np.ndarray:
    """The whitened signature of size 1 (rows,), what the base model and the nuisances could imitate
    taken out.

    ValueError unless the case hides exactly one effect.
    """
    ((name, _),) = case.hidden
    base = _exact(case)
    hidden = replace(base, effect=case.effect, size=STEP)
    signature = (_rows(scene(hidden, seed)) - _rows(scene(base, seed))) / STEP
    return _beyond(signature, case, seed, tuple(other for other in MEASUREMENT if other != name))


def misfit(case: Case, seed: int) -> float:
    """What the case's imperfections leave of the response in S when the base model is fitted to
    them, linearly.
    """
    made = scene(_exact(case), seed)
    rows, each = _rows(made), made.recorder.samples
    response = rows - np.repeat(rows[::each], each)
    return float(
        np.linalg.norm(_own(replace(case, noise=Noise(1.0)), seed)) / np.linalg.norm(response)
    )


def part_misfits(case: Case, seed: int) -> dict[str, float]:
    """What each imperfection of a case leaves of the response in S, as `misfit`, alone."""
    alone = {one[0]: replace(case, imperfections=(one,)) for one in case.imperfections}
    return {name: misfit(one, seed) for name, one in alone.items()}


def size_of_error(case: Case, seed: int) -> float:
    """Size at which the case's one effect leaves as much of the base model as the imperfections do;
    0 without any.
    """
    if not case.imperfections:
        return 0.0
    return float(np.linalg.norm(_own(case, seed)) / np.linalg.norm(projected(case, seed)))


def _exact(case: Case) -> Case:
    """The case with nothing hidden, in a load without imperfections."""
    bare = replace(case, effect=None, size=1.0, nuisances=(), imperfections=(), noise=Noise())
    return replace(bare, swing=case.needs("swing"), negative=case.needs("negative"))


def _own(case: Case, seed: int) -> np.ndarray:
    """The whitened signature (rows,) of the imperfections, what the base model and the nuisances
    could imitate taken out.
    """
    exact = _exact(case)
    made, imperfect = (
        scene(exact, seed),
        scene(replace(exact, imperfections=case.imperfections), seed),
    )
    return _beyond(_rows(imperfect, _scale(made)) - _rows(made), case, seed, tuple(MEASUREMENT))


def _beyond(
    signature: np.ndarray, case: Case, seed: int, measurement: tuple[str, ...]
) -> np.ndarray:
    """A signature (rows,), whitened, without what the base model and faults of the measurement can
    imitate, a weak prior on those below.
    """
    tangent = _whitened(_tangent(_exact(case), seed, measurement), case)
    padded = np.concatenate([_whitened(signature, case), np.zeros(tangent.shape[1])])
    anchored = np.vstack([tangent, np.eye(tangent.shape[1]) / WEAK])
    return padded - anchored @ np.linalg.lstsq(anchored, padded, rcond=None)[0]


def _whitened(rows: np.ndarray, case: Case) -> np.ndarray:
    """Rows (rows, ...), of unit variance where they are the noise of the case; each record and
    channel by itself.
    """
    phi, each = case.noise.phi, case.recorder.samples
    y = (rows / case.noise.level).reshape(-1, each, *rows.shape[1:])
    rest = (y[:, 1:] - phi * y[:, :-1]) / np.sqrt(1 - phi**2)
    return np.concatenate([y[:, :1], rest], axis=1).reshape(rows.shape)


@lru_cache(maxsize=64)
def _tangent(base: Case, seed: int, measurement: tuple[str, ...]) -> np.ndarray:
    """Derivatives (rows, columns) by parameters of the load, levels of the events, and faults of
    the measurement.
    """
    made = scene(base, seed)
    loads = [replace(made, load=load) for load in _deviations(made.load)]
    powers = [
        replace(made, static=(*made.static[:k], S + STEP * part, *made.static[k + 1 :]))
        for k, S in enumerate(made.static)
        for part in (S.real, 1j * S.imag)
    ]
    nuisances = [scene(replace(base, nuisances=((name, STEP),)), seed) for name in measurement]
    at_rest, scale = _rows(made), _scale(made)
    columns = [_rows(other, scale) - at_rest for other in (*loads, *powers, *nuisances)]
    return np.stack(columns, axis=1) / STEP


def _scale(made: Scene) -> list[float]:
    """P0 of each event, which the level of the noise refers to."""
    return [abs(made.power(k).real) for k in range(len(made.dips))]


def _rows(made: Scene, scale: list[float] | None = None) -> np.ndarray:
    """P and Q of all events over P0, end to end (rows,); `scale` where the P0 of `made` is not
    meant.
    """
    records = zip(made.records(), scale or _scale(made), strict=True)
    return np.concatenate(
        [record[channel] / P0 for record, P0 in records for channel in ("P", "Q")]
    )


def _deviations(load: Load) -> list[Load]:
    """The load with each of its parameters larger by `STEP`, relative."""
    larger = 1 + STEP
    machines = [
        replace(load.machine, **{name: larger * getattr(load.machine, name)}) for name in MACHINE
    ]
    statics = [
        replace(load.static, **{name: larger * getattr(load.static, name)}) for name in STATIC
    ]
    return [
        *(replace(load, machine=m) for m in machines),
        replace(load, rating=larger * load.rating),
        *(replace(load, static=s) for s in statics),
    ]
