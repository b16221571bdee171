"""Load torque that depends on speed."""

from tractexp.extend import Effect, Parameter, plugin, sites

SOURCE = "WECC composite load model (Etrq = 2); Milano 2010, ch. 15 (quadratic torque)"


@plugin
class SpeedDependentTorque(Effect):
    """Part of the torque the motor drives falls with the square of its speed, as fans and pumps do.

        T_L = T_m (1 - k + k ((omega + omega_n)/(omega_0 + omega_n))^2)

    omega_0 is the speed before the event, so that T_m keeps its meaning. At k = 0 the base model.

    Source: WECC composite load model specification (Etrq); Milano 2010, ch. 15.
    Departures: the exponent is 2 and the share is free, where WECC's share is 1 and the exponent
    free.
    """

    quadratic_share = Parameter(
        0.0,
        (0.0, 1.0),
        "1",
        "share of the torque that is quadratic",
        SOURCE,
        "k",
        null=0.0,
        natural_ends=(1.0,),  # of fans and pumps
    )

    places, kind = ("load torque",), "law"
    relevant = {"quadratic_share": 0.25}
    confused_with = ("feeder_impedance", "second_motor_group", "magnetic_saturation")

    def edit(self, eq, quadratic_share):
        speed = (eq.omega + eq.omega_n) / (eq.evaluate_before(eq.omega) + eq.omega_n)
        eq.edit(sites.load_torque, lambda T: T * (1 - quadratic_share + quadratic_share * speed**2))
