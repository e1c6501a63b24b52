#!/usr/bin/env bash
# Records runs over all scenarios, with and without faults, and replays each in a second process.
#   scripts/replay.sh [RUNS] [FIRST_SEED] [SKIP]      200 runs from seed 0 on, the first SKIP of them left out
# ACM names the program that records, REPLAY_WITH another one that replays, such as a build of its own of the same sources.
# Half of the runs keep their frames and are replayed from the trace alone; of the others physics and renderer run again.
set -euo pipefail
cd "$(dirname "$0")/.."

readonly runs=${1:-200} first=${2:-0} skip=${3:-0}
readonly acm=${ACM:-target/release/acm}
readonly replayer=${REPLAY_WITH:-$acm}
for program in "$acm" "$replayer"; do
    [ -x "$program" ] || { echo "no $program: cargo build --release, or name it in ACM and REPLAY_WITH" >&2; exit 2; }
done
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# A model that declines now and then and otherwise talks beside the point, and a memory of another run.
printf '[[rule]]\ntext = "cannot say"\nend = "refused"\nonce = true\n\n[[rule]]\ntext = "Gladly!"\n' >"$folder/model.toml"
"$acm" run put-back-block --seed 0 --memory "$folder/donor" --json >/dev/null
printf 'on_unknown = "guess"\n[perception]\nmin_confidence = 0.3\n' >"$folder/agent.toml"

mapfile -t scenarios < <("$acm" scenario list | cut -d ' ' -f 1)
readonly faults=('' '--inject black-frames' '--inject freeze-frames' '--inject slip@1' '--inject drop@1'
    '--inject wipe-memory@instruction' '--inject panic@perception:3' '--inject panic@planner:2' '--no-motion'
    '--on-unknown guess' '--method reactive' '--method first-frame' '--sensor d435-hard'
    '--inject misplaced-frame@1:120' "--inject transplant-memory=$folder/donor@first-verified-place"
    "--llm scripted=$folder/model.toml" "--config $folder/agent.toml" '--inject panic@llm:1')

identical=0 others=0
for ((run = skip; run < runs; run++)); do
    scenario=${scenarios[run % ${#scenarios[@]}]}
    fault=${faults[run / ${#scenarios[@]} % ${#faults[@]}]}
    seed=$((first + run))
    trace=$folder/run.mcap
    if ((run % 2)); then detail=hash how=--resim; else detail=full how=; fi
    # The run's own exit code tells how it ended, which is not what is asked here.
    # shellcheck disable=SC2086
    "$acm" run "$scenario" --seed "$seed" $fault --trace "$trace" --trace-frames "$detail" --json >/dev/null 2>&1 || true
    # shellcheck disable=SC2086
    if told=$("$replayer" trace replay "$trace" $how 2>&1); then
        identical=$((identical + 1))
    else
        others=$((others + 1))
        printf '%s seed %s %s %s: %s\n' "$scenario" "$seed" "$fault" "$how" "$told"
    fi
    if [ -t 1 ]; then printf '\r%d of %d' "$((run + 1))" "$runs"; fi
done
printf '\n%d of %d runs replayed identically\n' "$identical" "$((runs - skip))"
((others == 0))
