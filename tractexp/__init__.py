"""Identify the parameters of a railway traction load from recorded voltage dips.

Every name below is imported when it is first used, so that `import tractexp` takes no time:

    import tractexp
    dips = tractexp.read("dip1.csv", "dip2.csv")
    fit = tractexp.identify(dips[0], model="third_order_exponential")
    investigation = tractexp.investigate(dips)
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # for editors and type checkers; a test holds it to PUBLIC
    from tractexp.api.compose import compose as compose
    from tractexp.api.convert import convert as convert
    from tractexp.api.discrepancy import investigate as investigate
    from tractexp.api.examples import examples as examples
    from tractexp.api.export import export as export
    from tractexp.api.generalise import generalise as generalise
    from tractexp.api.identify import identify as identify
    from tractexp.api.linear_network import linear_network as linear_network
    from tractexp.api.load import load as load
    from tractexp.api.look import look as look
    from tractexp.api.plan import plan as plan
    from tractexp.api.posterior import posterior as posterior
    from tractexp.api.profile import profile as profile
    from tractexp.api.read import read as read
    from tractexp.api.simulate import simulate as simulate
    from tractexp.api.station import fit_station as fit_station
    from tractexp.api.survey import survey as survey
    from tractexp.errors import UserError as UserError
    from tractexp.model.site_table import sites as sites
    from tractexp.studies.api.benchmark import benchmark as benchmark
    from tractexp.studies.api.compare import compare as compare
    from tractexp.studies.api.paper import paper as paper
    from tractexp.studies.api.search import search as search

    __version__: str

PUBLIC = {
    "UserError": "tractexp.errors",
    "benchmark": "tractexp.studies.api.benchmark",
    "compare": "tractexp.studies.api.compare",
    "compose": "tractexp.api.compose",
    "convert": "tractexp.api.convert",
    "examples": "tractexp.api.examples",
    "export": "tractexp.api.export",
    "fit_station": "tractexp.api.station",
    "generalise": "tractexp.api.generalise",
    "identify": "tractexp.api.identify",
    "investigate": "tractexp.api.discrepancy",
    "linear_network": "tractexp.api.linear_network",
    "load": "tractexp.api.load",
    "look": "tractexp.api.look",
    "paper": "tractexp.studies.api.paper",
    "plan": "tractexp.api.plan",
    "posterior": "tractexp.api.posterior",
    "profile": "tractexp.api.profile",
    "read": "tractexp.api.read",
    "search": "tractexp.studies.api.search",
    "simulate": "tractexp.api.simulate",
    "sites": "tractexp.model.site_table",
    "survey": "tractexp.api.survey",
}
__all__ = ["__version__", *PUBLIC]  # pyright: ignore[reportUnsupportedDunderAll] # __getattr__ gives them


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
