"""What a campaign costs: 1,000 tasks that do nothing, a worker killed by SIGKILL half way.

python benchmarks/campaign.py prints, for processes of our own and for dask's workers, what a task
costs in wall time, how many results there are, and how many tasks were begun twice. The
last line is ``ratio <x>``, 5 ms over the larger cost of the two.
"""

import os
import signal
import sys
import tempfile
import threading
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from greybed.datasets.campaign import run_campaign
from greybed.datasets.executors import executor_of

TASKS, WORKERS = 1000, 2


def mark(inputs, folder):
    """Leave a mark, and do nothing else."""
    with open(inputs["marks"], "a") as stream:
        stream.write(f"{inputs['x']} {os.getpid()}\n")
    return {"x": inputs["x"]}


def measure(scheduler, kill):
    """Seconds a task, results, and tasks begun more than once."""
    import campaign as this  # workers know this module by its name

    with tempfile.TemporaryDirectory() as name:
        marks, tasks = Path(name) / "marks", Path(name) / "tasks"
        marks.touch()
        given = [{"x": k, "marks": str(marks)} for k in range(TASKS)]
        pids = []

        def kill_half_way():
            while len(lines := marks.read_text().splitlines()) < TASKS // 2:
                time.sleep(0.002)
            pids.append(int(lines[-1].split()[1]))
            os.kill(pids[0], signal.SIGKILL)

        with executor_of(scheduler, WORKERS) as executor:
            run_campaign(this.mark, given[:WORKERS], tasks, executor)  # workers have started
            thread = threading.Thread(target=kill_half_way, daemon=True)
            if kill:
                thread.start()
            begin = time.perf_counter()
            campaign = run_campaign(this.mark, given, tasks, executor)
            seconds = time.perf_counter() - begin
        begun = [line.split()[0] for line in marks.read_text().splitlines()]
        there = sum(campaign.result(key) is not None for key in campaign.keys)
        return seconds / TASKS, there, len(begun) - len(set(begun))


def main():
    """Print the table."""
    worst = 0.0
    for scheduler in (None, "local"):
        for kill in (False, True):
            each, there, twice = measure(scheduler, kill)
            what = "dask, local" if scheduler else "own processes"
            print(
                f"{what:14} {'one worker killed' if kill else 'undisturbed':18} "
                f"{1e3 * each:6.2f} ms a task, {there} results, {twice} begun twice"
            )
            if not kill:
                worst = max(worst, each)
    print(f"ratio {5e-3 / worst:.2f}")


if __name__ == "__main__":
    main()
