"""What a kernel is given: the rows of its sampled inputs, the columns of an event, and how many
lanes go together.
"""

# Rows of the inputs: U_rate is the slope of U there [pu/s]. Those of waves follow: the voltage's
# space vector v in the frame, its zero sequence, their slopes, and the frame's angle to phase a by
# cosine and sine.
INPUTS = (
    "U",
    "omega_s",
    "U_rate",
    "U2",
    "t",
    "v_d",
    "v_q",
    "v_zero",
    "v_d_rate",
    "v_q_rate",
    "v_zero_rate",
    "turn_re",
    "turn_im",
)
# what is a cubic between samples: its slope
SMOOTH = {name: f"{name}_rate" for name in ("U", "v_d", "v_q", "v_zero")}
EVENT = ("U0", "omega_s0", "U20", "omega_n", "step")  # one number each per event
# lanes of a vector: wider than many a processor's, whose instructions then need not wait for each
# other
VECTOR_LANES = 8
# candidates advanced together at most: enough to fill the waits of one step, and few enough for the
# cache
LANES = 56
