"""A motor beside a static load, as a file with a T-circuit and a polynomial describes them."""

from tractexp.extend.formats import Restored

SMALLEST = 1e-6  # pu: a resistance of 0 where a format takes that for one that is not given
SAME = {"branch": "constant_impedance"}  # what phasors see of a static load


def restore_load(load, motor, law, static):
    """The load that a file's numbers give.

    `motor` is None, or its circuit (a `TCircuit`), inertia H [s] and load torque [pu]; `law` are
    the static load's parameters by name, `static` its P and Q before the event [pu].
    """
    parts = {"motor": {"name": "none"}, "static": {"name": "none"}, "effects": []}
    values = dict(law)
    if "P_static" in load.steady_state:
        name = load.result.model["static"]["name"]
        parts["static"] = {"name": SAME.get(name, name)}
    if motor is not None:
        circuit, inertia, torque = motor
        parts["motor"] = {"name": "electromechanical" if circuit.X_2 is None else "double_cage"}
        values |= circuit.parameters() | {"M": 2 * inertia / load.omega_n, "T_m": torque}
        if circuit.R_s > SMALLEST:
            parts["effects"], values["R_s"] = ["stator_resistance"], circuit.R_s
    return Restored(parts, values, static)


def terms(load):
    """The static load as a polynomial: three (coefficient, exponent) of U/U_0 for P, and three for
    Q.
    """
    value, static = load.values.get, load.result.model["static"]["name"]
    if static == "zip":
        shares = [(value(f"{x}_Z"), value(f"{x}_I")) for x in "ab"]
        return [((Z, 2.0), (current, 1.0), (1 - Z - current, 0.0)) for Z, current in shares]
    fixed = {
        "constant_impedance": (2.0, 2.0),
        "branch": (2.0, 2.0),
        "constant_power": (0.0, 0.0),
    }.get(static)
    return [
        ((1.0, n), (0.0, 0.0), (0.0, 0.0))
        for n in fixed or (load.values["p_v"], load.values["q_v"])
    ]


def law(load, sides):
    """The parameters of the static load whose `terms` these are."""
    static = load.result.model["static"]["name"]
    if static == "exponential":
        return dict(zip(("p_v", "q_v"), (side[0][1] for side in sides), strict=True))
    shares = [coefficient for side in sides for coefficient, _ in side[:2]]
    return dict(zip(("a_Z", "a_I", "b_Z", "b_I"), shares, strict=True)) if static == "zip" else {}
