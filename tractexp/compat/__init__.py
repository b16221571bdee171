"""Our uses of private parts of other packages, one module each.

Each says what it uses, why, since which version, the issue upstream, and what to do when that is
mended. A test fails with a sentence when a module is needed no longer or the other package has
changed, and when private parts of another package are used, or its classes changed, anywhere else.
Nothing here imports `tractexp`.
"""
