"""Plans with pyperplan the problems of a folder, for `acm bench planner`: NAME.domain.pddl and NAME.problem.pddl.

Writes a line of JSON for each: its name, the processor seconds that reading, grounding and searching took together, and the
names of the plan's actions, or why there is none. Arguments: the folder, and the most seconds for one problem.
"""

import importlib.metadata
import json
import logging
import pathlib
import signal
import sys
import time

from pyperplan.planner import HEURISTICS, SEARCHES, search_plan


class TimeIsOver(Exception):
    pass


def stop(_signal, _frame):
    raise TimeIsOver


def plan(folder: pathlib.Path, name: str, limit_s: int) -> dict:
    files = [str(folder / f"{name}.{part}.pddl") for part in ("domain", "problem")]
    began = time.process_time()
    signal.alarm(limit_s)
    try:
        found = search_plan(*files, SEARCHES["gbf"], HEURISTICS["hff"])
        failure = None if found is not None else "no plan"
    except TimeIsOver:
        found, failure = None, f"no plan within {limit_s} s"
    finally:
        signal.alarm(0)
    actions = None if found is None else [action.name.strip("()").split()[0] for action in found]
    return {"name": name, "cpu_s": time.process_time() - began, "actions": actions, "failure": failure}


def main() -> None:
    logging.disable(logging.CRITICAL)
    signal.signal(signal.SIGALRM, stop)
    folder, limit_s = pathlib.Path(sys.argv[1]), int(sys.argv[2])
    print(json.dumps({"version": importlib.metadata.version("pyperplan")}), flush=True)
    for file in sorted(folder.glob("*.problem.pddl")):
        name = file.name.removesuffix(".problem.pddl")
        print(json.dumps(plan(folder, name, limit_s)), flush=True)


main()
