"""Saturation of the load's transformers: inrush when the voltage returns."""

from tractexp.extend import Effect, Parameter, plugin

from ._phases import beyond, phases_of, vector_of

SOURCE = (
    "Blume et al. 1951, Transformer Engineering; Chiesa, Mork, Hoidalen 2010, IEEE Trans. Power"
    " Delivery 25(4)"
)


@plugin
class TransformerSaturation(Effect):
    r"""The cores of transformers at the bus saturate where the flux that a dip leaves offset passes
    their knee.

        dpsi/dt = omega_n v - psi/T_l - j (omega_n + omega_s) psi,
        m_k = y sgn(psi_k) max(0, |psi_k| - k |psi_before|)

    psi_k is the flux linkage of phase k, the integral of its voltage, and m_k the current it draws
    beside what it drew before. An offset of psi decays with T_l: until then each cycle has one
    peak, with even harmonics. At y = 0 the base model, whatever knee and T_l. The zero sequence of
    m_k flows in a delta winding and is not seen.

    Source: Blume et al. 1951, two-slope core; Chiesa, Mork, Hoidalen 2010, leg fluxes and residual
    flux.
    Departures: three cores of their own, no hysteresis; what the leak T_l takes is not drawn;
    saturation before the event belongs to the static load.
    """

    saturated_admittance = Parameter(
        0.0, (0.0, 10.0), "pu", "slope beyond the knee", SOURCE, "y", null=0.0, power_exponent=1
    )
    flux_knee = Parameter(
        1.1, (1.0, 1.6), "1", "flux at the knee over its peak before", SOURCE, "k"
    )
    flux_decay = Parameter(0.2, (0.02, 3.0), "s", "decay of the flux's offset", SOURCE, "T_l")

    places, kind = ("bus",), "law"
    waves_only = (
        "an offset of the flux is none of the fundamental; transformer_inrush stands for it in"
        " phasors"
    )
    grid = {"flux_knee": (1.02, 1.15, 1.3), "flux_decay": (0.05, 0.2, 1.0)}
    relevant = {"saturated_admittance": 0.1}
    confused_with = ("harmonics_source", "current_transformer_saturation")

    def edit(self, eq, saturated_admittance, flux_knee, flux_decay):
        import sympy
        from sympy import I

        psi, speed = eq.lag_vector("core_flux", r"\psi_m"), eq.omega_n + eq.omega_s
        eq.moves(
            psi,
            eq.omega_n * eq.v - psi / flux_decay - I * speed * psi,
            self._compute_initial_flux(eq, flux_decay),
        )
        eq.states[psi].derived = True
        knee = flux_knee * eq.omega_n * eq.U0 / sympy.sqrt(1 / flux_decay**2 + speed**2)
        drawn = [
            eq.define(f"magnetizing_{name}", saturated_admittance * beyond(flux, knee), f"m_{name}")
            for name, flux in zip("abc", phases_of(eq, psi, 0), strict=True)
        ]
        eq.draw(vector_of(eq, drawn)[0])

    @staticmethod
    def _compute_initial_flux(eq, flux_decay):
        from sympy import I

        return eq.omega_n * eq.v / (1 / flux_decay + I * (eq.omega_n + eq.omega_s))
