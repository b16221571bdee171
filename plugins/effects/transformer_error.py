"""Error of scale and angle between the transformers of current and of voltage."""

from tractexp.extend import INPUTS, Measurement, Parameter, plugin


@plugin
class TransformerError(Measurement):
    """The current is recorded too large and turned, with respect to the voltage, by a small factor.

        i -> i_before + (1 + e_s + j e_a) (i - i_before)

    i_before is the current before the event, which is taken as recorded: the load draws P_0 and Q_0
    there. At e_s = e_a = 0 the base model.

    Source: IEC 61869-2 and -3, classes of current and voltage transformers: ratio error and phase
    displacement.
    Departures: one factor for three phases; the zero sequence is left as it is.
    """

    scale_error = Parameter(0.0, (-0.1, 0.1), "1", "ratio error", "IEC 61869-2", "e_s", null=0.0)
    angle_error = Parameter(
        0.0, (-0.1, 0.1), "rad", "phase displacement of the current", "IEC 61869-2", "e_a", null=0.0
    )

    places, kind = ("measurement",), "law"
    waves_only = (
        "in phasors P and Q are taken as they are, and an angle between them hides in the load"
    )
    relevant = {"scale_error": 0.01, "angle_error": 0.01}
    confused_with = ("time_skew", "stator_resistance")

    def observe(self, power, drive, values):
        out = power.copy()
        for e in range(drive.events):
            part = drive.part(e)
            rows = dict(zip(INPUTS, drive.inputs[:, part], strict=True))
            before = (drive.before[e, 0] - 1j * drive.before[e, 1]) / drive.event[e, 0]
            off = (
                out[0, :, part]
                + 1j * out[1, :, part]
                - before * (rows["turn_re"] + 1j * rows["turn_im"])
            )
            off = off * (values["scale_error"][e] + 1j * values["angle_error"][e])[:, None]
            out[0, :, part] += off.real
            out[1, :, part] += off.imag
        return out
