"""A sheet to hand in

Three pages of A4: the load, its parameters on both bases beside typical machines, measured and
calculated power, and what the model may be used for. Each run writes it as sheet.html.
"""

import tractexp

search = {"name": "multistart_least_squares", "starts": 2}
fit = tractexp.identify(
    "tibet_50pct", validate="tibet_30pct", optimizer=search, check_intervals=False
)
page = fit.sheet()
print(page)
