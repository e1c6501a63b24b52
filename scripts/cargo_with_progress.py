#!/usr/bin/env python3
"""Runs cargo so that a long build shows counted progress where its output is not a terminal.

    scripts/cargo_with_progress.py build --release --locked

On a terminal cargo draws its own bar and nothing is changed. Elsewhere cargo is asked to draw the bar all the same;
one line a while is made of it, and cargo's one line per crate is left out. Warnings and errors pass untouched, and
the exit code is cargo's.
"""

import os
import re
import subprocess
import sys
import threading
import time

INTERVAL_S = 20.0
# `    Building [=====>      ] 120/306: acm-memory, glam` (or `Checking`, ...), between carriage returns.
BAR = re.compile(rb"\[[=> ]*\] +(\d+)/(\d+)")
NOISE = re.compile(rb"^ *(Compiling|Checking|Downloaded|Downloading|Documenting|Blocking|Executable|Finished|Dirty|Fresh) ")
TERMINAL_CODES = re.compile(rb"\x1b\[[0-9;]*[A-Za-z]")


class Progress:
    """What the bar last said, told every `INTERVAL_S` by a thread of its own, because one crate can take minutes."""

    def __init__(self, name):
        self.name, self.done, self.total = name, 0, 0
        self.started = time.monotonic()
        self.finished = threading.Event()
        threading.Thread(target=self.tell_now_and_then, daemon=True).start()

    def take(self, bar):
        self.done, self.total = int(bar.group(1)), int(bar.group(2))

    def tell_now_and_then(self):
        while not self.finished.wait(INTERVAL_S):
            seconds = time.monotonic() - self.started
            if self.total:
                say(f"  cargo {self.name}: {self.done} of {self.total} steps, {seconds:.0f} s")
            else:
                say(f"  cargo {self.name}: starting, {seconds:.0f} s")


def say(line):
    print(line, file=sys.stderr, flush=True)


def pieces(stream):
    """Splits cargo's output at line ends and carriage returns."""
    rest = b""
    while chunk := os.read(stream.fileno(), 65536):
        *whole, rest = re.split(rb"[\r\n]", rest + chunk)
        yield from whole
    yield rest


def main():
    command = ["cargo", *sys.argv[1:]]
    if len(command) < 2:
        say("usage: cargo_with_progress.py CARGO-COMMAND [ARGUMENT]...")
        return 2
    if sys.stderr.isatty():
        return subprocess.call(command)
    environment = {**os.environ, "CARGO_TERM_PROGRESS_WHEN": "always", "CARGO_TERM_PROGRESS_WIDTH": "100"}
    child = subprocess.Popen(command, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, env=environment)
    progress = Progress(command[1])
    blank = True  # The lines left out must not leave their blank lines behind.
    for piece in pieces(child.stderr):
        line = TERMINAL_CODES.sub(b"", piece).rstrip()
        bar = BAR.search(line)
        if bar:
            progress.take(bar)
        elif not NOISE.match(line) and not (blank and not line):
            sys.stderr.buffer.write(line + b"\n")
            sys.stderr.flush()
            blank = not line
    progress.finished.set()
    code = child.wait()
    if code < 0:
        say(f"cargo {command[1]} was ended by signal {-code}")
        return 128 - code
    return code


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)
