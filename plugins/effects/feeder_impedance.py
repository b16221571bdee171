"""Impedance between the recorded bus and the load."""

from tractexp.extend import Effect, Parameter, Unfit, plugin, sites

SOURCE = "WECC composite load model 2015 (jXxf, Rfdr + jXfdr)"
ITERATIONS = 2
DAMPED = 5e-5  # s: of waveforms, inductance over resistance of what lies beside the reactance
STEEPEST = 0.3  # least slope Newton's method may see: near voltage collapse it would step too far


@plugin
class FeederImpedance(Effect):
    r"""Motor and static load lie behind a feeder, whose drop they see and whose loss the bus feeds.

        V = U - Z_f I,   I = I_d + I_s,   Z_f = R_f + j X_f,   P + j Q -> P + j Q + Z_f |I|^2

    The motor's current is I_d = a + b V, the static load's I_s = conj(P_s + j Q_s)/conj(V) depends
    on v = |V| by an admittance Y(v) alone, so

        V = B/(1 + Z_f (b + Y(v))),   B = U - Z_f a

    leaves one real equation, v |1 + Z_f (b + Y(v))| = |B|. It is solved for ln v by two steps of
    Newton's method, from the v that the admittance before the event would give. At R_f = X_f = 0
    the base model. Other parts, such as a capacitor, stay at the recorded bus.

    In waveforms all parts lie behind it, a capacitor too, so that its resonance with the reactance
    is there. Beside the reactance lies a resistance R_p = X_f/(omega_n T_p), T_p = 50 us, by which
    the voltage v of the bus is no state and the null is the base model:

        v = v_recorded - R_f i - R_p (i - i_L),
        di_L/dt = (i - i_L)/T_p - j (omega_n + omega_s) i_L

    The current i is a part linear in v and one of states, so that this is two linear equations; a
    capacitor sees the slope of v through a lag of T_p. Where all before the event leaves the static
    load is what its P and Q would be at the recorded voltage.

    Source: WECC composite load model specification 2015 (feeder and transformer).
    Departures: R_f and X_f are one impedance from bus to load, of waveforms with R_p beside X_f
    (losses of a winding at high frequencies; it takes 1.6 % of the current at 50 Hz); the zero
    sequence sees none of it; where a load has no solution (voltage collapse) the last iterate
    stands.
    """

    R_f = Parameter(
        0.0,
        (-0.02, 0.1),
        "pu",
        "feeder resistance on the record's base",
        SOURCE,
        null=0.0,
        power_exponent=-1,
    )
    X_f = Parameter(
        0.0,
        (-0.05, 0.2),
        "pu",
        "feeder reactance on the record's base",
        SOURCE,
        null=0.0,
        power_exponent=-1,
    )
    places, kind = ("bus",), "law"
    order, iterates = 2, True
    relevant = {"R_f": 0.01, "X_f": 0.02}
    confused_with = (
        "stator_resistance",
        "dc_link_lag",
        "magnetic_saturation",
        "speed_dependent_torque",
    )

    def refusal(self, eq):
        fits = eq.waves or sites.P_motor not in eq or _affine(eq)
        return None if fits else "its motor's current is not a + b V in the voltage V"

    def edit(self, eq, R_f, X_f):
        import sympy
        from sympy import I, conjugate, im, re

        if eq.waves:
            _before_all(eq, R_f, X_f)
            return
        Z, motor = R_f + I * X_f, sites.P_motor in eq
        loads = [
            eq[s] for s in (sites.P_motor, sites.P_static, sites.Q_motor, sites.Q_static) if s in eq
        ]
        at_bus = [
            eq.evaluate_before(power.xreplace(dict.fromkeys(loads, sympy.Integer(0))))
            for power in (eq.P, eq.Q)
        ]
        I_0 = (eq.P0 - at_bus[0] - I * (eq.Q0 - at_bus[1])) / eq.U0
        a, b = (
            _compute_complex_step(eq, f"motor_{k}", part, part)
            for k, part in zip("ab", _motor_current(eq), strict=True)
        )
        B = _compute_complex_step(eq, "feeder_source", eq.U - Z * a, eq.U - Z * a)
        x, Y = _solve(eq, Z, b, B, eq.U0 - Z * I_0)
        V = _compute_complex_step(eq, "load_voltage", B / (1 + Z * (b + Y)), eq.U0 - Z * I_0)

        name = eq.V if motor else eq.define("load_voltage", V, "V")
        drawn = sum(s * (1 if s.name.startswith("P") else I) for s in loads)
        current = eq.define(
            "feeder_current",
            _compute_complex_step(eq, "feeder_current", a + (b + Y) * V, I_0),
            "I_f",
        )
        eq.shown[current] = conjugate(drawn / name)
        if motor:
            eq.edit(sites.motor_voltage, lambda _: V)
        eq.shown[name] = eq.U - Z * current
        V_0 = sympy.Symbol("V_0")
        eq.edit(
            sites.static_voltage, lambda _: sympy.exp(x), shown=sympy.Abs(name) / sympy.Abs(V_0)
        )
        square = re(current) ** 2 + im(current) ** 2
        eq.consume(R_f * square, X_f * square)


def _before_all(eq, R_f, X_f):
    """Put the impedance before all parts of waveforms: every part sees the voltage behind R_f and
    the reactance with its R_p.
    """
    from sympy import I

    R_p, before = X_f / (eq.omega_n * DAMPED), (eq.P0 - I * eq.Q0) / eq.U0
    in_reactance = eq.lag_vector("feeder_current", "i_L")
    in_reactance_0 = before / (1 + I * DAMPED * (eq.omega_n + eq.omega_s0))
    drop_0 = (R_f + R_p) * before - R_p * in_reactance_0

    source = eq.recorded_voltage + R_p * in_reactance
    inside, J, rest = _linearize_current(eq)
    bus = _solve_voltage(eq, R_f + R_p, J, rest, source)
    v = _compute_complex_step(eq, "behind_feeder", bus, eq.U0 - drop_0)
    drop = eq.recorded_voltage - eq.v
    eq.edit(sites.bus_voltage, lambda recorded: v, shown=source - (R_f + R_p) * eq["feeder_drawn"])
    if inside is not None:
        eq.moves(inside, (drop - inside) / DAMPED, drop_0)
        eq.edit(sites.bus_voltage_rate, lambda rate: rate - (drop - inside) / DAMPED)
    speed = eq.omega_n + eq.omega_s
    eq.moves(
        in_reactance,
        (eq["feeder_drawn"] - in_reactance) / DAMPED - I * speed * in_reactance,
        in_reactance_0,
    )
    lost = drop_0 * (eq.P0 + I * eq.Q0) / eq.U0
    eq.lose(*eq.parts(lost))


def _linearize_current(eq):
    """The current of waveforms as J (x, y) + rest of the voltage v = x + j y at the same instant.

    Returns
    -------
    (state or None, J (2, 2), rest (2,))
        The state makes the slope of the voltage that a capacitor asks for. Raises `Unfit` where the
        current is not linear.
    """
    import sympy
    from sympy import I

    x, y = sympy.symbols("bus_x bus_y", real=True)
    values, inside = {eq.v: x + I * y}, None
    if sites.bus_voltage_rate in eq:
        inside, rate = eq.lag_vector("feeder_drop", "w"), eq[sites.bus_voltage_rate]
        drop = eq.recorded_voltage - values[eq.v]
        values[rate] = eq.expression(sites.bus_voltage_rate) - (drop - inside) / DAMPED
    dependent = _list_dependent_quantities(eq, values)
    current = eq.expand(eq.expression(sites.current), lambda s: s in dependent)
    eq.define("feeder_drawn", eq.expression(sites.current), "i")
    parts = eq.parts(current.xreplace(values))
    J = [[sympy.diff(part, axis) for axis in (x, y)] for part in parts]
    if any(row.has(x, y) for rows in J for row in rows):
        raise Unfit("its current is not linear in the voltage at an instant")
    rest = [part.xreplace({x: sympy.Integer(0), y: sympy.Integer(0)}) for part in parts]
    J = [
        [
            eq.compute(f"feeder_{r}{c}", e, e) if e != 0 else e
            for c, e in zip("dq", row, strict=True)
        ]
        for r, row in zip("dq", J, strict=True)
    ]
    return inside, J, [eq.compute(f"feeder_{r}", e) for r, e in zip("dq", rest, strict=True)]


def _list_dependent_quantities(eq, symbols):
    """The quantities whose definitions hold some of the symbols, by way of others too."""
    reached = set(symbols)
    while more := {
        s for s, e in eq.definitions.items() if s not in reached and e.free_symbols & reached
    }:
        reached |= more
    return reached - set(symbols)


def _solve_voltage(eq, R, J, rest, source):
    """v of v + R (J v + rest) = source."""
    import sympy

    d, q = (
        eq.compute(f"feeder_source_{k}", s - R * r)
        for k, s, r in zip("dq", eq.parts(source), rest, strict=True)
    )
    (a, b), (c, e) = ((J[0][0] * R + 1, J[0][1] * R), (J[1][0] * R, J[1][1] * R + 1))
    whole = eq.compute("feeder_whole", a * e - b * c)
    eq.require(
        eq.real(eq.evaluate_before(a * e - b * c)),
        "no current settles between an impedance and a load of which one has a negative resistance"
        " ({value:.3g}); raise X_f, or lower T_m so that the static load draws power",
    )
    return (e * d - b * q) / whole + sympy.I * (a * q - c * d) / whole


def _solve(eq, Z, b, B, V_0):
    """ln(v/v_0) by Newton's method, and the static load's admittance there."""
    import sympy
    from sympy import conjugate, re

    v_0 = eq.compute("load_voltage_0", *[sympy.sqrt(_square(eq, V_0))] * 2)
    square = _square(eq, B)
    x = eq.compute("feeder_x0", sympy.log(square / eq.evaluate_before(square)) / 2, 0)
    for k in range(ITERATIONS):
        v_squared = eq.compute(f"{x}_v_squared", (v_0 * sympy.exp(x)) ** 2)
        Y, slope = _static_admittance(eq, x, v_squared)
        W = 1 + Z * (b + Y)
        size = eq.compute(f"{x}_size", _square(eq, W))
        excess = eq.compute(f"{x}_excess", v_squared * size / square - 1)
        steepness = 1 + eq.real(re(conjugate(W) * Z * slope)) / size
        # ln(1 + excess) ~ 2 excess/(2 + excess)
        step = excess / (2 + excess) / sympy.Max(STEEPEST, steepness)
        x = eq.compute(f"feeder_x{k + 1}", x - step, 0)
    return x, _static_admittance(eq, x, (v_0 * sympy.exp(x)) ** 2)[0]


def _static_admittance(eq, x, v_squared):
    """Y = conj(P_s + j Q_s)/v^2 at x = ln(v/v_0), and dY/dx."""
    import sympy
    from sympy import I

    u = eq[sites.static_voltage]
    Y, slope = [], []
    for site in (sites.P_static, sites.Q_static):
        drawn = eq.expand(eq[site], lambda s: s != u).xreplace({u: sympy.exp(x)})
        Y.append(eq.compute(f"{x}_{site.name}", drawn / v_squared))
        slope.append(
            eq.compute(f"{x}_{site.name}_slope", (sympy.diff(drawn, x) - 2 * drawn) / v_squared)
        )
    return Y[0] - I * Y[1], slope[0] - I * slope[1]


def _motor_current(eq):
    """a and b of the motor's current a + b V, from its power at V = 1 and V = -1."""
    if sites.P_motor not in eq:
        return 0, 0
    plus, minus = (_motor_current_at(eq, V) for V in (1, -1))
    return (plus + minus) / 2, (plus - minus) / 2


def _motor_current_at(eq, V):
    import sympy
    from sympy import I, conjugate

    name = eq.V
    P, Q = (eq.expand(eq[site], lambda s: s != name) for site in (sites.P_motor, sites.Q_motor))
    return (P - I * Q).xreplace({name: sympy.sympify(V)}) / conjugate(sympy.sympify(V))


def _affine(eq):
    """Whether the motor's current really is a + b V: tried at V = 2j with every other symbol at
    some number.
    """
    from sympy import Float, I

    a, b = _motor_current(eq)
    off = _motor_current_at(eq, 2 * I) - a - 2 * I * b
    numbers = {s: Float(0.3 + 0.01 * k) for k, s in enumerate(sorted(off.free_symbols, key=str))}
    return (
        abs(complex(off.xreplace({s: n if s.is_real else n * (1 + I) for s, n in numbers.items()})))
        < 1e-9
    )


def _compute_complex_step(eq, name, value, before):
    """A complex quantity computed once, from its two parts."""
    from sympy import I

    pairs = zip("dq", eq.parts(value), eq.parts(eq.evaluate_before(before)), strict=True)
    d, q = (eq.compute(f"{name}_{axis}", now, then) for axis, now, then in pairs)
    return d + I * q


def _square(eq, z):
    """|z|^2."""
    return sum(part**2 for part in eq.parts(z))
