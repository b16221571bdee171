"""An effect of your own

A class in a file is a plugin: its parameters, and the line that it edits. Here a part of the static
load is drawn again after the dip with a delay.
"""

import tractexp
from tractexp.extend import Effect, Parameter, plugin, sites

SOURCE = "an example"


@plugin
class DrawAgain(Effect):
    """What a dip withheld is drawn afterwards, P_s -> P_s + h P_s0 x, T_h dx/dt = 1 - u - x.

    Source: an example.
    Departures: none.
    """

    hunger = Parameter(0.0, (-2.0, 2.0), "1", "share drawn later", SOURCE, "h", null=0.0)
    hunger_time = Parameter(0.2, (0.05, 1.0), "s", "time it takes", SOURCE, "T_h")

    places, kind = ("static P",), "lag"
    relevant = {"hunger": 0.1}
    grid = {"hunger_time": (0.1, 0.2, 0.4)}

    def edit(self, eq, hunger, hunger_time):
        withheld = eq.lag("withheld", "x")
        eq.moves(withheld, (1 - eq[sites.static_voltage] - withheld) / hunger_time, 0)
        eq.edit(sites.P_static, lambda P: P + hunger * eq.P_s0 * withheld)


model = tractexp.compose(effects=["draw_again"])
values = {name: p.default for name, p in model.parameters.items()} | {"hunger": 1.0}
page = tractexp.simulate(model, values, depth=0.4, duration=0.2, Q0=0.6).report()
print(model)
