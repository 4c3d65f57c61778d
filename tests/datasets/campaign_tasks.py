"""Tasks of campaigns for tests: functions of a module, as workers need them."""

import os
import time
from pathlib import Path


def square(inputs, folder):
    """Square a number, and leave a mark for each time that this has run."""
    marks = Path(inputs["marks"])
    with open(marks, "a") as stream:  # short lines are appended whole
        stream.write(f"{inputs['x']} {os.getpid()}\n")
    time.sleep(inputs.get("seconds", 0.0))
    return {"square": inputs["x"] ** 2}


def odd_fails(inputs, folder):
    """Fail for odd numbers."""
    if inputs["x"] % 2:
        raise ValueError(f"{inputs['x']} is odd")
    return {"half": inputs["x"] // 2}


def kills_itself(inputs, folder):
    """End the worker."""
    os._exit(9)
