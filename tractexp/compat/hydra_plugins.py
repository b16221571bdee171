"""Sweepers and launchers of our own, which Hydra makes from modules below `hydra_plugins` only.

What: `Plugins.instance().register` is public and takes any class; but `Plugins._instantiate`
refuses a `_target_` that does not begin with `hydra_plugins.`, and then looks the class up by its
`__module__` and imports that module. So an admitted class says it lives in
`hydra_plugins.tractexp`, and there is a module of that name that holds it. Why not as Hydra's
manual has it: a `hydra_plugins` folder in our package would be searched and imported at the start
of every Hydra program of the environment, not just ours. Since: Hydra 1.0; looked at in 1.3.2 to
1.4.0rc3. Upstream: facebookresearch/hydra#1554, #3015; facebookresearch/hydra#3449 (merged for the
version after 1.3) finds plugins by entry points instead of by namespace. When mended: drop this
module, give `_target_` the classes' own paths, and call `Plugins.instance().register(cls)`.
"""

import importlib
import sys
from types import ModuleType

NAMESPACE = "hydra_plugins.tractexp"


def admit(cls: type) -> None:
    """Register a sweeper or launcher with Hydra under the target `NAMESPACE`.<name
    of the class>.
    """
    from hydra.core.plugins import Plugins

    cls.__module__ = NAMESPACE
    Plugins.instance().register(cls)
    package, _, name = NAMESPACE.partition(".")
    try:
        parent = importlib.import_module(package)
    except ModuleNotFoundError:  # no plugin of anyone's is installed
        parent = sys.modules[package] = ModuleType(package)
        parent.__path__ = []
    module = sys.modules.setdefault(NAMESPACE, ModuleType(NAMESPACE))
    setattr(module, cls.__name__, cls)
    setattr(parent, name, module)
