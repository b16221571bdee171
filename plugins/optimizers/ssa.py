"""The traditional sparrow search algorithm."""

from tractexp.extend import plugin

from ._sparrow import Sparrow


@plugin
class SSA(Sparrow):
    """Sparrow search: producers shrink or jump, scroungers follow or starve, perceivers flee.

    A whole population moves at once; an iteration simulates it once, and the producers who perceive
    once more.

    Source: traction load paper, Eqs. (9)-(13), after Xue and Shen 2020, "A novel swarm intelligence
    optimization approach: sparrow search algorithm".
    Departures: none with space=raw, step=scalar but the order of moves: a producer who perceives
    moves twice, and X_P is the best producer after selection. The defaults differ: the unit cube,
    because Q of Eq. (12) is N(0, 1) whatever the bounds; element-wise steps, because the printed
    sum adds seconds to per unit.
    """
