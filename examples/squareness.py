"""Axes that are not square.

The guides of X and Z miss the right angle by 400 um/m, which is much, so that it shows on a small circle. The scales do
not see it. The tool moves on an ellipse at 45 degrees, which stays where it is in both directions.
"""

import feedsim as fs

fs.example("xz_circle")
result = fs.run("xz_circle.yaml", set={"machine.geometry.squareness_XZ": "400 um/m"})
print(f"G by the scales {result.figures['XZ.G'].value:.2f} um, at the tool {result.figures['XZ.tool.G'].value:.2f} um")
result.plot().save("squareness.png")
