"""A backlash compensation without backlash.

The control adds 8 um to X with its direction, though nothing is loose. The step at the reversal has the other sign of
lost motion: the axis goes too far.
"""

import feedsim as fs

fs.example("xz_circle")
result = fs.run("xz_circle.yaml", set={"machine.axes.X.drive.backlash_compensation.value": "8 um"})
print(f"lost motion of X {result.figures['XZ.lost_motion_X'].value:.1f} um")
result.plot().save("too_much_compensation.png")
