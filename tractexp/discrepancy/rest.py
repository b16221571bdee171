"""What is left beside the models of an investigation: its shapes, and one sentence on them."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

from tractexp.discrepancy.overlay import Overlay, find_remainder
from tractexp.discrepancy.remainder import Remainder
from tractexp.noise import Noise
from tractexp.text.wording import join_words


@dataclass(frozen=True, eq=False)
class RemainingShapes:
    """The shapes in what models leave, the loudest first.

    Attributes
    ----------
    of_best : list of Remainder
        Of the extended model, or of the nearest candidates; none where noise alone is left.
    of_base : list of Remainder
        Of the base model alone, where nothing was added: the nearest candidates may have patched
        something up. It is as least squares fit it or as the likelihood does, by whichever shapes
        tell more: least squares spread over a record what happens at one moment.
    """

    of_best: list[Remainder]
    of_base: list[Remainder]

    def describe(
        self, names: Sequence[str], withheld: Collection[str], *, has_nearest: bool
    ) -> str:
        """The loudest shape of the model whose remainder shapes describe best, in one sentence.

        Parameters
        ----------
        names : names
            The effects that were added.
        withheld : names
            Held-out events.
        has_nearest : bool
            Whether `of_best` are shapes of the nearest candidates, not of the base model.

        Returns
        -------
        str
            "" where nothing is left.
        """
        if names and self.of_best:
            return f"beside {join_words(names)} this is left: {self.of_best[0]}"
        is_of_base = share_of(self.of_base) > share_of(self.of_best)
        shapes = self.of_base if is_of_base else self.of_best
        if not shapes:
            return ""
        is_of_nearest = has_nearest and not is_of_base
        whose = "the nearest candidates miss" if is_of_nearest else "the base model misses"
        where = " on the held-out events" if shapes[0].event in withheld else ""
        return f"{whose} this{where}: {shapes[0]}"


def find_shapes(overlays: Sequence[Overlay], noise: Noise, false_alarms: float) -> list[Remainder]:
    """The shapes in what is left of the fitted events; of the held-out ones only where those show
    none: what explains them may not hold beyond.
    """
    fitted, beyond = ([o for o in overlays if o.held_out == there] for there in (False, True))
    return find_remainder(fitted, noise, false_alarms) or find_remainder(
        beyond, replace(noise, input_modes=None), false_alarms
    )


def share_of(shapes: Sequence[Remainder]) -> float:
    """The share of what is left that these shapes make up."""
    return sum(shape.share for shape in shapes)
