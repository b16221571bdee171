"""The paper's experiments, done again: what it prints, what its equations allow, and what we
measure.

The only package of the framework that names plugins, because the paper does.
"""
