"""What does the model lack?

Contactors that let go in a dip: the investigation names the effect, and shows how much smaller the
gap is with it. In a terminal: tractexp task=discrepancy data=contactors
"""

import tractexp

dips = tractexp.read("contactors")
few = ["undervoltage_trip", "stator_resistance", "speed_dependent_torque"]
found = tractexp.investigate(dips[:2], validate=dips[2], effects=few)
print(found)
page = found.report()
