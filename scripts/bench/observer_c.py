"""Time of one sample of observer.c, compiled as its example says, on one core."""

import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from bench.monitoring import FILTERED, OF_ARM, saved_of, stated
from runtime import identify
from runtime.excitation import Trajectory
from runtime.library import Library
from runtime.monitoring.model import model_of
from runtime.monitoring.noise import read_held_out
from runtime.monitoring.observation import detector_for, prepared_for
from runtime.outputs.observer_c import observer_c
from runtime.simulation.virtual_robot import record

SAMPLES, REPEATS, RUNS = 4000, 50, 7
"""Samples of the log, how often it is passed over in a run, and number of runs."""
DRIVER = """
#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <time.h>
#include "observer.h"
static double log_[SAMPLES][21];
static fr3_observer state;
int main(void)
{
    double r[7], threshold[7];
    unsigned contacts = 0;
    struct timespec a, b;
    if (fread(log_, sizeof log_, 1, stdin) != 1) return 1;
    for (int run = 0; run < RUNS; ++run) {
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &a);
        for (int k = 0; k < REPEATS; ++k)
            for (int i = 0; i < SAMPLES; ++i)
                contacts |= fr3_observer_update(&state, log_[i], log_[i] + 7, log_[i] + 14, r,
                                                threshold);
        clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &b);
        double seconds = b.tv_sec - a.tv_sec + 1e-9 * (b.tv_nsec - a.tv_nsec);
        printf("%.9g\\n", seconds / SAMPLES / REPEATS);
    }
    fprintf(stderr, "%u\\n", contacts);
    return 0;
}
"""


def seconds_per_sample(lib: Library, design: Trajectory) -> float:
    """CPU time of one update, the median of `RUNS` runs [s]."""
    log = record(lib, design, seed=0).recording
    result = identify(log, lib, preparation=FILTERED, friction_columns=OF_ARM)
    with TemporaryDirectory() as name:
        folder = Path(name)
        known = saved_of(lib, result, folder)
        model = model_of(known.saved, lib)
        data = prepared_for(log.take(slice(0, SAMPLES), "part"), model)
        held_out = read_held_out(folder, model)
        detector = detector_for(lib, model, data, held_out, stated(1.0))
        texts = observer_c(lib, detector, np.zeros(lib.n_joints))
        for file, text in {**texts, "driver.c": DRIVER}.items():
            (folder / file).write_text(text)
        sources = [folder / "driver.c", folder / "observer.c"]
        sources += [lib.folder / "kernels.c", lib.folder / "update.c"]
        facts = {"SAMPLES": SAMPLES, "REPEATS": REPEATS, "RUNS": RUNS}
        defined = [f"-D{key}={value}" for key, value in facts.items()]
        words = ["cc", "-std=c99", "-O2", *defined, f"-I{lib.folder}", f"-I{folder}"]
        program = str(folder / "run")
        subprocess.run([*words, *map(str, sources), "-lm", "-o", program], check=True)
        rows = np.hstack([data.q, data.dq, data.tau])
        done = subprocess.run([program], input=rows.tobytes(), capture_output=True, check=True)
    return float(np.median([float(line) for line in done.stdout.split()]))
