#!/usr/bin/env bash
# Brings a machine to where the project builds, renders and is tested. May be run any number of times; says
# something only when it changes the machine or cannot go on.
set -euo pipefail
cd "$(dirname "$0")/.."

# EGL and Mesa's software driver: they draw on the processor, with no screen and no graphics card.
readonly RENDERER_PACKAGES=(libegl1 libegl-mesa0 libgl1-mesa-dri)

fail() {
    printf 'setup: %s\n' "$*" >&2
    exit 1
}

require_tools() {
    command -v cargo >/dev/null ||
        fail "cargo is missing: install a Rust toolchain ($(required_rust) or newer) and put it on the PATH"
    command -v cc >/dev/null || fail "a C compiler is missing (Debian: apt-get install gcc libc6-dev)"
    command -v python3 >/dev/null || fail "python3 is missing (Debian: apt-get install python3)"
}

required_rust() {
    sed -n 's/^rust-version = "\(.*\)"$/\1/p' Cargo.toml | head -n 1
}

install_renderer() {
    local missing=$1 log
    local command="apt-get update && apt-get install -y --no-install-recommends ${RENDERER_PACKAGES[*]}"
    if ! command -v apt-get >/dev/null; then
        fail "no renderer ($missing): install EGL with Mesa's software driver (Debian's ${RENDERER_PACKAGES[*]}), or any Vulkan driver"
    fi
    if [ "$(id -u)" -ne 0 ]; then
        fail "no renderer ($missing): run as root: $command"
    fi
    printf 'setup: no renderer (%s): installing Debian packages %s\n' "$missing" "${RENDERER_PACKAGES[*]}"
    log=$(mktemp)
    if ! DEBIAN_FRONTEND=noninteractive bash -c "$command" </dev/null >"$log" 2>&1; then
        tail -n 15 "$log" >&2
        fail "the installation failed (its last lines are above, all of it in $log): put it right and run again: $command"
    fi
    rm -f "$log"
}

require_renderer() {
    local found
    found=$(python3 scripts/find_renderer.py 2>/dev/null) && return
    install_renderer "$found"
    found=$(python3 scripts/find_renderer.py 2>/dev/null) ||
        fail "still no renderer after the installation of ${RENDERER_PACKAGES[*]} ($found)"
    printf 'setup: renderer found: %s\n' "$found"
}

# All platforms' sources, because a test reads the licence of every one of them without a network.
fetch_sources() {
    cargo fetch --locked --quiet </dev/null || fail "cargo could not fetch the sources named in Cargo.lock (see above)"
}

# Tests read traces and spans with the libraries that others use. Where Python has no venv or there is no network these
# tests say that they are skipped; nothing else needs them.
install_trace_reader() {
    local folder=${CARGO_TARGET_DIR:-target}/python list=scripts/trace_reader_requirements.txt log
    cmp -s "$list" "$folder/installed.txt" && return
    log=$(mktemp)
    if python3 -m venv --clear "$folder" >"$log" 2>&1 &&
        "$folder/bin/python" -m pip install --quiet --disable-pip-version-check --timeout 20 --retries 1 \
            --requirement "$list" </dev/null >>"$log" 2>&1; then
        cp "$list" "$folder/installed.txt"
        printf 'setup: installed readers of traces and spans for tests in %s\n' "$folder"
    else
        rm -rf "$folder"
        printf 'setup: no readers of traces and spans from PyPI (%s): the tests that compare with them are skipped\n' \
            "$(tail -n 1 "$log")"
    fi
    rm -f "$log"
}

require_tools
require_renderer
fetch_sources
install_trace_reader
# Servers of language models that are not ours, for the adapters' tests; the same holds for them.
scripts/llm_servers.sh install
