"""What the data say of an effect that no catalogue holds: a term of the equations, and whether it
survives.
"""
