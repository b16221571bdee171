"""Sampled currents instead of phasors

A dip of a few cycles is over before a phasor has settled: the model is fitted to the currents as
they were sampled. In a terminal: tractexp data=tibet_30pct_comtrade domain=waves
"""

import tractexp

(dip,) = tractexp.read("tibet_30pct_comtrade", pre=0.1)
search = {"name": "multistart_least_squares", "starts": 1}
fit = tractexp.identify(dip, domain="waves", optimizer=search, check_intervals=False)
print(fit.table())
page = fit.report()
