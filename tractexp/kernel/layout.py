"""What a kernel is given: the rows of its sampled inputs, the columns of an event, and how many
lanes go together.
"""

# Rows of the inputs: U_rate is the slope of U there [pu/s], U_angle the voltage's angle [rad] in a
# frame that turns at nominal speed.
PHASOR_INPUTS = ("U", "omega_s", "U_rate", "U2", "t", "U_angle")
# Those of waves follow: the voltage's space vector v in the frame, its zero sequence, their slopes,
# and the frame's angle to phase a by cosine and sine.
WAVE_INPUTS = (
    "v_d",
    "v_q",
    "v_zero",
    "v_d_rate",
    "v_q_rate",
    "v_zero_rate",
    "turn_re",
    "turn_im",
)
INPUTS = (*PHASOR_INPUTS, *WAVE_INPUTS)
# what is a cubic between samples: its slope. The speed omega_s is that of the angle, so that within
# a step the angle moves by what it was recorded to move, also where it jumps.
SMOOTH = {name: f"{name}_rate" for name in ("U", "v_d", "v_q", "v_zero")} | {"U_angle": "omega_s"}
EVENT = ("U0", "omega_s0", "U20", "omega_n", "step")  # one number each per event
# lanes of a vector: wider than many a processor's, whose instructions then need not wait for each
# other
VECTOR_LANES = 8
# candidates advanced together at most: enough to fill the waits of one step, and few enough for the
# cache
LANES = 56
