"""Static load that depends on frequency."""

from tractexp.extend import Effect, Parameter, plugin, sites

SOURCE = "IEEE Task Force 1993/1995; Kundur 1994, section 7.1"


@plugin
class FrequencyDependence(Effect):
    """The static load's power changes with the frequency.

        P_s -> P_s (1 + k_pf df),   Q_s -> Q_s (1 + k_qf df),   df = (omega_s - omega_s0)/omega_n

    The motor's synchronous speed follows the recorded frequency in the base model already. At k_pf
    = k_qf = 0 the base model.

    Source: IEEE Task Force 1995, standard load models; Kundur 1994, section 7.1.
    Departures: the deviation counts from the frequency before the event.
    """

    k_pf = Parameter(
        0.0,
        (-4.0, 4.0),
        "1",
        "relative change of P per relative change of frequency",
        SOURCE,
        null=0.0,
    )
    k_qf = Parameter(
        0.0,
        (-6.0, 6.0),
        "1",
        "relative change of Q per relative change of frequency",
        SOURCE,
        null=0.0,
    )

    places, kind = ("static P", "static Q"), "law"
    reads = ("f",)
    phasors_only = (
        "the frame of waveforms turns at the frequency before the event, and what changes it is in"
        " the voltage"
    )
    relevant = {"k_pf": 1.0, "k_qf": 1.0}
    confused_with = ("load_change",)

    def refusal(self, eq):
        return (
            "its static load depends on the frequency already" if "static_frequency" in eq else None
        )

    def edit(self, eq, k_pf, k_qf):
        deviation = (eq.omega_s - eq.omega_s0) / eq.omega_n
        eq.edit(sites.P_static, lambda P: P * (1 + k_pf * deviation))
        eq.edit(sites.Q_static, lambda Q: Q * (1 + k_qf * deviation))
