"""An example of a simulator: reads a design as JSON, writes the number to minimise as JSON."""

import json
import random
import sys

given = json.load(sys.stdin)
x = given["x"]
f = (x["angle"] - 31.0) ** 2 / 100.0 + (x["width"] - 0.08) ** 2 * 1e3
if "--fine" not in sys.argv:  # the coarse simulator has a small error and noise
    f += 0.02 * (x["angle"] - 28.0) / 10.0 + random.Random(given["seed"]).gauss(0.0, 0.01)
json.dump({"f": f}, sys.stdout)
