"""Several motor groups side by side."""

from collections.abc import Mapping
from dataclasses import field, replace

from tractexp.extend import Motor, UserError, build, plugin, sites


@plugin
class MotorGroups(Motor):
    r"""Several groups of motors at one bus, each with parameters, fluxes and a speed of its own.

        I = I_1 + I_2 + ...,        P_d + j Q_d = V I*

    `of` names the motors, each a name or a mapping of name and settings; `model/motor=[a,b]` on the
    command line says the same. What the first declares keeps its names, what the k-th declares ends
    in `_k`: `T_m_2`, `E_2`. The default of `T_m` is shared between them and that of `M` doubles
    from one to the next.

    Groups of the same kind could change places without changing the power: of each kind they stand
    in order of inertia, M <= M_2, which is a requirement of the model. Effects act on the first
    group, and their null is the same.

    Not to be confused with the effect `second_motor_group`, which has one parameter set and two
    inertias: of that the null is one group, so that a record can be asked whether there are two.

    Source: WECC composite load model specification (motors A, B, C side by side); each motor's own.
    Departures: none.
    """

    of: list = field(default_factory=lambda: ["electromechanical", "electromechanical"])

    listed = "of"

    def _check_names(self):
        if len(self.of) < 2:
            raise UserError(
                f"several motor groups are two or more, and model/motor={self.of} names"
                f" {len(self.of)}"
            )
        for member in map(_name, self.of):
            if member in ("none", self.name):
                raise UserError(
                    f"model/motor={self.of} has '{member}' in it, which is no motor by itself"
                )

    def __post_init__(self):
        self._check_names()
        members: tuple[Motor, ...] = tuple(map(_build_member, self.of))
        fields = {
            "members": members,
            "parameters": tuple(
                p for k, one in enumerate(members, 1) for p in _own(one, k, len(members))
            ),
            "reads": tuple(dict.fromkeys(channel for one in members for channel in one.reads)),
            "within_a_cycle": any(one.within_a_cycle for one in members),
            "phasors_only": next(filter(None, (one.phasors_only for one in members)), ""),
            "waves_only": next(filter(None, (one.waves_only for one in members)), ""),
        }
        for key, value in fields.items():  # of these groups; the class knows of none
            object.__setattr__(self, key, value)

    @property
    def label(self):
        return " + ".join(map(_name, self.of))

    def usual(self, **parameters):
        for k, one in enumerate(self.members, 1):
            assert isinstance(one, Motor)
            yield from one.list_usual(self._own_of(k, one, parameters))

    @staticmethod
    def _own_of(k, one, parameters):
        return {p.name: parameters[p.name + _suffix(k)] for p in one.parameters}

    def declare(self, eq, **parameters):
        total = 0
        for k, one in enumerate(self.members, 1):
            assert isinstance(one, Motor)
            own = self._own_of(k, one, parameters)
            current = one.declare(eq if k == 1 else eq.view_with_suffix(_suffix(k)), **own)
            if k == 1 and sites.stator_current not in eq:
                current = eq.place(sites.stator_current, current)
            total += current
        self._require_order(eq, parameters)
        return total

    def _require_order(self, eq, parameters):
        """Require that groups of the same kind stand in order of inertia."""
        last = {}
        for k, member in enumerate(self.of, 1):
            M = parameters.get("M" + _suffix(k))
            if M is not None and (before := last.get(str(member))) is not None:
                sentence = (
                    f"groups of the same motor stand in order of inertia: {before} may not exceed"
                    f" {M}, and it is"
                )
                eq.require(
                    M - before,
                    sentence + " larger by {value:.3g}; let them change places",
                    before - M,
                )
            last[str(member)] = M


def _name(member):
    """The name of a member. Raises `UserError` for what is neither a name, nor a mapping that has
    one.
    """
    name = member.get("name") if isinstance(member, Mapping) else member
    if not isinstance(name, str):
        raise UserError(
            f"model/motor has {member!r} in its list; give a name, or a mapping of 'name' and"
            " settings"
        )
    return name


def _suffix(k):
    return "" if k == 1 else f"_{k}"


def _own(motor, k, groups):
    """The parameters of the k-th group by the names that the model gives them."""
    for p in motor.parameters:
        default = {"T_m": p.default / groups, "M": p.default * 2 ** (k - 1)}.get(p.name, p.default)
        default = min(max(default, p.bounds[0]), p.bounds[1])
        if k == 1:
            yield replace(p, default=default)
        else:
            symbol = rf"{{{p.symbol}}}_{k}"
            yield replace(
                p,
                default=default,
                name=p.name + _suffix(k),
                symbol=symbol,
                about=f"{p.about}, of group {k}",
            )


def _build_member(choice):
    """The motor that a name, or a name and its settings, asks for."""
    return build("model/motor", choice if isinstance(choice, Mapping) else {"name": choice})
