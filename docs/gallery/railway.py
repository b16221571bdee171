"""A railway of 2 x 25 kV

Contact line and negative feeder of an autotransformer system, each with its voltage and current, in
a table of samples: the load is what both draw together.
"""

import numpy as np
import pandas

import tractexp

t = np.arange(0, 1.2, 1 / 2000)  # 2 kHz; a constant impedance of 18 MW and 6 Mvar, a dip of 40 %
voltage = 27.5 * (1 - 0.4 * ((t > 0.4) & (t < 0.6))) * np.exp(2j * np.pi * 50 * t)
current = voltage * np.conj(18 + 6j) / 27.5**2 / 2  # half in each conductor
columns = {"ua": voltage, "ub": -voltage, "ia": current, "ib": -current}
units = {"u": "kV", "i": "kA"}
samples = {f"{name} [{units[name[0]]}]": 2**0.5 * x.real for name, x in columns.items()}
pandas.DataFrame({"t [s]": t} | samples).to_csv("arm.csv", index=False)

(dip,) = tractexp.read(
    "arm.csv", voltages=["ua", "ub"], currents=["ia", "ib"], connection="autotransformer"
)
print(dip)
print(dip.record.to_frame().iloc[::200])
page = tractexp.look("arm.csv").report()
