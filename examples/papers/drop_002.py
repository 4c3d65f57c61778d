"""Source paper 002: beans that drop through a tube, on the engine; see README.md.

    python examples/papers/drop_002.py

Jelly beans (8.5 by 16.1 mm) as spherocylinders of three spheres, one parameter at a time from a
middle: the time between first and last bean at the end of the tube, which the paper's table 5
finds to go with the friction on walls. Reduced: 60 beans instead of 700 g, a softer modulus.
"""

from record import Record

from greybed.calibration.experiments import LIBRARY

MIDDLE = {"friction": 0.4, "wall_friction": 0.3, "restitution": 0.5, "wall_restitution": 0.5}
ENDS = {"friction": (0.1, 0.8), "wall_friction": (0.1, 0.6), "wall_restitution": (0.2, 0.8)}


def main():
    record = Record("drop_002", "residence [s]")
    drop = LIBRARY["drop"](
        name="drop", shape="spherocylinder", radius=4.25e-3, length=16.1 / 8.5, spheres=3, count=60,
        density=1400.0, youngs_modulus=1e6, rolling_law="none", rolling_friction=0.0,
        tube=6.0, fall=30.0, tilt=0.6, time_step=1e-4,
    )  # fmt: skip
    for seed in range(2):
        record.make(f"middle seed {seed}", drop, MIDDLE, seed)
        for name, ends in ENDS.items():
            for value in ends:
                record.make(f"{name} {value} seed {seed}", drop, {**MIDDLE, name: value}, seed)
    for name, ends in ENDS.items():
        low, high = (
            sum(record.runs[f"{name} {v} seed {s}"]["residence"] for s in range(2)) / 2.0
            for v in ends
        )
        print(f"{name} {ends[0]} -> {ends[1]}: residence {low:.3f} -> {high:.3f} s")


if __name__ == "__main__":
    main()
