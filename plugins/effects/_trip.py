"""An undervoltage trip of a share of the load, wherever it sits: what `undervoltage_trip` and its
siblings are.
"""

from typing import ClassVar

from tractexp.extend import Effect, Parameter

from ._relay import compute_open_share

SOURCE = (
    "NERC 2016, Dynamic Load Modeling, app. A; WECC composite load model (Ftr1, Vtr1, Ttr1, Vrc1,"
    " Trc1)"
)
TEXTBOOK = (
    "tripped_share",
    "trip_level",
    "trip_delay",
    "reconnect_delay",
    "reconnect_margin",
    "reconnect_ramp",
)


def relay(share, index="", most=0.9, level=0.7, delay=0.05, source=SOURCE):
    """The parameters of a trip in the order of `TEXTBOOK`; `share` says of what, `index` ends their
    symbols.
    """

    def symbol(letter, first=""):
        below = first + index
        return (
            f"{letter}_{{{below}}}" if len(below) > 1 else f"{letter}_{below}" if below else letter
        )

    return (
        Parameter(0.0, (0.0, most), "1", share, source, symbol("F"), null=0.0),
        Parameter(
            level,
            (0.3, 0.95),
            "1",
            "voltage below which it trips, over U_0",
            source,
            symbol("u", "t"),
        ),
        Parameter(
            delay, (0.0, 0.5), "s", "time below the level before it trips", source, symbol("T", "t")
        ),
        Parameter(
            0.5, (0.02, 5.0), "s", "time after recovery before it returns", source, symbol("T", "r")
        ),
        Parameter(
            0.05, (0.01, 0.5), "1", "recovered is this much above the level", source, symbol("h")
        ),
        Parameter(0.1, (0.0, 2.0), "s", "time in which it returns", source, symbol("T", "b")),
    )


class _Trip(Effect):
    """Base of the trips of one stage: a subclass declares the parameters of `relay` and the sites
    that fall.
    """

    phasor_sites: ClassVar[tuple] = ()
    wave_sites: ClassVar[tuple] = ()
    stage: ClassVar[str] = ""  # ends the names of the relay's states

    kind = "trip"
    order = 3

    def __init_subclass__(cls):
        own = [name for name, value in vars(cls).items() if isinstance(value, Parameter)]
        _, level, delay, wait, *_ = own
        cls.grid = {level: (0.5, 0.7, 0.8, 0.9), delay: (0.02, 0.08), wait: (0.2, 1.0)}
        if cls.family:
            cls.as_textbook = dict(zip(own, TEXTBOOK, strict=True))

    def edit(self, eq, **values):
        share, *timers = values.values()
        gone = compute_open_share(eq, *timers, stage=self.stage)
        for site in self.wave_sites if eq.waves else self.phasor_sites:
            eq.edit(site, lambda drawn: drawn * (1 - share * gone))
