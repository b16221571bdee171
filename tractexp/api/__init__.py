"""The public calls, one file each: typed keyword arguments in, a result that prints, tabulates,
saves and loads out.
"""
