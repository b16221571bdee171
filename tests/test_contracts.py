"""Every built-in plugin against the contracts that a third party's plugins are held to."""

import tractexp.testing

SAMPLES = {
    "csv": [{"train": ["pkg://tractexp.data/tibet_50pct.csv"], "validate": ["pkg://tractexp.data/tibet_30pct.csv"]}]
}

TestBuiltIn = tractexp.testing.contract("tractexp_plugins", SAMPLES)
