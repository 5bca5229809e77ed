"""Friction compensation at its best.

The friction torque of the model is added ahead of time. What remains is what a compensation can reach at most: model
and machine have the same friction here.
"""

import feedsim as fs

fs.example("xz_circle")
result = fs.tune_feedforward("xz_circle.yaml", table=False)
for name in ("before.G", "after.G"):
    print(f"{name} {result.figures[name].value:.3g} um")
result.plot().save("compensation.png")
