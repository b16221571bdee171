"""Identify the parameters of a railway traction load from recorded voltage dips.

Every name below is imported when it is first used, so that `import tractexp` takes no time:

    import tractexp
    dips = tractexp.read("dip1.csv", "dip2.csv")
    fit = tractexp.identify(dips[0], model="third_order_exponential")
    found = tractexp.investigate(dips)
"""

import importlib
import os
from typing import Any

# Our matrices have a dozen columns: BLAS threads only wait for each other (a hundredfold under load), and their
# number would change the last bits of a result. Has to be said before NumPy is imported.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

PUBLIC = {
    "UserError": "tractexp.errors",
    "benchmark": "tractexp.api.benchmark",
    "compare": "tractexp.api.compare",
    "compose": "tractexp.api.compose",
    "convert": "tractexp.api.convert",
    "export": "tractexp.api.export",
    "generalise": "tractexp.api.generalise",
    "identify": "tractexp.api.identify",
    "investigate": "tractexp.api.discrepancy",
    "load": "tractexp.api.load",
    "look": "tractexp.api.look",
    "paper": "tractexp.api.paper",
    "plan": "tractexp.api.plan",
    "posterior": "tractexp.api.posterior",
    "profile": "tractexp.api.profile",
    "read": "tractexp.api.read",
    "simulate": "tractexp.api.simulate",
    "sites": "tractexp.model.site_table",
    "survey": "tractexp.api.survey",
}
__all__ = ["__version__", *PUBLIC]  # pyright: ignore[reportUnsupportedDunderAll] # made by __getattr__ when asked for


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        value: Any = version("tractexp")
    elif name in PUBLIC:
        value = getattr(importlib.import_module(PUBLIC[name]), name)
    else:
        raise AttributeError(f"module 'tractexp' has no attribute '{name}'")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted([*globals(), *__all__])
