"""All circles in one picture: ``python picture.py TITLE=circle.json ... --out FILE.png``."""

import argparse
import json
from pathlib import Path

from circle import draw, plt

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("circles", nargs="+", metavar="TITLE=FILE")
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    tall = -(-len(asked.circles) // 3)
    figure, panels = plt.subplots(tall, 3, figsize=(11.0, 3.3 * tall), layout="constrained")
    for axes, circle in zip(panels.flat, asked.circles, strict=False):
        title, _, path = circle.partition("=")
        draw(axes, json.loads(Path(path).read_text()))
        axes.set_title(title)
    figure.savefig(asked.out, dpi=90)
