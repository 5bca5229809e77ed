"""Setpoints of your own.

Positions over time, here computed, drive the axis in place of the numerical control: a short hop of Z by 5 mm. A file
with a unit in its header is all that it takes.
"""

from pathlib import Path

import numpy as np

import feedsim as fs

fs.example("xz_circle")
time = np.arange(0, 2, 1e-3)
way = np.clip((time - 0.2) / 0.3, 0, 1)
hop = 5 * way**3 * (10 - 15 * way + 6 * way**2)  # mm
rows = np.column_stack((time, 100 + hop))
np.savetxt("hop.csv", rows, delimiter=",", header="time [s],Z [mm]", comments="")
Path("hop.yaml").write_text("""
name: A hop
machine: machines/test_centre
motions:
  - {kind: setpoints, file: hop.csv, columns: {Z: Z}}
  - {kind: dwell, duration: 0.5 s}
""")
result = fs.run("hop.yaml")
print(f"following error of Z at most {1e6 * np.abs(result.trace['Z.x_e']).max():.2f} um")
result.plot().save("own_setpoints.png")
