"""Keeping a period on the wall clock, and what the system grants a process that does."""

from __future__ import annotations

import gc
import os
import sys
from time import monotonic, sleep

from wholebody.resources import processors

BLAS_THREADS = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
"""Environment of processes whose small matrices are not to wait for a pool of threads."""
REAL_TIME_PRIORITY = 40
"""Priority of SCHED_FIFO, 1 to 99: above other programs, below the threads of the kernel that serve interrupts (50)."""
SWITCH_INTERVAL = 2e-4
"""Time that a thread keeps the interpreter lock from the control loop [s]; chosen: a tenth of a period, not 5 ms."""
NICE = 5
"""Niceness by which planner, policy and page give way, where there is no real-time priority."""


def wait_until(time: float) -> None:
    """Sleep until an instant of `time.monotonic` [s]; at once if it is past."""
    left = time - monotonic()
    if left > 0.0:
        sleep(left)


def cores() -> tuple[set[int], set[int]]:
    """Cores for control loop and robot, and those for everything else; the same ones if there is only one."""
    allowed = processors()
    return ({allowed[-1]}, set(allowed[:-1])) if len(allowed) > 1 else (set(allowed), set(allowed))


def keep_time() -> list[str]:
    """Make this process one that keeps time; what the system does not grant, in sentences."""
    missed = []
    gc.collect()
    gc.freeze()
    gc.disable()
    sys.setswitchinterval(SWITCH_INTERVAL)
    own, others = cores()
    if own == others:
        missed.append("there is one core only: loop, robot and planner share it")
    if not hasattr(os, "sched_setaffinity"):
        return [*missed, "no core of its own and no real-time priority: this system has neither for a process"]
    os.sched_setaffinity(0, own)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(REAL_TIME_PRIORITY))
    except PermissionError:
        missed.append("no real-time priority: it needs CAP_SYS_NICE, or 'rtprio' in /etc/security/limits.conf")
    return missed


def give_way() -> None:
    """Make this process one that never keeps the control loop from running."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, cores()[1])
    os.nice(NICE)
