"""The dips of a station

All dips of a folder, load by load: the constants of the machines, which all dips share, the share
of the motors in each, and how well each dip was predicted by those before it. In a terminal:
tractexp task=station data.path=records
"""

import tractexp

tractexp.examples("records")
station = tractexp.fit_station("records")
print(station)
page = station.report()
