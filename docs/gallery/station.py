"""The dips of a station

A folder of records, here of three dips: each with its depth, what the load did, and whether it is
worth fitting. In a terminal: tractexp survey records
"""

import tractexp

tractexp.examples("records")
table = tractexp.survey("records")
print(table.to_frame()[["file", "depth", "duration", "worth", "why"]])
page = table.report()
