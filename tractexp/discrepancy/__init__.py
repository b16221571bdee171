"""Where simulation and measurement disagree, which missing effect explains it, and how sure that
is.
"""
