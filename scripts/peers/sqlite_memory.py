"""SQLite beside `acm bench memory`: the same objects, the same questions; processor time of each."""

import json
import sqlite3
import struct
import sys
import time

rows, task = sys.argv[1:]
base = sqlite3.connect(":memory:", isolation_level=None)
base.execute("create table o(id integer primary key, c int, r int, x real, y real, z real, w real, a int, s int)")
base.execute("begin")
with open(rows, "rb") as file:
    unpack = struct.Struct("<IHH4f2q").iter_unpack
    base.executemany("insert into o values(?,?,?,?,?,?,?,?,?)", unpack(file.read()))
base.execute("create index cr on o(c, r)")
base.execute("commit")
base.execute("analyze")
QUERY = """select id from o where c=? and r=? and a&?=? and s&?=?
order by w - sqrt((x-?)*(x-?)+(y-?)*(y-?)+(z-?)*(z-?))/? desc, id limit 10"""
with open(task) as file:
    questions = json.load(file)
times, equal = [], 0
for turn in range(2):
    times.clear()
    for q in questions:
        x, y, z = q["at"]
        a, s = q["affordances"], q["states"]
        began = time.thread_time_ns()
        found = base.execute(QUERY, (q["category"], q["region"], a, a, s, s, x, x, y, y, z, z, q["scale"])).fetchall()
        times.append((time.thread_time_ns() - began) / 1e3)
        equal += [row[0] for row in found] == q["ids"]
times.sort()
told = {"p50_us": times[len(times) // 2], "p99_us": times[len(times) * 99 // 100], "equal": equal / 2 / len(questions)}
print(json.dumps(told | {"version": sqlite3.sqlite_version}))
