"""A force on the tool.

A force of 500 N pushes the tool for 0.2 s while all axes hold their place. The scale of Z moves, and the loop brings it
back. The tool moves further: the structure gives way outside of the loops.
"""

import feedsim as fs

fs.example("z_positioning")
push = "[{kind: tool, direction: Z, held: true, table: {time: [0.3 s, 0.5 s], values: [-500 N, 0 N]}}]"
result = fs.run("z_positioning.yaml", set={
    "motions": "[{kind: dwell, duration: 1 s}]", "evaluate": "[]", "loads": push,
})  # fmt: skip
tool, scale = result["tool.x_Z"], result["Z.x_a"] - result["Z.x_a"][0]
print(f"the tool moves by {-1e6 * tool.min():.2f} um, the scale by {-1e6 * scale.min():.2f} um")
result.plot("tool.x_Z", "Z.x_a").save("force_on_the_tool.png")
