"""ACME's own tests: the contracts, in one line. Run where the package is installed."""

import tractexp.testing

TestAcme = tractexp.testing.contract("acme_loads")
