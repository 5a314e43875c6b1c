"""Cases of a study that are run once each: a line of JSON a case, and those that a file has are not run again."""

import json


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
