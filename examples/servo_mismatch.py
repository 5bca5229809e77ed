"""An ellipse at 45 degrees.

The symmetry filter of Z is 1.2 ms too short, so it answers earlier than X does. The circle becomes an ellipse at 45
degrees in one direction and at 135 degrees in the other.
"""

import feedsim as fs

fs.example("xz_circle")
result = fs.run("xz_circle.yaml", set={"machine.axes.Z.drive.T_sym": "3.0 ms"})
print(f"servo mismatch {result.figures['XZ.servo_mismatch'].value:.2f} ms")
result.plot().save("servo_mismatch.png")
