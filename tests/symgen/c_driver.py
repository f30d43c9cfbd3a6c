"""A C program that calls every function of a generated library, for checkers of memory."""

# Every buffer is exactly as long as the header says, so one number too far is caught.
HEAD = """
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "NAME.h"
static double *numbers(long n)
{
    double *x = malloc(sizeof(double) * (size_t)(n ? n : 1));
    for (long i = 0; i < n; ++i) {
        x[i] = 0.3 + 0.1 * sin((double)i);
    }
    return x;
}
"""

DECLARED = """
long NAME_LEVEL_statistics_work(long k);
long NAME_LEVEL_statistics_join_work(long size, long count);
long NAME_LEVEL_statistics(long n, const double *q, const double *dq, const double *ddq,
    const double *tau, long k, const double *columns, const double *weight,
    const double *sample_weight, double *work, double *triangle, long products);
void NAME_LEVEL_statistics_join(long size, long count, const double *triangles, double *work,
    double *triangle);
void NAME_LEVEL_adam(NAME_adam_job *jobs, long count, long iterations);
void NAME_LEVEL_levenberg(NAME_levenberg_job *jobs, long count, long iterations);
void NAME_LEVEL_convex(NAME_convex_job *jobs, long count);
long NAME_LEVEL_excitation_work(const NAME_excitation_job *job);
double NAME_LEVEL_excitation_cost(NAME_excitation_job *job, const double *a, double *gradient);
"""

PROGRAMS = """
    enum { N = JOINTS, LAMBDA = 10 * N, BASE = UPPER_BASE, SIZE = N + BASE + 1, FILLED = SIZE - 1 };
    {
        double *triangles = numbers(2 * SIZE * SIZE), *joint = numbers(SIZE * SIZE);
        for (int part = 0; part < 2; ++part) {
            double *work = numbers(NAME_LEVEL_statistics_work(1));
            NAME_LEVEL_statistics(9, numbers(9 * N), numbers(9 * N), numbers(9 * N), numbers(9 * N),
                1, numbers(9 * N), numbers(N), part ? numbers(9) : 0, work,
                triangles + part * SIZE * SIZE, 1);
        }
        {   /* a log that is long and slow enough for products, and one that is only long */
            enum { LONG = 4113 };
            double *work = numbers(NAME_LEVEL_statistics_work(1)), *x[3];
            for (int fast = 0; fast < 2; ++fast) {
                for (int a = 0; a < 3; ++a) {
                    x[a] = numbers(LONG * N);
                    for (int i = 0; i < (fast ? 0 : LONG * N); ++i) {
                        const double speed = 0.003 * (1 + 0.3 * a) * (i % N + 1 + a / 2);
                        x[a][i] = sin(speed * (i / N) + i % N);
                    }
                }
                long products = NAME_LEVEL_statistics(LONG, x[0], x[1], x[2], numbers(LONG * N), 1,
                    x[1], numbers(N), fast ? numbers(LONG) : 0, work, triangles, 1);
                printf("%d %d\\n", products > 0, isfinite(triangles[0]));
            }
        }
        double *work = numbers(NAME_LEVEL_statistics_join_work(SIZE, 2));
        NAME_LEVEL_statistics_join(SIZE, 2, triangles, work, joint);
        double *factor = calloc((BASE + 1) * (BASE + 1), 8);
        double *state = numbers(N);
        NAME_statistics_update(factor, 0.9, state, state, state, state, state);
        printf("%d %d\\n", isfinite(joint[SIZE * SIZE - 1]), isfinite(factor[BASE]));
    }
    {
        long size = LAMBDA + N, padded = (size + 7) / 8 * 8, rows[60];
        long equations = (FILLED + 7) / 8 * 8;
        double *factor = calloc((size_t)(equations * equations), 8), *target = numbers(equations);
        for (long i = 0; i < equations; ++i) {
            factor[i * (equations + 1)] = i < FILLED;
            target[i] = i < FILLED ? target[i] : 0.0;
        }
        for (int i = 0; i < 60; ++i) {
            rows[i] = i % 9;
        }
        NAME_least_squares both = {factor, target, 1.0, 0.5};
        for (long batch = 0; batch <= 3; batch += 3) {
            NAME_adam_job job = {.size = size, .padded = padded, .equations = equations,
                .training = both, .held = both, .rate = 1e-3, .beta1 = 0.9, .beta2 = 0.999,
                .epsilon = 1e-8, .threshold = 0.0, .validate_every = 5, .patience = 1000,
                .power1 = 1.0, .power2 = 1.0, .batch = batch, .columns_per_joint = 1, .rows = rows};
            job.x = numbers(padded), job.best_x = numbers(padded);
            job.m = calloc((size_t)padded, 8), job.v = calloc((size_t)padded, 8);
            for (long i = size; i < padded; ++i) {
                job.x[i] = 0.0;
            }
            job.training_trace = numbers(4), job.held_trace = numbers(4);
            const long width = (7 * N + 7) / 8 * 8;
            job.samples = numbers(9 * width), job.weight = numbers(N);
            job.work = numbers(8 * (width + size) + (4 + equations) * equations + padded);
            NAME_LEVEL_adam(&job, 1, 20);
            printf("%ld %d\\n", job.step, isfinite(job.best));
        }
        NAME_levenberg_job job = {.size = size, .equations = equations, .training = both,
            .first_damping = 1e-3, .step_tolerance = 0.0, .decrease_tolerance = 0.0, .growth = 2.0};
        job.x = numbers(size), job.trace = numbers(5);
        job.work = numbers(equations * (size + 2 * equations + 3) + 2 * size);
        NAME_LEVEL_levenberg(&job, 1, 5);
        printf("%ld %d\\n", job.step, isfinite(job.loss));
    }
    {
        NAME_excitation_job job = {.samples = 9, .harmonics = 2};
        double *basis = calloc(2 * 3 * 2 * 8, 8);
        for (int i = 0; i < 2 * 3 * 2 * 8; ++i) {
            basis[i] = i < 48 || i % 8 == 0 ? cos(i) : 0.0;
        }
        job.basis = basis, job.home = numbers(N);
        job.work = calloc((size_t)NAME_LEVEL_excitation_work(&job), 8);
        NAME_LEVEL_excitation_cost(&job, numbers(2 * N), numbers(2 * N));
        printf("%d\\n", isfinite(job.value));
    }
    {
        double *pi0 = calloc(LAMBDA, 8), *state = numbers(N);
        for (int i = 0; i < N; ++i) {
            pi0[10 * i] = 1.0;
            pi0[10 * i + 4] = pi0[10 * i + 5] = pi0[10 * i + 6] = 0.1;
        }
        NAME_online *online = malloc(sizeof *online);
        int good = NAME_online_start(online, pi0, 0.99, 1.0);
        for (int i = 0; i < 40; ++i) {
            for (int j = 0; j < N; ++j) {
                state[j] = sin(0.7 * i * (j + 1) + j);
            }
            good += NAME_online_sample(online, state, state, state, state, numbers(N));
        }
        state[0] = INFINITY;
        good += NAME_online_sample(online, state, numbers(N), numbers(N), numbers(N), numbers(N));
        good += NAME_online_solve(online, NAME_LEVEL_convex, 50);
        printf("%d %ld %d\\n", good, online->rejected, isfinite(online->pi[0]));
    }
    {
        long width = (LAMBDA + 7) / 8 * 8, rows = 5, spent[2][2];
        double *start = calloc((size_t)width, 8), *slope = calloc((size_t)width, 8);
        double *factor = calloc((size_t)(rows * width), 8), *gamma = numbers(2);
        for (int k = 0; k < N; ++k) {
            start[10 * k] = slope[10 * k] = 1.0;
            for (int j = 4; j < 7; ++j) {
                start[10 * k + j] = slope[10 * k + j] = 1.0;
            }
        }
        for (long r = 0; r < rows; ++r) {
            for (long i = 0; i < LAMBDA; ++i) {
                factor[r * width + i] = sin((double)(r * LAMBDA + i));
            }
        }
        NAME_convex_job jobs[2];
        for (int k = 0; k < 2; ++k) {
            jobs[k] = (NAME_convex_job){.links = N, .width = width, .rows = rows, .factor = factor,
                .target = numbers(rows), .rest = 1.0, .count = 9.0, .slope = slope,
                .share = numbers(N), .gamma = gamma, .gammas = 2, .most_steps = 50,
                .tolerance = 1e-9, .points = numbers(2 * width), .losses = numbers(2),
                .decrements = numbers(2), .steps = spent[k],
                .work = numbers(UPPER_CONVEX_WORK(rows, width))};
            jobs[k].pi = calloc((size_t)width, 8);
            for (long i = 0; i < width; ++i) {
                jobs[k].pi[i] = start[i];
            }
        }
        NAME_LEVEL_convex(jobs, 2);
        printf("%ld %ld\\n", jobs[0].converged, jobs[1].converged);
    }
    {
        double *pi = calloc(LAMBDA, 8);
        for (int k = 0; k < N; ++k) {
            pi[10 * k] = pi[10 * k + 4] = pi[10 * k + 5] = pi[10 * k + 6] = 1.0;
        }
        for (int noisy = 0; noisy < 2; ++noisy) {
            NAME_closed_loop_job job = {.substeps = 2, .period = 1e-3, .coulomb_speed = 0.05,
                .reference = numbers(4 * 3 * N), .noise = noisy ? numbers(4 * 2 * N) : 0, .pi = pi,
                .rotor = numbers(N), .viscous = numbers(N), .coulomb = numbers(N),
                .offset = numbers(N), .model = pi, .model_rotor = numbers(N),
                .stiffness = numbers(N), .damping = numbers(N), .state = numbers(2 * N),
                .log = numbers(4 * 5 * N)};
            NAME_closed_loop(&job, 4);
            printf("%ld %ld\\n", job.done, job.status);
        }
    }
"""
EXPECTED = "1 1 0 1 1 1 20 1 20 1 5 1 1 42 1 1 2 2 4 0 4 0"
"""All numbers finite, all iterations made; products for the slow log alone."""


def driver(manifest: dict, name: str, level: str, tiles_h: str) -> str:
    """A C program that calls every function: one evaluation, batches, 2 tiles.

    After 8 samples, a full tile, lies the buffer's end; the 9th leaves lanes unused.
    """
    counts, tiles, prototypes, calls = (8, 9), 2, [], []
    for kernel in manifest["kernels"]:
        one, batch_declared = [], ["long n"]
        batches = [[f"{count}"] for count in counts]
        turns = f"OWN({kernel['name']}_sines)" in tiles_h
        summed = any(a.get("summed", False) for a in kernel["outputs"])
        tile_calls = [[f"{tiles}", *(["0"] if turns else [])]]
        if turns:
            tile_calls.append([f"{tiles}", f"numbers({tiles * 16 * len(manifest['joints'])})"])
        tile_declared = ["long tiles", *(["const double *sc"] if turns else [])]
        for side in ("inputs", "outputs"):
            for a in kernel[side]:
                size = 1
                for extent in a["shape"]:
                    size *= extent
                const = "const " if side == "inputs" else ""
                shared = a.get("shared", False) or a.get("summed", False)
                one.append(f"numbers({size})")
                for count, call in zip(counts, batches, strict=True):
                    call.append(f"numbers({size if shared else count * size})")
                    if side == "inputs":
                        call.append("0" if shared else f"{size}")
                batch_declared.append(f"{const}double *{a['name']}")
                tile_declared.append(f"{const}double *{a['name']}")
                for call in tile_calls:
                    call.append(f"numbers({size if shared else tiles * 8 * size})")
                if side == "inputs":
                    batch_declared.append(f"long {a['name']}_step")
        calls.append(f"{name}_{kernel['name']}({', '.join(one)});")
        # a kernel without sines in tiles.h is rare: its batches go one by one
        compiled = f"{name}_{level}_" if turns else f"{name}_"
        for prefix in (compiled, f"{name}_casadi_"):
            prototypes.append(f"void {prefix}{kernel['name']}_batch({', '.join(batch_declared)});")
            calls += [f"{prefix}{kernel['name']}_batch({', '.join(call)});" for call in batches]
        if turns and not summed:
            function = f"{name}_{level}_{kernel['name']}_tiles"
            prototypes.append(f"void {function}({', '.join(tile_declared)});")
            calls += [f"{function}({', '.join(call)});" for call in tile_calls]
    body = "\n".join(f"    {call}" for call in calls)
    prototypes.append(DECLARED)
    body += PROGRAMS.replace("JOINTS", str(len(manifest["joints"]))).replace("UPPER", name.upper())
    text = HEAD + "\n".join(prototypes) + f"\nint main(void)\n{{\n{body}\n    return 0;\n}}\n"
    return text.replace("NAME", name).replace("LEVEL", level)
