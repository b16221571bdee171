"""Identify the parameters of a railway traction load from recorded voltage dips."""

import os

# Our matrices have a dozen columns: BLAS threads only wait for each other (a hundredfold under load), and their
# number would change the last bits of a result. Has to be said before NumPy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
