"""Window over which the recorder averages power."""

from tractexp.extend import Measurement, Parameter, plugin


@plugin
class MeasurementWindow(Measurement):
    """P and Q are averaged over a window centered on their time, as Fourier phasors of one or more
    cycles are.

        P_recorded(t) = 1/W integral of P over t - W/2 ... t + W/2

    P is linear between samples; before the first and after the last it is what it is there. At W =
    0 the base model. A window that ends at its time is this one and a `time_skew` of W/2.

    Source: IEC/IEEE 60255-118-1, phasors by a one-cycle discrete Fourier transform (a boxcar on the
    power).
    Departures: the window acts on power, though the recorder's acts on voltage and current.
    """

    window = Parameter(
        0.0, (0.0, 0.12), "s", "length of the window", "IEC/IEEE 60255-118-1", "W", 0.0
    )

    places, kind = ("measurement",), "lag"
    phasors_only = "waveforms are samples, which no window of phasors averages"
    relevant = {"window": 0.02}
    confused_with = ("time_skew", "stator_resistance")

    def observe(self, power, drive, values):
        from ._recorder import average_power

        average_power(power, drive, values["window"])
        return power
