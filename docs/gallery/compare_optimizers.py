"""Which optimizer?

Two optimizers under the same seeds and the same budget, compared with the tests that such
comparisons need. In a terminal: tractexp -m optimizer=issa,pso 'seed=range(0,4)' budget=300
"""

import tractexp

runs = tractexp.search("tibet_50pct", optimizers=["issa", "pso"], seeds=4, budget=300)
compared = tractexp.compare(runs)
print(compared.answer)
page = compared.report()
