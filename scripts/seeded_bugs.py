#!/usr/bin/env python3
"""Puts one defect at a time into a copy of the engine and runs its tests: each must be found.

Prints a table; with --json FILE also writes it, for `acm bench memory`. Ends with 1 if a defect is not found.
"""

import argparse
import json
import pathlib
import re
import shutil
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
COPY = ROOT / "target" / "seeded-bugs"
BUGS = [
    ("checksums are not compared", "log.rs", "(check == checksum(sequence, whole)).then_some", "(size > 0).then_some"),
    ("a record may stand in another's place", "log.rs", "crc32c::crc32c(&sequence.to_le_bytes())", "crc32c::crc32c(&[])"),
    ("acknowledged before it is on disk", "store.rs", "written.and_then(|()| self.log.sync(&mut *self.disk))", "written"),
    ("a snapshot is named before it is on disk", "store.rs", "        self.disk.sync(fresh)?;\n        self.disk.rename(fresh, &file)?;", "        self.disk.rename(fresh, &file)?;"),
    ("marks within a group are lost", "log.rs", "Record::Mark(time) => marks.push((batch.len(), time)),", "Record::Mark(_) => {}"),
    ("what moved stays in the space index", "state.rs", "            self.table.shift(row, position);\n            (self.is_still, _) = (false, self.moved.push(id));", "            self.table.shift(row, position);"),
    ("a dropped object stays in the columns", "state.rs", "            self.table.kill(row);\n            self.is_still = false;", "            self.is_still = false;"),
    ("a block's bound is too low", "execute.rs", "bounds.weight - distance / near", "bounds.weight - 0.2 - distance / near"),
    ("a set forgets a block", "table.rs", "if member && number < self.base && !self", "if !member && number < self.base && !self"),
    ("a late report overwrites a newer one", "state.rs", "let late = context.valid < heads.of[at].latest;", "let late = false;"),
    ("odd moments are lost when changes are sorted", "history.rs", ".map(|place| (*place, *moment))", ".map(|_| (u32::MAX, *moment))"),
    ("another region costs an object its states", "state.rs", "        sets.into_iter().for_each(|set| self.table.put(new, set, true));", "        drop(sets);"),
    ("compaction drops a moment that is not superseded", "compact.rs", "*later >= valid", "*later > 0"),
    ("forgetting keeps the document", "forget.rs", "                event.document = document(&event, &gone).unwrap_or_default();\n", ""),
]


def copy():
    """A workspace of the engine alone, with the versions and lints of ours."""
    shutil.rmtree(COPY / "store", ignore_errors=True)
    COPY.mkdir(parents=True, exist_ok=True)
    shutil.copytree(ROOT / "memory" / "store", COPY / "store")
    text = (ROOT / "Cargo.toml").read_text()
    sections = re.findall(r"^\[workspace\.[^\n]*\n(?:(?!\[).*\n)*", text, re.M)
    kept = ["".join(line for line in section.splitlines(True) if not line.startswith("acm-")) for section in sections]
    (COPY / "Cargo.toml").write_text('[workspace]\nmembers = ["store"]\nresolver = "3"\n' + "\n".join(kept))
    shutil.copy(ROOT / "Cargo.lock", COPY / "Cargo.lock")


def tests():
    command = ["cargo", "test", "--offline", "--quiet", "-p", "acm-store", "--test", "model", "--test", "durability", "--no-fail-fast"]
    done = subprocess.run(command, cwd=COPY, capture_output=True, text=True)
    found = re.findall(r"^test (\w+) ... FAILED|^    (\w+)$", done.stdout, re.M)
    return done, sorted({a or b for a, b in found})


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--json", type=pathlib.Path)
    arguments = arguments.parse_args()
    copy()
    done, _ = tests()
    if done.returncode:
        sys.exit("the engine fails its own tests without a defect:\n" + done.stdout[-2000:] + done.stderr[-2000:])
    rows = []
    for number, (name, file, old, new) in enumerate(BUGS):
        path = COPY / "store" / "src" / file
        text = path.read_text()
        if text.count(old) != 1:
            sys.exit(f"{name}: the place in {file} is there {text.count(old)} times, not once; correct this script")
        path.write_text(text.replace(old, new))
        done, failed = tests()
        path.write_text(text)
        if done.returncode and not failed and "could not compile" in done.stderr:
            sys.exit(f"{name}: the defect does not compile:\n{done.stderr[-2000:]}")
        rows.append({"defect": name, "caught": bool(done.returncode), "by": failed})
        print(f"{number + 1:>2}/{len(BUGS)} {'caught' if done.returncode else 'NOT CAUGHT':<10} {name}: {', '.join(failed)}", flush=True)
    caught = sum(row["caught"] for row in rows)
    print(f"{caught} of {len(rows)} defects were caught")
    if arguments.json:
        arguments.json.write_text(json.dumps({"caught": caught, "defects": rows}, indent=1) + "\n")
    sys.exit(caught < len(rows))


main()
