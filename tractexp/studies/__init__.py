"""Studies of the framework itself: the paper's experiments, comparisons of runs, and optimizers on
BBOB.

The rest of the package does not import them. Their tasks are found as plugins are:
`tractexp.studies.api` is an entry point of the group `tractexp.plugins`.
"""
