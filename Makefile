# The two commands of the README. Each does all set-up itself. CARGO_TARGET_DIR is honoured.
cargo := scripts/cargo_with_progress.py
target := $(or $(CARGO_TARGET_DIR),target)

.PHONY: help setup demo test test-learned

help:
	@echo 'make demo   set up, build, and tell the first minute: one task with memory, then without; writes out/demo/index.html'
	@echo 'make test   set up, build, and run all tests'
	@echo 'make test-learned   the same of the learned estimator, which is off by default'

setup:
	@scripts/setup.sh

demo: setup
	@ACM_COMMIT=$$(git rev-parse --short=12 HEAD 2>/dev/null || echo unknown) $(cargo) build --release --locked
	@$(target)/release/acm demo

# Built first and run then: while tests run their own output must come through untouched.
test: setup
	@$(cargo) test --workspace --locked --no-run
	@cargo test --workspace --locked

# Apart from the others: what the learned estimator stands on takes minutes to build.
test-learned: setup
	@cargo test --locked -p acm-learned --features candle
	@cargo test --locked -p acm --features learned --lib learn
