"""What the paper prints: its tables, its settings, and the readings that its text leaves open.

Source: Wu, Fan and Zou 2022, Energies 15(14), 5034.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

NAMES = ("T_prime", "X_prime", "C", "M", "T_m", "p_v", "q_v")

# Tables 2 (the first column) and 3: parameters, relative errors of Eq. (20) as fractions, objective
# of Eq. (8).
TABLE_3 = {
    "issa": (4.1354, 1.6654, -2.6241, 0.82, 3.378, 3.5867, 3.056),
    "ssa": (-3.8726, 1.8054, 1.8197, 0.3427, 3.0239, 1.9803, 2.128),
    "pso": (2.1863, 0.75606, 0.627, 1.7738, 1.2298, 2.5629, 1.286),
}
EPSILON_P = {"issa": 3.847e-2, "ssa": 4.4512e-2, "pso": 4.1205e-2}
EPSILON_Q = {"issa": 6.07e-3, "ssa": 1.135e-2, "pso": 1.6175e-2}
OBJECTIVE = {"issa": 2.851e-3, "ssa": 3.712e-3, "pso": 4.49e-3}

# Tables 4 and 5: the mean residual of Eq. (21), of P and of Q.
INTERPOLATION = {"issa": (1.66e-2, 2.987e-3), "ssa": (1.81e-2, 7.46e-3), "pso": (1.48e-2, 6.1e-3)}
EXTRAPOLATION = {"issa": (2.86e-2, 1.3e-2), "ssa": (3.11e-2, 2.31e-2), "pso": (2.76e-2, 2.11e-2)}

# Table 1: accuracy of P, of Q, "stability accuracy", identifiability, calculation size.
TABLE_1 = {
    "electromechanical": ("better", "better", "better", "identifiable", "large"),
    "mechanical": ("good", "bad", "better", "unidentifiable", "small"),
    "voltage": ("bad", "good", "good", "unidentifiable", "small"),
}

COMPARED = ("issa", "ssa", "pso")
LABELS = {"issa": "ISSA", "ssa": "SSA", "pso": "PSO", "random_search": "the best of random points"}
ITERATIONS, POPULATION = 300, 50  # sections 4.2 and 4.3; the optimizers' defaults
# simulations of the thriftiest of the three, PSO, in so many iterations
EQUAL = POPULATION * (ITERATIONS + 1)
TENT_ALPHA = 0.3  # of Eq. (14), section 3.2.1
INGREDIENTS = {  # as the optimizers without it are called: the switch, and what it is
    "tent_init": ("tent_initialization", "tent initialization"),
    "levy": ("levy", "Lévy flight"),
    "gaussian": ("gaussian", "Gaussian variation"),
    "tent_perturbation": ("tent_perturbation", "tent perturbation"),
}


@dataclass(frozen=True)
class PrintedReading:
    """An optimizer with what the text leaves open settled; a `literal` one searches the model that
    Eq. (4) integrates as it is printed.
    """

    optimizer: str
    words: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    literal: bool = False

    @property
    def node(self) -> dict[str, Any]:
        """The optimizer with its settings."""
        return {"name": self.optimizer, **self.settings}


LETTER = {"space": "raw", "step": "scalar", "acceptance": "all"}

# By the names that the optimizers have in conf/optimizer. The first three are what Tables 2 to 5
# show.
READINGS: dict[str, PrintedReading] = {
    "issa": PrintedReading("issa", "SD = 20 of 50 (4.3)"),
    "ssa": PrintedReading("ssa", "SD = 20 of 50 (4.3)"),
    "pso": PrintedReading("pso", "no velocity limit"),
    "issa_10_perceivers": PrintedReading("issa", "10 perceivers (4.2)", {"perceivers": 0.2}),
    "ssa_10_perceivers": PrintedReading("ssa", "10 perceivers (4.2)", {"perceivers": 0.2}),
    "pso_limited": PrintedReading("pso", "velocity limit 0.2", {"velocity_limit": 0.2}),
    "issa_to_the_letter": PrintedReading(
        "issa", "to the letter", LETTER | {"levy_formula": "printed"}, literal=True
    ),
    "ssa_to_the_letter": PrintedReading("ssa", "to the letter", LETTER, literal=True),
    "pso_to_the_letter": PrintedReading("pso", "to the letter", literal=True),
    "issa_raw": PrintedReading("issa", "raw units", {"space": "raw"}),
    "ssa_raw": PrintedReading("ssa", "raw units", {"space": "raw"}),
    "issa_raw_scalar": PrintedReading(
        "issa", "raw units, one scalar for A⁺L", {"space": "raw", "step": "scalar"}
    ),
    "ssa_raw_scalar": PrintedReading(
        "ssa", "raw units, one scalar for A⁺L", {"space": "raw", "step": "scalar"}
    ),
    "issa_by_stage": PrintedReading("issa", "perturbation by stage (3.2.3)", {"schedule": "stage"}),
    "issa_printed_levy": PrintedReading("issa", "Eq. (15) as printed", {"levy_formula": "printed"}),
    **{
        f"issa_no_{name}": PrintedReading("issa", f"without {label}", {switch: False})
        for name, (switch, label) in INGREDIENTS.items()
    },
    "random_search": PrintedReading("random_search", "the best of random points"),
}


def label(name: str) -> str:
    """ "issa_10_perceivers" -> "ISSA, 10 perceivers (section 4.2)"; the three of the tables are
    named alone.
    """
    reading = READINGS[name]
    return LABELS[name] if name in LABELS else f"{LABELS[reading.optimizer]}, {reading.words}"


# section 4.2's reading of the same optimizer
TEN = {"issa": "issa_10_perceivers", "ssa": "ssa_10_perceivers"}
LITERAL = {name: f"{name}_to_the_letter" for name in COMPARED}
