.PHONY: demo check test test-long format lint docs unit rust core chromium arm embedded images python wheel soak soak-track monte-carlo exports fuzz bench build-cost

# Fit the sample log that the program carries.
demo:
	cargo run --release -- demo

# What is run while one works: formatting, lints, unit tests; within a minute where little has changed since the last run.
check: format lint unit

# Whatever a change can break: all must pass. A tool that is missing is installed where that is possible; else its check is
# skipped by name, or fails where CI=true.
test: format lint docs rust embedded python

# What takes long, beside that: the core on its own, images for more processors, endurance, simulated logs, random exports and damaged
# files by the score.
test-long: core images soak soak-track monte-carlo exports fuzz

format:
	@$(call with,rustfmt,fmt,cargo fmt --all --check && for d in benches/peers examples/self_tuning_heater fuzz tests/embedded; do (cd $$d && cargo fmt --check) || exit 1; done)

# They read the Python module too, and need no Python for that.
lint docs: export PYO3_NO_PYTHON = 1
lint docs: export PYO3_BUILD_EXTENSION_MODULE = 1

lint:
	@$(call with,clippy,clippy,cargo clippy --locked --workspace --all-features --lib --bins --examples --tests --benches --test monte_carlo --test residual_tests --test soak -- -D warnings)
	@cd tests/embedded && $(call with,clippy,clippy,cargo clippy --locked --lib --bin check --tests -- -D warnings)

docs:
	RUSTDOCFLAGS="-D warnings" cargo doc --locked --workspace --all-features --no-deps

unit:
	cargo test --locked --workspace --all-features --lib

rust: chromium arm
	cargo test --locked --workspace --all-features

# thetahat-core once more on its own: there it has no heap.
core:
	cargo test --locked -p thetahat-core

# Opens the pages of --html; where it is not there and cannot be installed, its tests are skipped by name.
chromium:
	@command -v chromium >/dev/null || { [ "$$(id -u)" = 0 ] && apt-get update -q && \
	apt-get install -y -q --no-install-recommends chromium fonts-dejavu-core; } >/dev/null 2>&1 || true

# Compiles exported models for a Cortex-M; as above.
arm:
	@command -v arm-none-eabi-gcc >/dev/null || { [ "$$(id -u)" = 0 ] && apt-get update -q && \
	apt-get install -y -q --no-install-recommends gcc-arm-none-eabi libnewlib-arm-none-eabi; } >/dev/null 2>&1 || true

# The firmware in an emulator, in Rust and in C: the host's bits, no panic, and what a step costs.
embedded:
	tests/embedded/run

# The same, with images of one estimator each for three processors.
images:
	tests/embedded/run --images

# The Python package in an environment of its own: its tests, the examples in its documentation, its types.
python:
	py/tests/run

# The wheel that users get, optimised, into target/wheels, and the same tests on it.
wheel:
	py/tests/run --release

# The online estimators in single precision, 10^8 steps each; standard errors where inputs are held, 200 runs of 10^6 samples each.
soak:
	SOAK_STEPS=100000000 cargo test --locked --release -p thetahat-core --test soak -- --nocapture
	SOAK_STEPS=1000000 cargo test --locked --release -p thetahat-core --lib zonotope -- --nocapture
	HELD_RUNS=200 HELD_SAMPLES=1000000 cargo test --locked --release -p thetahat-core --test forgetting held -- --nocapture

# 10^8 rows through a pipe to thetahat track: its memory, and how far it strays from the truth.
soak-track:
	SOAK_STEPS=100000000 cargo test --locked --release --test end_to_end -- --nocapture track_soak

# Simulated logs by the score: do intervals cover the truth, are hard cases found, are true orders chosen, do tests keep their level?
monte-carlo:
	MONTE_CARLO=200 cargo test --locked --release -p thetahat --test monte_carlo -- --nocapture
	MONTE_CARLO=2000 cargo test --locked --release -p thetahat --test residual_tests -- --nocapture

# Random equations as source code: it compiles, and says what the library does.
exports:
	EXPORTS=100 cargo test --locked --workspace --all-features --test end_to_end -- --nocapture whatever_the_equations

# Damaged logs, documents and equations: mutations of the seeds, then a minute of the fuzzer for each where it is there.
fuzz:
	FUZZ=20 cargo test --locked --workspace --all-features --test end_to_end -- --nocapture makes_it_panic
	@if cargo +nightly fuzz --version >/dev/null 2>&1; then fuzz/run 60; else echo "skipped: cargo-fuzz is not installed"; fi

# Our own benches, then the comparison with other packages. Not part of the tests.
bench:
	cargo bench --locked --bench arx --bench online --bench track
	benches/peers/run

# What a build costs, from nothing: its time, the memory of the largest rustc, the sizes of program and wheel.
build-cost:
	benches/build_cost

# $(call with,COMPONENT,SUBCOMMAND,CHECK): runs the check if cargo has the subcommand or rustup can add the component.
with = if cargo $(2) --version >/dev/null 2>&1 || rustup component add $(1) >/dev/null 2>&1; then $(3); \
	elif [ "$$CI" = true ]; then echo "missing: $(1)" >&2; exit 1; else echo "skipped: $(1) is not installed"; fi
