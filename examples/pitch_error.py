"""An error that repeats with the screw.

The scale of X is wrong by 2 um, once per turn of its screw of 20 mm. A circle of 60 mm radius passes six turns: its
waves are narrow where X is fast, and wide where X is slow.
"""

import feedsim as fs

fs.example("xz_circle")
error = "machine.axes.X.drive.periodic_error_1"
large = {"motions.0.radius": "60 mm", f"{error}.period": "20 mm", f"{error}.amplitude": "2 um"}
result = fs.run("xz_circle.yaml", set=large)
print(f"pitch error of X {result.figures['XZ.pitch_X'].value:.2f} um")
result.plot().save("pitch_error.png")
