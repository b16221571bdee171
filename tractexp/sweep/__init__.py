"""Sweeps: many jobs, each isolated, each run once, under one parent run.

`sweeper` decides which jobs there are and which are still to be done, `launcher` runs them on the
cores, `job` is one of them. The state of a sweep is in its folder: a `status.json` per job, and
`sweep.json` for the whole.
"""
