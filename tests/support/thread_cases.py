"""Chunks for judging in threads, and what is compared: every number of the answers, to the bit."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from sys import getswitchinterval, setswitchinterval

from tests.support.outcome_cases import outcome_case
from wholebody import judge


def chunks(n):
    """So many chunks of all families of the outcome cases that need no recordings."""
    return [outcome_case(number).chunk for number in range(n)]


def told(chunk):
    """All that a verdict says, as text: floats to the bit."""
    return repr(asdict(judge(chunk)))


def in_threads(function, inputs, threads):
    """What a function says of each input, called from so many threads that are switched as often as can be."""
    before = getswitchinterval()
    setswitchinterval(1e-5)
    try:
        with ThreadPoolExecutor(threads) as pool:
            return list(pool.map(function, inputs))
    finally:
        setswitchinterval(before)
