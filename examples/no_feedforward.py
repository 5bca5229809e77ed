"""A circle without speed feedforward.

Without feedforward each axis follows its setpoint with a lag, and its amplitude falls with the speed of the path. The
circle becomes smaller all round.
"""

import feedsim as fs

fs.example("xz_circle")
result = fs.run("xz_circle.yaml", set={"machine.axes.*.drive.k_ffw": "0 %"})
print(f"mean radius deviation {result.figures['XZ.mean'].value:.1f} um")
result.plot().save("no_feedforward.png")
