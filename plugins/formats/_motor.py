"""A motor beside a static load, as a file with a T-circuit describes it."""

from tractexp.extend.formats import Restored

SMALLEST = 1e-6  # pu: a resistance of 0 where a format takes that for one that is not given
SAME = {"branch": "constant_impedance"}  # what phasors see of a static load


def restored(load, motor, law, static):
    """The load that a file's numbers give.

    `motor` is None, or its circuit (a `TCircuit`), inertia H [s] and load torque [pu]; `law` are the static load's
    parameters by name, `static` its P and Q before the event [pu].
    """
    parts = {"motor": {"name": "none"}, "static": {"name": "none"}, "effects": []}
    values = dict(law)
    if "P_static" in load.before:
        name = load.result.model["static"]["name"]
        parts["static"] = {"name": SAME.get(name, name)}
    if motor is not None:
        circuit, inertia, torque = motor
        parts["motor"] = {"name": "electromechanical" if circuit.X_2 is None else "double_cage"}
        values |= circuit.parameters() | {"M": 2 * inertia / load.omega_n, "T_m": torque}
        if circuit.R_s > SMALLEST:
            parts["effects"], values["R_s"] = ["stator_resistance"], circuit.R_s
    return Restored(parts, values, static)
