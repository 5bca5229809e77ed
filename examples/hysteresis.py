"""A screw that winds up.

The friction of its nut twists a screw before the nut turns. X lacks 4 um behind each reversal, as with play, but after
a way of 50 um. The circle has rounded steps.
"""

import feedsim as fs

fs.example("xz_circle")
wound = {
    "machine.axes.X.hysteresis.value": "4 um",
    "machine.axes.X.hysteresis.way": "50 um",
    "machine.axes.X.drive.measuring.indirect": "true",
}
result = fs.run("xz_circle.yaml", set=wound)
print(f"lost motion of X {result.figures['XZ.lost_motion_X'].value:.1f} um")
result.plot().save("hysteresis.png")
