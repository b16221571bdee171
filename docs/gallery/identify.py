"""Identify a load from one dip

A recorded dip of 50 % gives the parameters of a motor and a static load, each with its 95 %
interval. In a terminal: tractexp data=tibet_50pct optimizer=multistart_least_squares
"""

import tractexp

fit = tractexp.identify("tibet_50pct", optimizer="multistart_least_squares")
print(fit.screen())
page = fit.report()
