#!/usr/bin/env python3
"""Serves the small model SmolLM2 (135 million weights) with llama.cpp: python llm_server_smollm2.py FILE.gguf

Prints `listening on http://...` and serves until it is ended. One thread: two of them spin at a barrier, which on a small
machine takes minutes for what one does in seconds.
"""

import sys
import threading

import xllamacpp as xlc


def main(weights):
    params = xlc.CommonParams()
    params.model.path = weights
    params.cpuparams.n_threads = 1
    params.cpuparams_batch.n_threads = 1
    params.n_parallel = 1
    params.n_ctx = 8192
    params.warmup = False
    params.hostnames = ["127.0.0.1"]
    params.port = 0
    server = xlc.Server(params)
    print(f"listening on {server.listening_address}", flush=True)
    threading.Event().wait()


main(sys.argv[1])
