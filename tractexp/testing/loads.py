"""What motors, static loads, effects of the load and effects of the measurement must satisfy."""

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from tractexp.configuration.plugin import discover
from tractexp.errors import UserError, list_allowed
from tractexp.model import sites
from tractexp.model.drive import WAVES, Drive
from tractexp.model.model import compose
from tractexp.model.parts import Effect, Measurement, Motor, Part, Static
from tractexp.testing import drives
from tractexp.testing.models import (
    SUBSTEPS,
    build_base_model,
    choose_active_size,
    explain_refused_base,
    list_bases,
    list_registered,
    model,
    play,
    select_still_outputs,
    values,
    with_part,
)

EQUATION_ROUNDING = 1e-12  # pu: what rounding leaves between equal equations
LARGEST_STEADY_DRIFT = 1e-9  # pu: what a steady state solved to rounding drifts by
LEAST_VISIBLE_CHANGE = 1e-5  # pu: what a record can show at all
SCALED = 1e-8  # of the largest power: what two bases of power may differ by
LARGEST = 30.0  # pu: no load draws more
# Runge-Kutta steps a sample, of which those in the asymptotic range count
COUNTS = (2, 4, 8, 16, 32, 64, 128, 256)
ASYMPTOTIC = (1e-11, 1e-6)  # pu: errors of the fourth order, above rounding


# What every part must satisfy


def says_what_it_is(cls: type[Part]) -> None:
    """The docstring has equations, their source and what departs from it; parameters have units and
    bounds.
    """
    text = cls.__doc__ or ""
    assert "=" in text or "->" in text, (
        f"the docstring of '{cls.name}' has no equation: no line with '=' or '->'"
    )
    for needed in ("Source:", "Departures:"):
        assert needed in text, f"the docstring of '{cls.name}' has no line '{needed}'"
    for parameter in cls.parameters:
        parameter.check(f"{cls.name}.{parameter.name}")


def prints_its_equations(cls: type[Part]) -> None:
    """The equations in LaTeX show every parameter, those of waveforms what phasors have not."""
    tried = with_part(cls)
    text = " ".join(tried.latex())
    if not (cls.phasors_only or all(parameter.symbol in text for parameter in cls.parameters)):
        waves = compose(tried.motor, tried.static, tried.effects, domain=WAVES)
        text += " ".join(waves.latex())
    for parameter in cls.parameters:
        assert parameter.symbol in text, (
            f"the equations of '{cls.name}' do not show {parameter.symbol}"
        )


def rests(cls: type[Part]) -> None:
    """Under a steady voltage the load stays where it was before, whatever its parameters near their
    defaults.
    """
    of = with_part(cls)
    chosen = values(of, choose_active_size)
    near = np.random.default_rng(1).uniform(0.95, 1.05, (10, len(chosen))) * chosen
    low, high = np.array([p.bounds for p in of.parameters], dtype=float).reshape(-1, 2).T
    flat = drives.wave_flat() if of.waves else drives.flat()
    power = play(of, Drive.from_events([flat]), np.clip(near, low, high))
    assert np.isfinite(power).all(), f"{of.title} diverges under a steady voltage"
    off = np.abs(power - power[:, :, :1]).max()
    assert off < LARGEST_STEADY_DRIFT, f"{of.title} moves by {off:.2g} pu under a steady voltage"


def is_finite_or_refused_at_its_bounds(cls: type[Part]) -> None:
    """In every corner of its bounds a dip gives finite power, or the point is refused; at most 64
    corners.
    """
    of = with_part(cls)
    corners = list(itertools.islice(itertools.product(*(p.bounds for p in cls.parameters)), 64))
    rows = np.tile(values(of), (len(corners), 1))
    own = [of.names.index(p.name) for p in cls.parameters]
    rows[:, own] = np.array(corners)
    response = of.simulate(drives.drive(0.3, 0.65, domain=of.domain), rows, 16)
    good = (response.miss == 0).all(axis=0)
    power = response.outputs[:, good]
    finite = np.isfinite(power).all(axis=(0, 2))
    if not finite.all():
        corner = zip(
            (p.name for p in cls.parameters),
            np.array(corners)[good][np.argmin(finite)],
            strict=True,
        )
        at = ", ".join(f"{name}={value:g}" for name, value in corner)
        raise AssertionError(
            f"{of.title} is not finite in a corner of the bounds of '{cls.name}', at {at}"
        )
    assert np.abs(power).max(initial=0.0) < LARGEST, (
        f"{of.title} draws more than {LARGEST:g} pu in a corner"
    )


def scales_with_its_base(cls: type[Part]) -> None:
    """In another base of power the same load answers the same: each parameter goes as its
    `power_exponent` says.
    """
    of, per_unit = with_part(cls), 2.5
    chosen = values(of, choose_active_size)
    other = chosen * per_unit ** np.array([p.power_exponent for p in of.parameters], dtype=float)
    one = play(of, drives.drive(0.3, 0.5, domain=of.domain), chosen)
    scaled = play(of, drives.drive(0.3, 0.5, domain=of.domain, power=per_unit), other) / per_unit
    off = np.abs(scaled - one).max() / np.abs(one).max()
    assert off < SCALED, (
        f"{of.title} answers otherwise in another base of power (by {off:.2g}): say in"
        f" 'power_exponent' how each parameter of '{cls.name}' goes with it"
    )


def converges_in_order_four(cls: type[Part]) -> None:
    """Halving the step divides the error by 16 on a smooth dip, where the equations are smooth."""
    import sympy

    of = with_part(cls)
    eq = of.equations
    written = [
        eq.expand(e)
        for e in (
            *(s.derivative for s in eq.states.values()),
            *eq.outputs().values(),
            *eq.steps.values(),
        )
    ]
    if eq.memories or not eq.states or any(e.has(sympy.Max, sympy.Min) for e in written):
        return  # a corner costs the order
    smooth = drives.wave_dip(0.3, edge=0.01) if of.waves else drives.dip(0.3, step=10e-3, edge=0.04)
    drive, chosen = Drive.from_events([smooth]), values(of, choose_active_size)
    fine = play(of, drive, chosen, 4 * COUNTS[-1])
    errors = np.array([np.abs(play(of, drive, chosen, n) - fine).max() for n in COUNTS])
    used = (errors > ASYMPTOTIC[0]) & (errors < ASYMPTOTIC[1])
    if used.sum() < 3:
        assert errors.min() < ASYMPTOTIC[0], f"{of.title} does not converge: errors {errors}"
        return
    slope = np.polyfit(np.log2(np.array(COUNTS)[used]), np.log2(errors[used]), 1)[0]
    assert abs(slope + 4) < 0.4, (
        f"{of.title} converges in order {-slope:.2f}, not 4: errors {errors}"
    )


# Motors and static loads


def composes_with_every_other(cls: type[Part]) -> None:
    """Every registered static load or motor beside it gives a model, or is refused
    in a sentence.
    """
    for other in list_registered("model/static" if issubclass(cls, Motor) else "model/motor"):
        try:
            _ = (model(cls, other) if issubclass(cls, Motor) else model(other, cls)).equations
        except UserError:
            continue


def takes_or_refuses_every_effect(cls: type[Part]) -> None:
    """Every registered effect is an edit of it, or is refused with a reason."""
    of = with_part(cls)
    for effect in list_registered("effect"):
        assert of.acceptance(effect()).refusal != "", (
            f"'{effect.name}' refuses '{cls.name}' without a reason"
        )


# Effects


def has_sizes_that_matter(cls: type[Effect]) -> None:
    """Its sizes start at their null, and it says from where each matters and what looks like it."""
    sizes = [p for p in cls.parameters if p.null is not None]
    effects = discover()["effect"]
    for p in sizes:
        assert p.default == p.null, (
            f"the size {p.name} of '{cls.name}' starts at {p.default:g}, not at its null"
        )
        assert p.name in cls.relevant, (
            f"'{cls.name}' does not say in 'relevant' from where its size {p.name} matters"
        )
    for name in cls.confused_with:
        others = effects.keys() - {cls.name}
        assert name in others, (
            f"'{cls.name}' is confused with '{name}', no other effect{list_allowed(name, others)}"
        )


def acts_where_it_says(cls: type[Effect]) -> None:
    """It declares where it acts and what it does there, and edits the sites of these places and no
    others.
    """
    assert cls.places, (
        f"'{cls.name}' does not say in 'places' where it acts; choose of {', '.join(sites.PLACES)}"
    )
    assert cls.kind, (
        f"'{cls.name}' does not say in 'kind' what it does; choose of {', '.join(sites.KINDS)}"
    )
    edited = with_part(cls).equations.edits.get(cls.name, [])
    for site in edited:
        there = any(site in sites.PLACES[place] for place in cls.places)
        assert there, (
            f"'{cls.name}' edits the site {site}, which is in none of its places:"
            f" {', '.join(cls.places)}"
        )
    for place in cls.places:
        measures = place == "measurement" and issubclass(cls, Measurement)
        free = place == "bus" or not sites.PLACES[place] or measures  # what it draws needs no site
        there = free or any(site in sites.PLACES[place] for site in edited)
        assert there, f"'{cls.name}' says that it acts on the {place}, and edits no site there"


def belongs_to_its_family(cls: type[Effect]) -> None:
    """A member of a family names a textbook effect of its kind, says what differs, and nests it
    where it says so.
    """
    effects = discover()["effect"]
    if not cls.family:
        return
    assert cls.family in effects, (
        f"'{cls.name}' belongs to '{cls.family}', no effect{list_allowed(cls.family, effects)}"
    )
    textbook = effects[cls.family]
    assert issubclass(textbook, Effect)
    assert not textbook.family, (
        f"'{cls.name}' belongs to '{cls.family}', which is itself a member of a family"
    )
    assert textbook.kind == cls.kind, (
        f"'{cls.name}' is a {cls.kind}, and '{cls.family}' a {textbook.kind}"
    )
    assert cls.differs, f"'{cls.name}' does not say in 'differs' what differs from '{cls.family}'"
    own, theirs = {p.name for p in cls.parameters}, {p.name for p in textbook.parameters}
    assert cls.as_textbook.keys() <= own, f"'as_textbook' of '{cls.name}' names no parameter of it"
    assert {*cls.as_textbook.values()} <= theirs, (
        f"'as_textbook' of '{cls.name}' names no parameter of '{cls.family}'"
    )
    if not cls.nests_textbook:
        return
    of, book = with_part(cls), with_part(textbook)
    sizes = {p.name: choose_active_size(p) for p in textbook.parameters if p.null is not None}
    chosen = {p.name: sizes.get(p.name, p.default) for p in textbook.parameters}
    drive = drives.drive(0.3, 0.5, domain=of.domain)
    mine = values(
        of, lambda p: chosen[cls.as_textbook[p.name]] if p.name in cls.as_textbook else p.default
    )
    off = np.abs(
        play(of, drive, mine)
        - play(book, drive, values(book, lambda p: chosen.get(p.name, p.default)))
    ).max()
    assert off < EQUATION_ROUNDING, (
        f"'{cls.name}' does not nest '{cls.family}': {off:.2g} pu apart where both should be one"
    )


def is_the_base_model_at_its_null(cls: type[Effect]) -> None:
    """With its sizes at their nulls the load is the base model, whatever its other parameters: the
    two are nested.
    """
    of, bare = with_part(cls), build_base_model(cls)
    drive, rng, own = (
        drives.drive(0.3, 0.5, 0.65, domain=of.domain),
        np.random.default_rng(2),
        cls(),
    )
    rows = [
        values(of, lambda p: rng.uniform(*p.bounds) if p.null is None else p.null, own)
        for _ in range(3)
    ]
    plain = play(bare, drive, values(bare))
    if isinstance(own, Measurement):  # a simulation does not ask it there
        outputs = np.repeat(bare.simulate(drive, values(bare), SUBSTEPS).outputs, len(rows), axis=1)
        picked = dict(zip(of.names, np.transpose(rows), strict=True))
        columns = {p.name: np.tile(picked[p.name], (drive.events, 1)) for p in own.parameters}
        played = select_still_outputs(of, drive, own.observe(outputs, drive, columns))
    else:
        played = play(of, drive, np.array(rows))
    off = np.abs(played - plain).max()
    assert off < EQUATION_ROUNDING, (
        f"at its null '{cls.name}' is {off:.2g} pu away from the base model"
    )


def shows_in_a_dip(cls: type[Effect]) -> None:
    """Each size has a derivative at its null, and the size that matters changes the response of a
    dip.
    """
    of, own = with_part(cls), cls()
    drive = drives.drive(0.6, domain=of.domain)
    for p, null in ((p, p.null) for p in cls.parameters if p.null is not None):
        low, high = p.bounds
        slopes = []
        for h in (1e-4 * (high - low), 2e-4 * (high - low)):
            ends = [min(max(null + side * h, low), high) for side in (-1, 1)]
            rows = np.array(
                [
                    values(of, lambda q, p=p, end=end: end if q is p else q.default, own)
                    for end in ends
                ]
            )
            slopes.append(np.diff(play(of, drive, rows), axis=1) / (ends[1] - ends[0]))
        largest = np.abs(slopes[0]).max()
        assert largest * cls.relevant.get(p.name, 0.1 * (high - low)) > LEAST_VISIBLE_CHANGE, (
            f"{p.name} shows nothing"
        )
        off = np.abs(slopes[1] - slopes[0]).max()
        assert off < 0.03 * largest, f"{p.name} of '{cls.name}' has no derivative at its null"


def is_taken_or_refused_by_every_model(cls: type[Effect]) -> None:
    """Every registered motor and static load takes it, or refuses it with a reason;
    one takes it.
    """
    reasons = [_reason(motor, static, cls) for motor, static in list_bases()]
    assert None in reasons, f"no model takes '{cls.name}': {reasons[0]}"
    assert "" not in reasons, f"'{cls.name}' is refused without a reason"


def _reason(motor: type[Motor], static: type[Static], cls: type[Effect]) -> str | None:
    """Why an effect does not fit a motor and a static load; None where it does."""
    try:
        return explain_refused_base(motor, static, cls)
    except UserError as error:
        return str(error)


def sees_each_event_by_itself(cls: type[Measurement]) -> None:
    """The end of one event does not leak into the beginning of the next, and power
    keeps its shape.
    """
    of = with_part(cls)
    chosen = values(of, choose_active_size)
    together, alone = (
        play(of, drives.drive(*dips, domain=of.domain), chosen) for dips in ((0.3, 0.6), (0.6,))
    )
    assert np.array_equal(together[:, :, -alone.shape[2] :], alone), f"'{cls.name}' mixes events"


Check = Callable[[type], None]
EVERY: tuple[Check, ...] = (
    says_what_it_is,
    is_finite_or_refused_at_its_bounds,
    scales_with_its_base,
)
EQUATIONS: tuple[Check, ...] = (prints_its_equations, rests, converges_in_order_four)
PARTS: tuple[Check, ...] = (
    *EVERY,
    *EQUATIONS,
    composes_with_every_other,
    takes_or_refuses_every_effect,
)
EFFECTS: tuple[Check, ...] = (
    *EVERY,
    acts_where_it_says,
    belongs_to_its_family,
    has_sizes_that_matter,
    is_the_base_model_at_its_null,
    shows_in_a_dip,
    is_taken_or_refused_by_every_model,
)
SUITES: Sequence[tuple[type, tuple[type, ...], tuple[Check, ...]]] = (
    (Motor, (), PARTS),
    (Static, (), PARTS),
    (Effect, (Measurement,), (*EFFECTS, *EQUATIONS)),
    (Measurement, (), (*EFFECTS, sees_each_event_by_itself)),
)
