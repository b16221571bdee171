"""Identify the parameters of a railway traction load from recorded voltage dips."""
