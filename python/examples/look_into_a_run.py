# %% [markdown]
# # A look into a run
#
# Run it as a script, or cell by cell in an editor that knows `# %%`:
#
#     acm run put-back-block --seed 3 --trace run.mcap --trace-frames full
#     python python/examples/look_into_a_run.py run.mcap

# %%
import sys

from acm_trace import Trace

run = Trace(sys.argv[1] if len(sys.argv) > 1 else "run.mcap")
print(f"{run.about['scenario']} seed {run.about['seed']}: {run.result.get('ending', 'not ended')}")
print(f"{len(run.messages)} messages, {len(run.changes)} changes of memory, {len(run.frames)} frames")

# %% [markdown]
# ## What was done, and why

# %%
for step in run.steps:
    ended = step.body("skill-ended") or {}
    failure = ended.get("failure")
    print(f"step {step.number}: {step.reason}; {'failed: ' + failure[1] if failure else 'done'}")

# %% [markdown]
# ## What was believed of one object

# %%
seen = [change["object"] for change in run.changes if change["change"] == "object"]
most = max(set(seen), key=seen.count) if seen else None
beliefs = [change for change in run.changes_of(most) if change["change"] == "object"]
for change in beliefs[:10]:
    after = change["after"]
    print(f"{change['seq']:>5}  {most}  {after.get('category')} at {after.get('at')}, {after.get('presence')}")

# %% [markdown]
# ## The last frame

# %%
*_, frame = run.frames.values()
try:
    frame.picture().save("last_frame.png")
    print(f"{frame.id} is in last_frame.png")
except ImportError as error:
    print(f"no picture: {error} (pip install './python[images]')")
