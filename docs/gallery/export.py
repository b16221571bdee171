"""Hand the load to a simulator

An identified load as ANDES reads it, on the motor's own rating; it is played back, and the
difference is told. In a terminal: tractexp task=export task.parameters=RUN task.format=andes
"""

import tractexp

search = {"name": "multistart_least_squares", "starts": 2}
fit = tractexp.identify("tibet_50pct", optimizer=search, check_intervals=False)
made = tractexp.export(fit, "andes", bus=4, power=20.0, doubtful=True)
print(made)
page = fit.sheet()
