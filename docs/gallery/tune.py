"""Tune an optimizer

The same optimizer under several settings, each a variant of the comparison. A search over many
settings is one for a sweeper: see Sweeps.
"""

import tractexp

settings = {f"producers {share}": {"name": "issa", "producers": share} for share in (0.1, 0.2, 0.4)}
runs = tractexp.search("tibet_50pct", optimizers=settings, seeds=3, budget=300)
print(runs.table())
page = tractexp.compare(runs).report()
