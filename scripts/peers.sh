#!/usr/bin/env bash
# Installs what `acm bench world` and `acm bench planner` compare with, in a Python environment of its own, and builds what
# `acm bench memory` compares with. Nothing else needs it; without it those rows say that they are skipped.
set -euo pipefail
cd "$(dirname "$0")/.."
readonly folder=${CARGO_TARGET_DIR:-target}/peers list=scripts/peers/requirements.txt
cargo build --quiet --release --manifest-path scripts/peers/memory/Cargo.toml --target-dir "$folder/memory"
printf 'peers: built in %s\n' "$folder/memory"
cmp -s "$list" "$folder/installed.txt" && exit
python3 -m venv --clear "$folder"
"$folder/bin/python" -m pip install --quiet --disable-pip-version-check --requirement "$list"
cp "$list" "$folder/installed.txt"
printf 'peers: installed in %s\n' "$folder"
