"""Cases of a study that are run once each: a line of JSON a case, and those that a file has are not run again."""

import json
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context


def finished(cases, out):
    """Numbers of the cases, by group and name, in their order; what is not in the file yet is run and printed.

    Args:
        cases: Group, name, and what gives its numbers.
        out: The file.
    """
    known, found = {}, {}
    if out.exists():
        known = {
            (line["group"], line["name"]): line["numbers"] for line in map(json.loads, out.read_text().splitlines())
        }
    for group, name, run in cases:
        if (group, name) not in known:
            known[group, name] = run()
            with out.open("a") as file:
                file.write(json.dumps({"group": group, "name": name, "numbers": known[group, name]}) + "\n")
            print(group, name, {key: round(value, 3) for key, value in known[group, name].items()}, flush=True)
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

    def kept(line):
        lines.append(line)
        with out.open("a") as file:
            file.write(json.dumps(line) + "\n")

    if jobs == 1:
        for case in left:
            kept(run(case))
        return lines
    with ProcessPoolExecutor(jobs, mp_context=get_context("spawn")) as pool:
        for one in as_completed([pool.submit(run, case) for case in left]):
            kept(one.result())
    return lines
