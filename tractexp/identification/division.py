"""How a load divides before its dip into motor and static part, and whether a load could be so.

A fit may describe a record by a motor that draws more than the whole load beside a static part that
generates: the sum is right, the machine is none.
"""

import numpy as np

from tractexp.inference.problem import Problem

# of the load's active power: what a motor may draw before its model is doubted
LARGEST_MOTOR_SHARE = 1.2
# power factor of a motor beside capacitors that supply all its reactive power: its apparent power
# may be so much larger
MOTOR_POWER_FACTOR = 0.8


def doubt_division(load: complex, motor: complex, units: tuple[str, str]) -> str:
    """Why no load draws its power by such a motor.

    Parameters
    ----------
    load, motor : complex
        P + jQ that the load and its motor draw before a dip, both in `units`.
    units : (str, str)
        Of P and of Q, as the sentence tells them.

    Returns
    -------
    str
        A sentence; "" where a load may be so: the motor draws, at most `LARGEST_MOTOR_SHARE` of P,
        and has a usual power factor.

    Examples
    --------
    >>> doubt_division(1 + 0.5j, 0.6 + 0.4j, ("pu", "pu"))
    ''
    >>> doubt_division(1 + 0.5j, -0.2 + 0.4j, ("pu", "pu")).partition(" of a load")[0]
    'the motor generates 0.2 pu and the static part draws 1.2 pu'
    """
    p, q = units
    static = load - motor
    of_load = f"of a load of {load.real:.4g} {p} and {load.imag:.4g} {q}"
    drawn, generated = (f"{abs(each.real):.4g} {p}" for each in (motor, static))
    if load.real <= 0:
        return ""
    if motor.real < 0:
        return f"the motor generates {drawn} and the static part draws {generated} {of_load}"
    if motor.real > LARGEST_MOTOR_SHARE * load.real:
        return f"the motor draws {drawn} {of_load}, and the static part generates {generated}"
    if abs(motor) > LARGEST_MOTOR_SHARE / MOTOR_POWER_FACTOR * abs(load):
        reactive, supplied = (f"{abs(each.imag):.4g} {q}" for each in (motor, static))
        return f"the motor draws {reactive} {of_load}, and the static part supplies {supplied}"
    return ""


def doubt_estimate(problem: Problem, values: np.ndarray) -> str:
    """As `doubt_division`, for free values (d,) in the first event; "" where the model has no motor
    in P and Q.
    """
    full = problem.full(values)[0]
    if problem.model.refusal(full, problem.drive):
        return ""
    rest = problem.model.at_rest(full, problem.drive)
    if "P_motor" not in rest or "Q_motor" not in rest:
        return ""
    P0, Q0 = problem.drive.before[0][:2]
    return doubt_division(complex(P0, Q0), complex(rest["P_motor"], rest["Q_motor"]), ("pu", "pu"))
