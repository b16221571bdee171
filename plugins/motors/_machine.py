"""What the motors share: parameters by one name and meaning, and the steady state of a single cage,
Eq. (3).
"""

from tractexp.extend import Parameter, sites

# Physical ranges, on the record's own base: machines of the seven types of the IEEE Task Force on
# Load Representation 1995 have C of 0.90 and more; T_m leaves the static part a tenth of the load.
PAPER = "Wu, Fan, Zou 2022, Energies 15(14) 5034"

T_PRIME = Parameter(
    0.1, (0.005, 0.5), "s", "transient time constant X'/X T0'", f"{PAPER}, Eq. (1)", "T'"
)
X_PRIME = Parameter(
    0.3,
    (0.05, 1.5),
    "pu",
    "transient reactance on the record's base",
    f"{PAPER}, Eq. (2)",
    "X'",
    power_exponent=-1,
    physical=(0.08, 1.5),
)
C = Parameter(0.9, (0.3, 0.99), "1", "(X - X')/X", f"{PAPER}, Eq. (1)", physical=(0.85, 0.99))
M = Parameter(
    0.005,
    (0.0005, 0.03),
    "pu s²/rad",
    "inertia, H = M omega_s/2",
    f"{PAPER}, Eq. (1)",
    power_exponent=1,
    physical=(0.0005, 0.01),
)
T_M = Parameter(
    0.5,
    (0.05, 1.0),
    "pu",
    "load torque, the motor's power before the event",
    f"{PAPER}, Eq. (1)",
    power_exponent=1,
    physical=(0.05, 0.9),
)
MILANO = "Milano 2010, Power System Modelling and Scripting, ch. 15"
T_SECOND = Parameter(
    0.01, (0.001, 0.05), "s", "subtransient time constant X''/X' T0''", MILANO, "T''"
)
X_SECOND = Parameter(
    0.2,
    (0.03, 1.2),
    "pu",
    "subtransient reactance on the record's base",
    MILANO,
    "X''",
    power_exponent=-1,
    physical=(0.06, 1.2),
)
R_S = Parameter(
    0.02,
    (0.001, 0.2),
    "pu",
    "stator resistance on the record's base",
    "Krause, Wasynczuk, Sudhoff 2002, ch. 4",
    "R_s",
    power_exponent=-1,
)


def usual(T_prime, X_prime, C, M, T_m):
    """The usual ratios of one cage: geometric means of seven types of motor, and one and a half
    times the logarithms' scatter.

    An aggregate of unknown machines may lie farther off than the types do, hence the half more.
    X'/X and R_s/X' are the machine's; X' T_m and M/T_m are its transient reactance and 2 H/omega_n
    times and over its load factor, whatever the base.

    Source: IEEE Task Force on Load Representation 1995, typical data of seven types of induction
    motor (small and large industrial, pumps, power plant auxiliaries, residential, mixed, air
    conditioners), at 60 Hz.
    """
    return [
        (1 - C, 0.082, 1.33),
        (T_prime, 0.027, 5.2),
        (X_prime * T_m, 0.15, 1.45),
        (M / T_m, 0.0068, 2.2),
    ]


def single_cage(eq, T_prime, X_prime, C, T_m):
    """Declare what the motors with rotor flux and without stator transients share, Eqs. (1)-(2) but
    for the speed.

    Returns the stator current, the speed's symbol, its value relative to synchronous before the
    event, and the excess of the electrical over the load torque.
    """
    from sympy import I

    E, omega = eq.flux("E", "E"), eq.speed(r"\omega")
    V = eq.V
    Z = eq.place(sites.stator_impedance, I * X_prime)
    eq.place(sites.backward_impedance, Z)
    current = eq.place(sites.stator_current, eq.branch("psi", r"\psi", V, Z, behind=E))
    flux, excess = rotor(eq, E, E, omega, current, T_prime, X_prime, C, T_m)
    E_0, slower = at_rest(eq, T_prime, X_prime, C, T_m)
    eq.moves(E, flux, E_0)
    return current, omega, slower, excess


def rotor(eq, E, inner, omega, current, T_prime, X_prime, C, T_m):
    """dE/dt of a cage, Eq. (1), and the excess of the electrical over the load torque.

    The torque is that of the voltage `inner`, of all rotor circuits together.
    """
    from sympy import I, conjugate, re

    coupling = eq.place(sites.coupling, C)
    time_constant = eq.place(sites.time_constant, T_prime)
    electrical_torque = eq.place(sites.electrical_torque, re(inner * conjugate(current)))
    load_torque = eq.place(sites.load_torque, T_m)
    flux = (I * X_prime * coupling * current - (1 - coupling) * E) / time_constant
    return flux + I * (omega - eq.omega_s) * E, electrical_torque - load_torque


def two_cages(eq, draw, parameters):
    """Declare two rotor circuits, the torque of both and the speed.

    Parameters
    ----------
    eq : Equations
    draw : callable
        Gives the stator current for the voltage E'' behind the rotor's circuits.
    parameters : 7 symbols
        T', X', C, M, T_m, T'', X''.

    Returns
    -------
    Symbol
        The stator current.
    """
    from sympy import I

    T_prime, X_prime, C, M, T_m, T_second, X_second = parameters
    E, D, omega = eq.flux("E", "E"), eq.flux("D", "D"), eq.speed(r"\omega")
    inner = eq.place(sites.internal_voltage, E + D, "E''")
    current = eq.place(sites.stator_current, draw(inner))
    flux, excess = rotor(eq, E, inner, omega, current, T_prime, X_prime, C, T_m)
    open_second = T_second * X_prime / X_second  # T_0''
    E_0, D_0, slip = _guess(eq, T_prime, X_prime, C, T_m, open_second, X_second)
    second = (I * (X_prime - X_second) * current - D) / open_second
    eq.moves(E, flux, E_0)
    eq.moves(D, second + I * (omega - eq.omega_s) * D, D_0)
    eq.moves(omega, excess / M, eq.omega_s0 - slip)
    require_physical(eq, (T_prime, X_prime, M, T_second, X_second), C)
    eq.require(
        X_prime - X_second,
        "X'' must be at most X', of which it exceeds {value:g} pu",
        X_second - X_prime,
    )
    return current


def _guess(eq, T_prime, X_prime, C, T_m, open_second, X_second):
    """Voltages and slip [rad/s] near the steady state: what both cages carry at a slip just below
    it.
    """
    from sympy import I

    first, second = X_prime * C, X_prime - X_second  # X - X' over X/X', and X' - X''
    slip = T_m * X_prime**2 / eq.U0**2 / (first * T_prime + second * open_second * (1 - C) ** 2)

    def impedance(k, slip):
        """What both cages put in a slip's way, and R + jX of the motor there."""
        n_1, n_2 = (1 - C) ** 2 + (slip * T_prime) ** 2, 1 + (slip * open_second) ** 2
        R = eq.define(
            f"R_{k}", slip * (first * T_prime / n_1 + second * open_second / n_2), f"R_{k}"
        )
        return (
            n_1,
            n_2,
            R,
            eq.define(f"X_{k}", X_second + first * (1 - C) / n_1 + second / n_2, f"X_{k}"),
        )

    n_1, n_2, R, X = impedance(0, slip)
    for k in range(3):
        slip = eq.define(f"slip_{k}", slip * T_m * (R**2 + X**2) / (eq.U0**2 * R), f"s_{k}")
        n_1, n_2, R, X = impedance(k + 1, slip)
    current = eq.U0 * (R - I * X) / (R**2 + X**2)
    E_0 = I * first * current * (1 - C - I * slip * T_prime) / n_1
    return E_0, I * second * current * (1 - I * slip * open_second) / n_2, slip


def at_rest(eq, T_prime, X_prime, C, T_m):
    """Internal voltage and speed relative to synchronous before the event, Eq. (3): the stable of
    two solutions.
    """
    from sympy import I

    sine, cosine = _angle(eq, X_prime, C, T_m)
    # C U0 cos(delta_0) exp(j delta_0)
    return C * eq.U0 / 2 * (1 + cosine - I * sine), -sine / (1 + cosine) / T_prime


def require(eq, positive_symbols, X_prime, C, T_m):
    """State what the steady state of Eq. (3) needs: a real angle, a C between 0 and 1, the others
    positive.
    """
    sine, _ = _angle(eq, X_prime, C, T_m)
    eq.require(
        1 - abs(sine),
        "no steady state exists before the event: Eq. (3) needs |2 T_m X'/(C U0²)| at most 1 and it"
        " is {value:.3g}; lower T_m or X', or raise C",
        abs(sine),
    )
    require_physical(eq, positive_symbols, C)


def require_physical(eq, positive_symbols, C):
    """State that C lies between 0 and 1 and that the other parameters are positive."""
    for symbol in positive_symbols:
        eq.require(symbol, f"{symbol.name} must be positive and is {{value:g}}", symbol)
    eq.require(C * (1 - C), "C = (X - X')/X must lie between 0 and 1 and is {value:g}", C)


def _angle(eq, X_prime, C, T_m):
    """-sin(2 delta_0) of Eq. (3), and the cosine (0 where there is none)."""
    import sympy

    sine = 2 * T_m * X_prime / (C * eq.U0**2)
    return sine, sympy.sqrt(sympy.Max(0, 1 - sine**2))
