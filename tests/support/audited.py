"""What judges in the tests of an audit's processes: it sleeps, dies or answers, as the input's name says."""

import os
import time
from pathlib import Path

from wholebody.errors import InputError
from wholebody.verdict.audit.outcome import AuditOutcome


def judging():
    """What `wholebody.verdict.audit.workers.outcomes` is given."""
    return answer


def answer(name):
    kind, _, rest = name.partition(":")
    if kind == "sleep":
        time.sleep(float(rest))
    elif kind == "die":
        os.kill(os.getpid(), 9)
    elif kind == "die_once" and not Path(rest).exists():
        Path(rest).touch()
        os.kill(os.getpid(), 9)
    elif kind == "wrong":
        raise InputError("these options are wrong")
    return AuditOutcome(
        name=name, ending="judged", motion_s=1.0, verdict={"verdict": "feasible", "process": os.getpid()}
    )
