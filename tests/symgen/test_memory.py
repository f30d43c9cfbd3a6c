"""The generated C under AddressSanitizer and UndefinedBehaviorSanitizer, called from C alone."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from symgen.compiler import find_compiler, machine

# Every buffer is exactly as long as the header says, so one number too far is caught.
HEAD = """
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "NAME.h"
#define LEVEL_CALL(kernel) NAME_LEVEL_##kernel##_batch
static double *numbers(long n)
{
    double *x = malloc(sizeof(double) * (size_t)(n ? n : 1));
    for (long i = 0; i < n; ++i) {
        x[i] = 0.3 + 0.1 * sin((double)i);
    }
    return x;
}
"""

ADAM = """
    {
        long size = LAMBDA + JOINTS, padded = (size + 7) / 8 * 8, rows[20 * 3];
        double *hessian = numbers(padded * padded), *linear = numbers(padded);
        for (long i = 0; i < padded * padded; ++i) {
            hessian[i] = i % (padded + 1) ? 0.0 : (i / (padded + 1) < size);
        }
        for (long i = size; i < padded; ++i) {
            linear[i] = 0.0;
        }
        for (int i = 0; i < 60; ++i) {
            rows[i] = i % 9;
        }
        for (long batch = 0; batch <= 3; batch += 3) {
            NAME_quadratic both = {hessian, linear, 1.0};
            NAME_adam_job job = {.size = size, .padded = padded, .training = both, .held = both,
                .rate = 1e-3, .beta1 = 0.9, .beta2 = 0.999, .epsilon = 1e-8, .threshold = 0.0,
                .validate_every = 5, .patience = 1000, .power1 = 1.0, .power2 = 1.0,
                .batch = batch, .columns_per_joint = 1, .rows = rows};
            job.x = numbers(padded), job.best_x = numbers(padded);
            job.m = calloc((size_t)padded, 8), job.v = calloc((size_t)padded, 8);
            for (long i = size; i < padded; ++i) {
                job.x[i] = 0.0;
            }
            job.training_trace = numbers(4), job.held_trace = numbers(4);
            job.q = numbers(9 * JOINTS), job.dq = numbers(9 * JOINTS);
            job.ddq = numbers(9 * JOINTS), job.tau = numbers(9 * JOINTS);
            job.columns = numbers(9 * JOINTS);
            job.weight = numbers(JOINTS), job.unit = numbers(JOINTS);
            job.work = numbers(5 * batch * JOINTS + 2 * padded);
            NAME_LEVEL_adam(&job, 20);
            printf("%ld %d\\n", job.step, isfinite(job.best));
        }
    }
"""


def driver(manifest: dict, name: str, level: str) -> str:
    """A C program that calls every batch function on 9 samples, of batch.c and of one level."""
    count, lines = 9, []
    for kernel in manifest["kernels"]:
        names, declared = [], []
        for prefix in (f"{name}_", f"{name}_{level}_"):
            arguments, prototype = [f"{count}"], ["long n"]
            for side in ("inputs", "outputs"):
                for a in kernel[side]:
                    size = 1
                    for extent in a["shape"]:
                        size *= extent
                    shared = a.get("shared", False) or a.get("summed", False)
                    arguments.append(f"numbers({size if shared else count * size})")
                    const = "const " if side == "inputs" else ""
                    prototype.append(f"{const}double *{a['name']}")
                    if side == "inputs":
                        arguments.append("0" if shared else f"{size}")
                        prototype.append(f"long {a['name']}_step")
            names.append(f"    {prefix}{kernel['name']}_batch({', '.join(arguments)});")
            declared.append(f"void {prefix}{kernel['name']}_batch({', '.join(prototype)});")
        lines.append((declared[1], "\n".join(names)))
    adam = f"void {name}_{level}_adam({name}_adam_job *job, long iterations);"
    head = HEAD.replace("NAME", name).replace("LEVEL", level)
    body = "\n".join(call for _, call in lines)
    joints = len(manifest["joints"])
    descent = ADAM.replace("NAME", name).replace("LEVEL", level)
    descent = descent.replace("LAMBDA", str(10 * joints)).replace("JOINTS", str(joints))
    prototypes = "\n".join([*(line for line, _ in lines), adam])
    return f"{head}{prototypes}\nint main(void)\n{{\n{body}\n{descent}\n    return 0;\n}}\n"


def test_no_byte_out_of_place(robot, tmp_path: Path):
    """Oracle: the sanitizers of the compiler; reads and writes, shifts, conversions, alignment."""
    if machine() != "x86_64":
        pytest.skip("the vector level of this test is that of x86-64")
    lib = robot("gantry")
    for file in lib.folder.glob("*.[ch]"):
        shutil.copy(file, tmp_path)
    manifest = json.loads((lib.folder / "manifest.json").read_text(encoding="utf-8"))
    (tmp_path / "main.c").write_text(driver(manifest, lib.name, "v2"), encoding="utf-8")
    flags = ["-std=c99", "-O1", "-g0", "-march=x86-64-v2", "-DLEVEL=v2", "-DW=2"]
    flags += ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    sources = ["main.c", "kernels.c", "batch.c", "tiles.c", "adam.c"]
    build = subprocess.run(
        [*find_compiler(), *flags, *sources, "-o", "main", "-lm"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    if "cannot find -lasan" in build.stderr or "cannot find" in build.stderr:
        pytest.skip(f"this compiler has no sanitizer libraries: {build.stderr.strip()[:100]}")
    assert build.returncode == 0, build.stderr[:2000]
    done = subprocess.run(
        [str(tmp_path / "main")],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        env={"ASAN_OPTIONS": "detect_leaks=0"},  # the driver frees nothing on purpose
    )
    assert done.returncode == 0, done.stderr[:2000]
    assert done.stdout.split() == ["20", "1", "20", "1"]
