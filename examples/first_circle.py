"""A circle and its largest cause.

The default machine drives a circle of 15 mm radius in X-Z, in both directions. Each axis stays behind for a moment
where it reverses: friction has to turn round first. These peaks are the quadrant glitches.
"""

import feedsim as fs

fs.example("xz_circle")
result = fs.run("xz_circle.yaml")
print(f"G {result.figures['XZ.G'].value:.2f} um, peak of Z {result.figures['XZ.peak_Z'].value:.2f} um")
result.plot().save("first_circle.png")
