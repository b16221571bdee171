"""Static load that depends on frequency."""

from tractexp.model.parts import Effect
from tractexp.parameter import Parameter
from tractexp.plugin import plugin

SOURCE = "IEEE Task Force 1993/1995; Kundur 1994, section 7.1"


@plugin
class FrequencyDependence(Effect):
    """The static load's power changes with the frequency.

        P_s -> P_s (1 + k_pf df),   Q_s -> Q_s (1 + k_qf df),   df = (omega_s - omega_s0)/omega_n

    The motor's synchronous speed follows the recorded frequency in the base model already. At k_pf = k_qf = 0 the
    base model.

    Source: IEEE Task Force 1995, standard load models; Kundur 1994, section 7.1.
    Departures: the deviation counts from the frequency before the event.
    """

    k_pf = Parameter(0.0, (-4.0, 4.0), "1", "relative change of P per relative change of frequency", SOURCE, null=0.0)
    k_qf = Parameter(0.0, (-6.0, 6.0), "1", "relative change of Q per relative change of frequency", SOURCE, null=0.0)

    needs = ("P_static", "Q_static")
    reads = ("f",)
    relevant = {"k_pf": 1.0, "k_qf": 1.0}
    confused_with = ("load_drift",)

    def refusal(self, eq):
        twice = eq.has("static_frequency")
        return "its static load depends on the frequency already" if twice else super().refusal(eq)

    def edit(self, eq):
        factors = eq.declare(self.parameters)
        deviation = (eq.omega_s - eq.omega_s0) / eq.omega_n
        for name, k in zip(("P_static", "Q_static"), factors, strict=True):
            eq.edit(name, lambda power, k=k: power * (1 + k * deviation))
