"""Effects that no dip tells apart, `prove_same`, in one class, `compare_predictions`; and those
that only look alike.
"""

import numpy as np
from made_alike import fitted_alike

from tractexp.discrepancy.classes import compare_predictions, describe_classes, group_alike
from tractexp.discrepancy.evidence import SLIGHT_ERROR
from tractexp.discrepancy.next_event.choose import find_next_event
from tractexp.discrepancy.next_event.same import prove_same


def test_sets_that_are_one_function_of_the_voltage_are_one_class():
    """Beside them another effect is a class of its own, from the mildest dip on in which it differs
    from either.
    """
    bench, _, _, fits = fitted_alike()
    every = [fits[name] for name in ("stator_resistance", "speed_dependent_torque", "leakage_loss")]
    pair = [every[0], every[2]]
    (one,) = compare_predictions(bench, pair, [fit.names for fit in pair], 0.0)
    assert one.part_at is None
    assert one.by < SLIGHT_ERROR
    assert describe_classes([one]).startswith("one class: they predict alike within ")
    both, other = compare_predictions(bench, every, [fit.names for fit in every], 0.0)
    assert both.sets == (("stator_resistance",), ("leakage_loss",))
    assert other.sets == (("speed_dependent_torque",),)
    assert both.part_at == other.part_at
    told = describe_classes([both, other])
    assert told.startswith("2 classes: they predict alike in milder dips, and part by ")
    assert told.endswith("; no dip tried parts stator_resistance and leakage_loss")


def test_each_joins_the_first_group_of_which_it_is_parted_from_none():
    parted = np.zeros((4, 4), bool)
    parted[0, 1] = parted[1, 0] = parted[3, 2] = parted[2, 3] = True
    assert group_alike(parted) == [[0, 2], [1, 3]]


def test_an_equation_in_another_parameter_is_proved_to_be_the_same():
    bench, noise, bare, fits = fitted_alike()
    pair = fits["stator_resistance"], fits["leakage_loss"]
    chosen = find_next_event(bench, noise, bare, pair, ["copper", "loss"])
    ((one, other, proof),) = chosen.same
    assert (one, other) == (0, 1)
    assert proof["off"] < 1e-6
    assert proof["rank"] == len(bench.coordinates.base) + 1
    assert chosen.sentence().startswith(
        "copper and loss cannot be told apart by any dip at this bus: over "
    )
    assert chosen.probability < 0.05


def test_effects_that_only_look_alike_are_not_called_the_same():
    bench, _, _, fits = fitted_alike()
    assert prove_same(bench, fits["stator_resistance"], fits["speed_dependent_torque"]) is None
