"""One circle at three feeds.

A faster circle reverses with more acceleration. The friction turns round in less time, and the drive has less of it
for an answer: the peak is higher and narrower.
"""

import feedsim as fs

fs.example("xz_circle")
feeds = {"slow": "1000 mm/min", "usual": "3000 mm/min", "fast": "5000 mm/min"}
results = {
    name: fs.run("xz_circle.yaml", set={"motions.0.feed": feed, "motions.0.turns": 4}) for name, feed in feeds.items()
}
for name, result in results.items():
    print(f"{feeds[name]}: peak of Z {result.figures['XZ.peak_Z'].value:.2f} um")
fs.diff(**results).pictures[0].save("three_feeds.png")
