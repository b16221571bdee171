"""Saturation of the current transformers."""

from tractexp.extend import Effect, Parameter, plugin, sites

from ._phases import beyond, phases_of, vector_of

SOURCE = (
    "IEEE C37.110-2007, guide for the application of current transformers; IEC 61869-2, annex 2B"
)


@plugin
class CurrentTransformerSaturation(Effect):
    r"""The current transformers' cores saturate, and the record lacks what magnetizes them.

        dpsi/dt = omega_n i_seen - psi/T_c - j (omega_n + omega_s) psi,   i_seen = i - m,
        m_k = y sgn(psi_k) max(0, |psi_k| - k |i_before|)

    psi_k is the flux linkage of the core of phase k over its burden, the integral of the secondary
    current; k is how many times the current before it can carry without offset. At y = 0 the base
    model, whatever k and T_c.

    Source: IEEE C37.110-2007; IEC 61869-2, annex 2B.
    Departures: a burden of resistance, two slopes, no hysteresis.
    """

    core_slope = Parameter(
        0.0, (0.0, 6.0), "1", "magnetizing over burden current beyond", SOURCE, "y_c", null=0.0
    )
    core_knee = Parameter(4.0, (1.2, 40.0), "1", "current carried over that before", SOURCE, "k_c")
    core_decay = Parameter(0.2, (0.02, 10.0), "s", "time constant of the secondary", SOURCE, "T_c")

    places, kind = ("measurement",), "law"
    order = 4
    waves_only = "phasors do not show the offset of the current that saturates a core"
    grid = {"core_knee": (1.5, 3.0, 6.0, 12.0), "core_decay": (0.05, 0.3, 3.0)}
    relevant = {"core_slope": 0.02}
    confused_with = ("transformer_saturation",)

    def edit(self, eq, core_slope, core_knee, core_decay):
        import sympy
        from sympy import I

        psi, psi_0 = eq.lag_vector("ct_flux", r"\psi_c"), eq.lag("ct_flux_zero", r"\psi_{c0}")
        knee = core_knee * sympy.sqrt(eq.P0**2 + eq.Q0**2) / eq.U0
        lost = [
            eq.define(f"ct_lost_{name}", core_slope * beyond(flux, knee), f"m_{name}")
            for name, flux in zip("abc", phases_of(eq, psi, psi_0), strict=True)
        ]
        vector, zero = vector_of(eq, lost)
        eq.edit(sites.current, lambda i: i - vector)
        eq.edit(sites.zero_current, lambda i: i - zero)
        speed, before = eq.omega_n + eq.omega_s, (eq.P0 - I * eq.Q0) / eq.U0
        start = eq.omega_n * before / (1 / core_decay + I * (eq.omega_n + eq.omega_s0))
        eq.moves(
            psi,
            eq.omega_n * eq.expression(sites.current) - psi / core_decay - I * speed * psi,
            start,
        )
        eq.moves(psi_0, eq.omega_n * eq.expression(sites.zero_current) - psi_0 / core_decay, 0)
