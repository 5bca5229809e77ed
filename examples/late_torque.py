"""A torque that comes late, found by a comparison.

The result of another simulator is imitated: its torque is 2 ms late. The comparison has a tube of 0.5 ms and 0.01 N.m
around the reference, and names the shift that explains the difference.
"""

import matplotlib.pyplot as plt
import numpy as np

import feedsim as fs

fs.example("z_positioning")
reference = fs.run("z_positioning.yaml").trace.select(["Z.M_a"])
late = np.interp(reference.time - 2e-3, reference.time, reference["Z.M_a"])
rows = np.column_stack((reference.time, late))
np.savetxt("late.csv", rows, delimiter=",", header="time [s],Z.M_a [N.m]", comments="")
result = fs.compare("late.csv", reference, tol="Z.M_a=0.01 N.m, 0.5 ms")
print(*result.lines, sep="\n")
figure, axes = plt.subplots(figsize=(6, 4))
axes.plot(1e3 * reference.time, reference["Z.M_a"], label="reference")
axes.plot(1e3 * reference.time, late, "--", label="late")
axes.set(xlabel="time [ms]", ylabel="motor torque [N.m]", xlim=(0, 80))
axes.legend()
figure.savefig("late_torque.png", dpi=100)
