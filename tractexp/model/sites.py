"""The sites of a load: the places in its equations that an effect may edit, each with its type and
its owner.

A motor places its own (`eq.place(sites.coupling, C)`), the framework those of the static load and
of the bus. An effect edits them (`eq.edit(sites.P_static, change)`) or reads them
(`eq[sites.static_voltage]`). A real site stays real.
"""

from dataclasses import dataclass
from typing import Literal, NoReturn

from tractexp.errors import Unknown, UserError, list_allowed


@dataclass(frozen=True)
class Site:
    """A place in the equations. `latex` is its usual symbol, which a part may replace where it
    places it.
    """

    name: str
    latex: str
    kind: Literal["real", "phasor"]
    unit: str
    owner: Literal["motor", "static", "bus"]
    about: str


motor_voltage = Site(
    "motor_voltage", "V", "phasor", "pu", "motor", "voltage at the motor's terminals"
)
stator_impedance = Site(
    "stator_impedance", "Z'", "phasor", "pu", "motor", "impedance from the terminals to the flux"
)
backward_impedance = Site(
    "backward_impedance",
    "Z_-",
    "phasor",
    "pu",
    "motor",
    "impedance that meets a field turning backwards, but for the rotor's resistance",
)
internal_voltage = Site(
    "internal_voltage",
    "E",
    "phasor",
    "pu",
    "motor",
    "voltage behind it, of motors where it is no state",
)
stator_current = Site(
    "stator_current", "I", "phasor", "pu", "motor", "current into the motor's terminals"
)
coupling = Site(
    "coupling", "c", "real", "1", "motor", "(X - X')/X, the rotor's share in the reactance"
)
time_constant = Site(
    "time_constant", r"\tau'", "real", "s", "motor", "transient time constant X'/X T0'"
)
electrical_torque = Site(
    "electrical_torque", "T_e", "real", "pu", "motor", "torque the field exerts on the rotor"
)
load_torque = Site("load_torque", "T_L", "real", "pu", "motor", "torque of what the motor drives")
bus_voltage = Site(
    "bus_voltage", "v", "phasor", "pu", "bus", "voltage that all parts see, as recorded (waves)"
)
bus_voltage_rate = Site(
    "bus_voltage_rate",
    r"\dot v",
    "phasor",
    "pu/s",
    "bus",
    "its slope, where a part reads it (waves)",
)
motor_current = Site(
    "motor_current", "i_d", "phasor", "pu", "motor", "current that the motors draw (waves)"
)
P_motor = Site("P_motor", "P_d", "real", "pu", "motor", "active power of the motor")
Q_motor = Site("Q_motor", "Q_d", "real", "pu", "motor", "reactive power of the motor")
static_voltage = Site(
    "static_voltage",
    "u",
    "real",
    "1",
    "static",
    "voltage over that before the event, where it acts",
)
P_static = Site("P_static", "P_s", "real", "pu", "static", "active power of the static load")
Q_static = Site("Q_static", "Q_s", "real", "pu", "static", "reactive power of the static load")
current = Site("current", "i", "phasor", "pu", "bus", "current of all parts together (waves)")
zero_current = Site(
    "zero_current",
    "i_0",
    "real",
    "pu",
    "bus",
    "zero-sequence current of all parts together (waves)",
)
P = Site("P", "P", "real", "pu", "bus", "active power of all parts together")
Q = Site("Q", "Q", "real", "pu", "bus", "reactive power of all parts together")

PLACES = {  # where an effect acts, in a reader's words, and the sites it edits there
    "stator impedance": ("stator_impedance", "stator_current"),
    "coupling": ("coupling",),
    "flux decay": ("time_constant", "internal_voltage"),
    "speed": (),  # the rotor's balance, which is no site
    "load torque": ("electrical_torque", "load_torque"),
    "motor": ("motor_current", "P_motor", "Q_motor"),
    "static P": ("P_static",),
    "static Q": ("Q_static",),
    "converter share": ("P_static", "Q_static"),
    "bus": (
        "motor_voltage",
        "static_voltage",
        "bus_voltage",
        "bus_voltage_rate",
        "current",
        "zero_current",
        "P",
        "Q",
    ),
    "measurement": ("current", "zero_current", "P", "Q"),
}
KINDS = {  # what an effect does there
    "law": "depends on a local quantity by a law",
    "lag": "lags",
    "limit": "limits",
    "trip": "trips and returns",
    "delay": "delays",
    "oscillation": "oscillates",
    "drift": "drifts",
}

SITES = {site.name: site for site in list(globals().values()) if isinstance(site, Site)}


def __getattr__(name: str) -> NoReturn:
    """Raise `Unknown` for a site that there is not, with the nearest one."""
    if name.startswith("_"):  # what Python itself looks for in a module
        raise AttributeError(name)
    raise Unknown(f"there is no 'sites.{name}'{list_allowed(name, SITES, 'Sites')}")


def find_site(what: "Site | str") -> Site:
    """The site itself, or the one of that name. Raises `UserError` with the nearest name where
    there is none.
    """
    if isinstance(what, Site):
        return what
    if what not in SITES:
        raise UserError(f"there is no site '{what}'{list_allowed(what, SITES, 'Sites')}")
    return SITES[what]
