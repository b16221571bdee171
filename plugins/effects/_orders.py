"""What the effects that raise a motor's order ask of it."""

FLUX, SPEED = "flux", "speed"


def list_moving_states(eq, role):
    """The motor's states of a role that move, by name; those of a second machine count, too."""
    return [
        s.symbol
        for s in eq.states.values()
        if s.role == role and s.writer == "motor" and s.derivative != 0
    ]
