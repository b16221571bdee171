"""What the paper prints: its tables, its settings, and the readings that its text leaves open.

Source: Wu, Fan and Zou 2022, Energies 15(14), 5034.
"""

NAMES = ("T_prime", "X_prime", "C", "M", "T_m", "p_v", "q_v")

# Tables 2 (the first column) and 3: parameters, relative errors of Eq. (20) as fractions, objective of Eq. (8).
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
ITERATIONS, POPULATION = 300, 50  # sections 4.2 and 4.3; the optimizers' defaults
ALPHA = 0.3  # of Eq. (14), section 3.2.1
INGREDIENTS = {
    "tent_initialization": "tent initialization",
    "levy": "Lévy flight",
    "gaussian": "Gaussian variation",
    "tent_perturbation": "tent perturbation",
}

# What the text leaves open, as settings of the two sparrow searches.
READINGS = {
    "unit cube, better-only, element-wise (default)": {},
    "raw units, better-only, element-wise": {"space": "raw"},
    "raw units, better-only, one scalar for A⁺L": {"space": "raw", "step": "scalar"},
    "raw units, every move, one scalar (to the letter)": {"space": "raw", "step": "scalar", "acceptance": "all"},
    "default, 40 % perceivers (SD = 20 of 50)": {"perceivers": 0.4},
}
ISSA_READINGS = {
    "default, perturbation by stage (3.2.3)": {"schedule": "stage"},
    "default, Eq. (15) as printed": {"levy_formula": "printed"},
}
