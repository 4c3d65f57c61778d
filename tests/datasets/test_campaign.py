"""Campaigns: nothing lost, nothing done twice, whoever is killed; the same on dask's workers."""

import os
import shutil
import signal
import threading
import time

import campaign_tasks
import pytest

from greybed.cli.main import main
from greybed.core.clusters import client_of, slurm_table
from greybed.core.errors import InputError
from greybed.datasets.campaign import key_of, run_campaign
from greybed.datasets.case_campaign import cases_of, simulate_case
from greybed.datasets.executors import Dask, OwnProcesses, executor_of


def numbers(marks, count, seconds=0.0):
    return [{"x": k, "marks": str(marks), "seconds": seconds} for k in range(count)]


def ran(marks):
    """Numbers in the order in which tasks have begun, and the processes that began them."""
    return [tuple(map(int, line.split())) for line in marks.read_text().splitlines()]


def kill_one(marks, after):
    """Kill the worker that has begun a task last, once so many have begun."""

    def wait_and_kill():
        while not marks.exists() or len(ran(marks)) < after:
            time.sleep(0.01)
        os.kill(ran(marks)[-1][1], signal.SIGKILL)

    thread = threading.Thread(target=wait_and_kill, daemon=True)
    thread.start()
    return thread


def check_all(campaign, count):
    assert [campaign.result(key)["square"] for key in campaign.keys] == [
        k * k for k in range(count)
    ]
    assert campaign.failed == {}


def test_a_second_start_repeats_nothing(tmp_path):
    marks = tmp_path / "marks"
    some, every = numbers(marks, 6), numbers(marks, 10)
    run_campaign(campaign_tasks.square, some, tmp_path / "tasks", OwnProcesses(2))
    campaign = run_campaign(campaign_tasks.square, every, tmp_path / "tasks", OwnProcesses(2))
    assert campaign.found == 6
    assert sorted(x for x, _ in ran(marks)) == list(range(10))
    check_all(campaign, 10)


def test_a_killed_process_costs_one_task_at_most(tmp_path):
    marks = tmp_path / "marks"
    killer = kill_one(marks, 12)
    given = numbers(marks, 40, seconds=0.02)
    campaign = run_campaign(campaign_tasks.square, given, tmp_path / "tasks", OwnProcesses(2))
    killer.join()
    check_all(campaign, 40)
    assert len({pid for _, pid in ran(marks)}) == 3  # one came in its place
    assert 40 <= len(ran(marks)) <= 41


def test_a_killed_worker_of_dask_costs_one_task_at_most(tmp_path):
    pytest.importorskip("distributed")
    marks = tmp_path / "marks"
    given = numbers(marks, 40, seconds=0.02)
    with client_of("local", 2) as client:
        killer = kill_one(marks, 12)
        campaign = run_campaign(campaign_tasks.square, given, tmp_path / "tasks", Dask(client))
        killer.join()
    check_all(campaign, 40)
    assert 40 <= len(ran(marks)) <= 41


def test_results_come_back_where_workers_do_not_see_the_folder(tmp_path, monkeypatch):
    """A worker that writes nothing: the file is made here."""
    from greybed.datasets import campaign as room

    class Elsewhere:
        def run(self, task, jobs):
            for key, (function, _, inputs, _) in jobs:
                yield key, task(function, key, inputs, str(tmp_path / "not" / "there"))

    marks = tmp_path / "marks"
    campaign = room.run_campaign(
        campaign_tasks.square, numbers(marks, 3), tmp_path / "tasks", Elsewhere()
    )
    check_all(campaign, 3)


def test_failures_are_told_and_tried_again(tmp_path):
    given = [{"x": k} for k in range(4)]
    for _ in range(2):
        campaign = run_campaign(
            campaign_tasks.odd_fails, given, tmp_path / "tasks", OwnProcesses(1)
        )
        assert sorted(campaign.failed.values()) == [
            "ValueError: 1 is odd", "ValueError: 3 is odd",
        ]  # fmt: skip
    assert campaign.found == 2


def test_a_task_that_ends_its_workers_is_given_up(tmp_path):
    campaign = run_campaign(
        campaign_tasks.kills_itself, [{"x": 1}], tmp_path / "tasks", OwnProcesses(1)
    )
    (said,) = campaign.failed.values()
    assert "3 workers in turn" in said


@pytest.mark.parametrize(
    ("text", "said"),
    [("jobs = 0\n[slurm]\n", "jobs = N"), ("[slurm]\n", "jobs = N"), ("jobs", "not valid TOML")],
)
def test_wrong_slurm_files_are_refused(tmp_path, text, said):
    path = tmp_path / "slurm.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        slurm_table(path)


def test_slurm_needs_its_package(tmp_path):
    path = tmp_path / "slurm.toml"
    path.write_text('jobs = 2\n[slurm]\nqueue = "short"\ncores = 1\nmemory = "2GB"\n')
    assert slurm_table(path) == (2, {"queue": "short", "cores": 1, "memory": "2GB"})
    try:
        import dask_jobqueue  # noqa: F401
    except ImportError:
        pytest.importorskip("distributed")
        with (
            pytest.raises(InputError, match="needs dask-jobqueue"),
            executor_of(str(path), 1),
        ):
            pass


def test_cases_are_run_and_tabled(tmp_path, capsys):
    (tmp_path / "start.csv").write_text("x [mm],y [mm],z [mm],radius [mm]\n0,0,5,1\n")
    (tmp_path / "case.toml").write_text(CASE)
    (tmp_path / "study.toml").write_text(
        'case = "case.toml"\n[vary]\n"contact.0.restitution" = [0.5, 0.9]\n'
    )
    words = ["campaign", str(tmp_path / "study.toml"), "--out", str(tmp_path / "out"), "--quiet"]
    assert main([*words, "--workers", "1"]) == 0
    header, *rows = (tmp_path / "out" / "campaign.csv").read_text().splitlines()
    assert header.startswith("key,contact.0.restitution,")
    assert [row.split(",")[1] for row in rows] == ["0.5", "0.9"]
    assert main([*words, "--workers", "1"]) == 0
    assert "2 were done before, 0 done now" in capsys.readouterr().out
    # A campaign that has moved, with its files, knows what it has done.
    moved = shutil.copytree(tmp_path, tmp_path / "moved")
    words = ["campaign", str(moved / "study.toml"), "--out", str(moved / "out"), "--quiet"]
    assert main([*words, "--workers", "1"]) == 0
    assert "2 were done before, 0 done now" in capsys.readouterr().out


def test_files_that_are_varied_are_known_by_what_they_hold(tmp_path):
    for name, z in (("start.csv", 5), ("high.csv", 7)):
        (tmp_path / name).write_text(f"x [mm],y [mm],z [mm],radius [mm]\n0,0,{z},1\n")
    (tmp_path / "case.toml").write_text(CASE)
    study = tmp_path / "study.toml"
    study.write_text('case = "case.toml"\n[vary]\n"particles.0.file" = ["start.csv", "high.csv"]\n')

    def keys():
        return [key_of(simulate_case, given) for given in cases_of(study)]

    first = keys()
    assert len(set(first)) == 2
    (tmp_path / "high.csv").write_text("x [mm],y [mm],z [mm],radius [mm]\n0,0,8,1\n")
    assert keys()[0] == first[0]
    assert keys()[1] != first[1]
    # The case that is run names the file where it is.
    summary = simulate_case(cases_of(study)[1], tmp_path / "task")
    assert summary["verb"] == "simulate"
    assert str(tmp_path / "high.csv") in (tmp_path / "task" / "case.toml").read_text()


CASE = """
kind = "particles"
duration = "1 ms"
[output]
samples = "0.5 ms"
[[material]]
name = "glass"
density = 2500
youngs_modulus = "10 MPa"
poissons_ratio = 0.2
[[contact]]
between = ["glass", "glass"]
restitution = 0.5
friction = 0.3
[[wall]]
name = "floor"
kind = "plane"
normal = [0, 0, 1]
[[particles]]
kind = "file"
material = "glass"
file = "start.csv"
"""


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('case = "case.toml"\n[vary]\n"contact.1.friction" = [1]\n', "is no place of the case"),
        ("[vary]\nseed = [1]\n", "must hold case"),
        ('case = "case.toml"\n[vary]\nseed = []\n', "must hold case"),
    ],
)
def test_wrong_campaigns_are_refused(tmp_path, capsys, text, said):
    (tmp_path / "case.toml").write_text(CASE)
    (tmp_path / "study.toml").write_text(text)
    assert main(["campaign", str(tmp_path / "study.toml"), "--out", str(tmp_path / "o")]) == 2
    assert said in capsys.readouterr().err
