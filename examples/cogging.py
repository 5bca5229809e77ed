"""Waves from a motor that cogs.

The motor of Z adds a torque of 0.4 N.m, six times a turn. The loop holds most of it back; waves remain on the circle,
and the report names their length.
"""

import feedsim as fs

fs.example("xz_circle")
cogging = {"machine.axes.Z.drive.cogging_1.order": "6", "machine.axes.Z.drive.cogging_1.amplitude": "0.4 N.m"}
result = fs.run("xz_circle.yaml", set=cogging)
print(f"G {result.figures['XZ.G'].value:.2f} um")
result.plot().save("cogging.png")
