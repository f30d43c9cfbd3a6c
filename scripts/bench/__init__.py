"""What `scripts/bench_kernels` and `scripts/bench_build` share; nothing else imports it."""
