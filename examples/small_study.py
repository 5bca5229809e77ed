"""A small study.

Sixteen runs over feed and radius of a circle, on all cores. The table has every figure of every run; the glitch of Z
depends on the acceleration with which the axis reverses.
"""

from pathlib import Path

import matplotlib.pyplot as plt

import feedsim as fs

fs.example("xz_circle")
Path("study.yaml").write_text("""
name: Feed and radius
scenario: xz_circle.yaml
set: {motions.0.direction: counterclockwise}
sampling: {method: grid}
parameters:
  feed: {key: motions.0.feed, values: [1 m/min, 2 m/min, 3 m/min, 4 m/min]}
  radius: {key: motions.0.radius, values: [10 mm, 15 mm, 20 mm, 25 mm]}
""")
if __name__ == "__main__":  # workers are processes, which read this file, too
    table = fs.sweep("study.yaml", "results/study")
    feed, radius = 60 * table["feed"], table["radius"]
    figure, axes = plt.subplots(figsize=(6, 4))
    for value in sorted(set(radius)):
        axes.plot(
            feed[radius == value],
            1e6 * table["XZ.glitch_Z"][radius == value],
            "o-",
            label=f"R {1e3 * value:.0f} mm",
        )
    axes.set(xlabel="feed [m/min]", ylabel="glitch of Z [um]")
    axes.legend()
    figure.savefig("small_study.png", dpi=100)
    low, high = 1e6 * table["XZ.glitch_Z"].min(), 1e6 * table["XZ.glitch_Z"].max()
    print(f"{len(radius)} runs, glitch of Z {low:.1f} to {high:.1f} um")
