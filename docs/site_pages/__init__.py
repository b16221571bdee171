"""What the documentation site holds besides the pages in `docs/`: pages generated from the plugins,
and equations.

`docs/conf.py` calls it when the site is built; nothing of the package `tractexp` knows of it.
"""
