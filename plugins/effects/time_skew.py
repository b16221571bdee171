"""Time skew between the voltage and the power channels."""

from tractexp.extend import Measurement, Parameter, plugin

# of the voltage before: a change between samples that tells how the current follows it
QUIET = 0.005


@plugin
class TimeSkew(Measurement):
    """P and Q reach the record later than the voltage they belong to.

        P_recorded(t) = P(t - tau)

    At tau = 0 the base model. It is the voltage that is moved: the current of the samples on either
    side follows it there, so that an edge of the voltage within the interval is one of the power,
    not a curve that overshoots. In waveforms the currents are cubics through their samples. Before
    the first sample and after the last all is as there.

    Source: instrument transformers and filters of unequal delay, IEC/IEEE 60255-118-1; the cubic is
    Catmull and Rom's 1974.
    Departures: none.
    """

    skew = Parameter(
        0.0,
        (-0.02, 0.02),
        "s",
        "delay of power behind voltage",
        "IEC/IEEE 60255-118-1",
        r"\tau",
        0.0,
    )

    places, kind = ("measurement",), "delay"
    relevant = {"skew": 0.001}
    confused_with = ("stator_resistance", "dc_link_lag", "measurement_window")

    def observe(self, power, drive, values):
        from ._recorder import delay_response, earlier

        if drive.of_waves:
            earlier(power, drive, values["skew"])
        else:
            delay_response(power, drive, values["skew"], QUIET)
        return power
