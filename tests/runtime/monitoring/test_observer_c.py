"""observer.c: compiled with sanitizers, it gives r and the thresholds of the Python observer."""

import dataclasses
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from runtime import Recording
from runtime.errors import ExportError
from runtime.library import Library
from runtime.monitoring.model import model_of
from runtime.monitoring.noise import alarm_rate, read_held_out
from runtime.monitoring.observation import Detector, detector_for, observe, prepared_for
from runtime.monitoring.observer import ObserverSettings
from runtime.outputs.observer_c import observer_c
from runtime.recording import Friction
from runtime.recording.settings import JointMotion
from tests.compiling import compile_program
from tests.runtime.monitoring.conftest import Monitored

DRIVER = """
#include <stdio.h>
#include "observer.h"
static fr3_observer state;
int main(void)
{
    double x[21], r[7], threshold[7];
    while (fread(x, sizeof(double), 21, stdin) == 21) {
        unsigned contacts = fr3_observer_update(&state, x, x + 7, x + 14, r, threshold);
        double found = contacts;
        fwrite(r, sizeof(double), 7, stdout);
        fwrite(threshold, sizeof(double), 7, stdout);
        fwrite(&found, sizeof(double), 1, stdout);
    }
    return 0;
}
"""
STRICT = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-fsanitize=address,undefined", "-O1")


@pytest.fixture(scope="module")
def detector(lib: Library, monitored: Monitored, rest_of_log: Recording) -> Detector:
    """Observer of the real arm, the model's band left out."""
    model = model_of(monitored.saved, lib)
    part = prepared_for(rest_of_log.take(slice(0, 3000), "part"), model)
    held_out = read_held_out(monitored.folder, model)
    return detector_for(lib, model, part, held_out, alarm_rate("1 per hour"))


def compiled(texts: dict[str, str], lib: Library, folder: Path, main: str) -> Path:
    """A program of observer.c and the library of the robot, which contains kernels.c."""
    if shutil.which("cc") is None:
        pytest.skip("no C compiler")
    for name, text in {**texts, "driver.c": DRIVER}.items():
        (folder / name).write_text(text)
    sources = [str(folder / main), str(folder / "observer.c")]
    library = [str(lib.folder / f"lib{lib.name}.so"), f"-Wl,-rpath,{lib.folder}"]
    words = ["cc", *STRICT, f"-I{lib.folder}", f"-I{folder}", *sources, *library, "-lm", "-o"]
    compile_program([*words, folder / "run"], folder)
    return folder / "run"


def test_c_is_the_python_observer(
    lib: Library, detector: Detector, rest_of_log: Recording, tmp_path: Path
) -> None:
    """Oracle: r, thresholds and contacts of a real log with a push, by the Python observer.

    Both sum the same 43 terms in another order: 1e-9 N·m. The sanitizers find no fault.
    """
    part = prepared_for(rest_of_log.take(slice(0, 2500), "part"), detector.model)
    tau = np.array(part.tau)
    tau[1200:, 1] += 4.0
    seen = observe(lib, detector, part.replace(tau=tau))
    program = compiled(observer_c(lib, detector, np.zeros(7)), lib, tmp_path, "driver.c")
    data = np.hstack([part.q, part.dq, tau]).tobytes()
    done = subprocess.run([str(program)], input=data, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    assert not done.stderr
    answer = np.frombuffer(done.stdout).reshape(-1, 15)
    first = detector.settings.steps + 1
    np.testing.assert_allclose(answer[first:, :7], seen.r[first:], rtol=0, atol=1e-9)
    np.testing.assert_allclose(answer[first:, 7:14], seen.threshold[first:], rtol=0, atol=1e-9)
    above = np.abs(seen.r[first:]) > seen.threshold[first:]
    assert above[:, 1].any()
    bits = answer[first:, 14].astype(int)
    np.testing.assert_array_equal((bits[:, None] >> np.arange(7)) & 1, above)


def test_c_has_the_direct_torque_and_the_terms_of_a_calibration(
    lib: Library, detector: Detector, rest_of_log: Recording, tmp_path: Path
) -> None:
    """Oracle: a push is found by the direct torque alone, in the same samples as in Python.

    An offset of the session is no contact, also before the direct torque of other joints is known.
    """
    part = prepared_for(rest_of_log.take(slice(0, 2000), "part"), detector.model)
    tau = np.array(part.tau)
    tau[:, 0] += 20 * detector.noise.sigma[0]
    tau[1200:1500, 1] += 4.0
    is_direct = np.array([0, 1, 0, 1, 0, 0, 0], bool)
    noise = dataclasses.replace(detector.noise, largest=np.zeros(7))
    changed = dataclasses.replace(
        detector, noise=noise, levels=np.full(7, 9.0), share=0.0, is_direct=is_direct
    )
    seen = observe(lib, changed, part.replace(tau=tau))
    above = np.abs(np.nan_to_num(seen.r)) > seen.threshold
    program = compiled(observer_c(lib, changed, np.zeros(7)), lib, tmp_path, "driver.c")
    data = np.hstack([part.q, part.dq, tau]).tobytes()
    done = subprocess.run([str(program)], input=data, capture_output=True, check=True)
    bits = np.frombuffer(done.stdout).reshape(-1, 15)[:, 14].astype(int)
    assert above[:, 1].any()
    assert not above[:, 0].any()
    np.testing.assert_array_equal((bits[:, None] >> np.arange(7)) & 1, above)


def test_no_uninitialised_byte_decides(
    lib: Library, detector: Detector, rest_of_log: Recording, tmp_path: Path
) -> None:
    """Oracle: valgrind's memcheck on the portable code; a contact depends on every number."""
    valgrind, compiler = shutil.which("valgrind"), shutil.which("cc")
    if valgrind is None or compiler is None:
        pytest.skip("valgrind is not installed: apt-get install valgrind")
    texts = observer_c(lib, detector, np.zeros(7))
    for name, text in {**texts, "driver.c": DRIVER}.items():
        (tmp_path / name).write_text(text)
    sources = [tmp_path / "driver.c", tmp_path / "observer.c"]
    sources += [lib.folder / "kernels.c", lib.folder / "update.c"]
    words = [compiler, "-std=c99", "-g", "-O0", f"-I{lib.folder}", f"-I{tmp_path}"]
    program = tmp_path / "run"
    compile_program([*words, *sources, "-lm", "-o", program], tmp_path)
    part = prepared_for(rest_of_log.take(slice(0, 400), "part"), detector.model)
    data = np.hstack([part.q, part.dq, part.tau]).tobytes()
    done = subprocess.run(
        [valgrind, "--error-exitcode=9", "--quiet", "--leak-check=full", str(program)],
        input=data,
        capture_output=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr.decode()[:2000]
    assert not done.stderr
    answer = np.frombuffer(done.stdout).reshape(-1, 15)
    first = detector.settings.steps + 1
    seen = observe(lib, detector, part)
    np.testing.assert_allclose(answer[first:, :7], seen.r[first:], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "columns",
    [("viscous", "rotor", "stribeck"), ("dahl", "dahl_load"), ("load", "viscous", "coulomb"), ()],
)
def test_without_window_and_with_other_friction(
    columns: tuple[str, ...], lib: Library, detector: Detector, tmp_path: Path
) -> None:
    """Oracle: the same without a window, with rotors, with a memory and without any friction."""
    phi = np.linspace(0.1, 0.9, 7 * len(columns)).reshape(7, -1)
    terms = Friction(columns, dahl_stroke=tuple(np.linspace(1e-3, 4e-3, 7).tolist()))
    model = dataclasses.replace(detector.model, terms=terms, phi=phi)
    settings = ObserverSettings(1000.0, 50.0)
    changed = dataclasses.replace(detector, model=model, settings=settings)
    rng = np.random.default_rng(0)
    t = np.arange(300) / 1000
    q = lib.home + np.sin(2 * t)[:, None] * rng.normal(size=7)
    dq = np.gradient(q, t, axis=0)
    log = Recording(t, q, dq, None, rng.normal(size=q.shape))
    seen = observe(lib, changed, log)
    program = compiled(observer_c(lib, changed, np.zeros(7)), lib, tmp_path, "driver.c")
    data = np.hstack([q, dq, log.tau]).tobytes()
    done = subprocess.run([str(program)], input=data, capture_output=True, check=True)
    answer = np.frombuffer(done.stdout).reshape(-1, 15)
    np.testing.assert_allclose(answer[1:, :7], seen.r[1:], rtol=0, atol=1e-9)
    np.testing.assert_allclose(answer[1:, 7:14], seen.threshold[1:], rtol=0, atol=1e-9)


def test_the_example_runs(lib: Library, detector: Detector, tmp_path: Path) -> None:
    """Oracle: an arm at rest without torque: r is minus the torque of the model at rest."""
    program = compiled(observer_c(lib, detector, np.zeros(7)), lib, tmp_path, "example_observer.c")
    done = subprocess.run([str(program)], capture_output=True, text=True, check=True)
    still = np.zeros(7)
    columns = detector.model.columns(JointMotion(still[None], lib.home[None], lib=lib))[1][0]
    right = lib.base_inverse_dynamics(lib.home, still, still, detector.model.beta)
    right = right + np.sum(columns * detector.model.phi, axis=1)
    shown = [float(line.split()[3].rstrip(",")) for line in done.stdout.splitlines()[:7]]
    np.testing.assert_allclose(shown, right, atol=1e-4)  # four digits are printed


def test_what_has_no_c_code_is_refused(lib: Library, detector: Detector) -> None:
    """Property: one sentence that names the column."""
    model = dataclasses.replace(detector.model, terms=Friction(("position",)), phi=np.ones((7, 1)))
    with pytest.raises(ExportError, match="position"):
        observer_c(lib, dataclasses.replace(detector, model=model), np.zeros(7))
