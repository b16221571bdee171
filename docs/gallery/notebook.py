"""In a notebook

Results tabulate themselves; numbers come as a frame with the ends of the intervals as numbers. The
whole way is in the notebook of these pages.
"""

import tractexp

search = {"name": "multistart_least_squares", "starts": 2}
fit = tractexp.identify("tibet_65pct", optimizer=search, check_intervals=False)
print(fit.to_frame().round(4).to_string(index=False))
page = fit.report()
