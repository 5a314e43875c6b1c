"""Cases of a study that are run once each: a line of JSON a case, and those that a file has are not run again."""

import json
from concurrent.futures import ProcessPoolExecutor, as_completed
from functools import partial
from multiprocessing import get_context


def answered(calls, jobs=1):
    """Number and answer of each call without arguments, as they come; in so many processes, or one by one in this."""
    if jobs == 1:
        yield from enumerate(call() for call in calls)
        return
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        futures = {pool.submit(call): number for number, call in enumerate(calls)}
        for future in as_completed(futures):
            yield futures[future], future.result()


def finished(cases, out, jobs=1):
    """Numbers of the cases, by group and name, in their order; what is not in the file yet is run and printed.

    Args:
        cases: Group, name, and what gives its numbers.
        out: The file.
        jobs: Cases at a time, each in a process.
    """
    known, found, cases = {}, {}, list(cases)
    if out.exists():
        known = {
            (line["group"], line["name"]): line["numbers"] for line in map(json.loads, out.read_text().splitlines())
        }
    missing = [case for case in cases if case[:2] not in known]
    for number, numbers in answered([run for _, _, run in missing], jobs):
        group, name, _ = missing[number]
        known[group, name] = numbers
        with out.open("a") as file:
            file.write(json.dumps({"group": group, "name": name, "numbers": numbers}) + "\n")
        print(group, name, {key: round(value, 3) for key, value in numbers.items()}, flush=True)
    for group, name, _ in cases:
        found.setdefault(group, {})[name] = known[group, name]
    return found


def side_by_side(run, cases, out, jobs=1):
    """Lines that a file has and those of the cases that it has not, each added to it as soon as it is there.

    Args:
        run: Gives the line of a case, a dictionary that has it under "case"; a function of a module, told with that.
        cases: Of the study, such as numbers, or lists of a kind and a number.
        out: The file.
        jobs: Cases at a time, where these are several each in a process of its own.
    """
    lines = list(map(json.loads, out.read_text().splitlines())) if out.exists() else []
    known = {json.dumps(line["case"]) for line in lines}
    left = [case for case in cases if json.dumps(case) not in known]
    for _, line in answered([partial(run, case) for case in left], jobs):
        lines.append(line)
        with out.open("a") as file:
            file.write(json.dumps(line) + "\n")
    return lines
