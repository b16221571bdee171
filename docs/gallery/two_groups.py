"""Two groups of motors

A load of small and of large machines: the second group's parameters end in _2. What such a load
draws in a dip is simulated; identify takes the same model.
"""

import tractexp

model = tractexp.compose(motor=["electromechanical", "electromechanical"], static="zip")
values = {name: p.default for name, p in model.parameters.items()}
dip = tractexp.simulate(model, values, depth=0.4, duration=0.2, Q0=0.5)
page = dip.report()
print(model)
