"""The dips of a station

A folder of records: each dip with its depth and whether it is worth fitting; then those that are,
fitted together, one held out to judge. In a terminal: tractexp survey records
"""

import tractexp

dips = tractexp.examples("records")
table = tractexp.survey("records").to_frame()
print(table[["file", "depth", "duration", "worth"]].to_string(index=False))
search = {"name": "multistart_least_squares", "starts": 2}
fit = tractexp.identify(dips[:2], validate=dips[2], optimizer=search, check_intervals=False)
print(fit.screen())
page = fit.report()
