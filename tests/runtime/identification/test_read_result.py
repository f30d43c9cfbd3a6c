"""`runtime.read_result` as people call it, and further logs of a result."""

from pathlib import Path

import numpy as np
import pytest

import runtime
from runtime.errors import RecordingError
from runtime.identification.result_file import write_result
from runtime.identification.single_log import identify_recording
from runtime.library import Library
from runtime.recording import Preparation, Recording, read_recording, write_recording


def test_what_is_no_path_is_refused() -> None:
    """Property: a sentence for another type; a path as text is read."""
    with pytest.raises(RecordingError, match="expected the folder of a result, got 3"):
        runtime.read_result(3)  # type: ignore[arg-type]
    with pytest.raises(RecordingError, match="cannot read 'nope'"):
        runtime.read_result("nope")


@pytest.mark.parametrize("header", [True, False])
def test_further_logs_are_read_by_the_recipe_of_the_result(
    lib: Library, noisy: Recording, tmp_path: Path, header: bool
) -> None:
    """Oracle: the log in SI units; numbers of columns are for files without a header alone."""
    n, log = lib.n_joints, noisy.take(slice(0, 300), "short").replace(ddq=None)
    titles = [f"{kind}{k}" for kind in ("A", "M") for k in range(n)]
    rows = np.column_stack([log.t, np.degrees(log.q), -log.required("tau")])
    text = ",".join(["t", *titles]) if header else ""
    np.savetxt(tmp_path / "raw.csv", rows, "%.17g", ",", header=text, comments="")
    clock = '"t"' if header else 0
    columns = [*titles] if header else [*range(1, 2 * n + 1)]
    (tmp_path / "r.toml").write_text(
        f"leave_out = [[1.0, 1.5]]\n[time]\ncolumn = {clock}\nunit = 's'\n[position]\ncolumns = "
        f"{columns[:n]}\nunit = 'deg'\n[torque]\ncolumns = {columns[n:]}\nunit = 'N*m'\nsign = -1\n"
    )
    first = read_recording(tmp_path / "raw.csv", tmp_path / "r.toml")
    preparation = Preparation(filter="butterworth", cutoff_hz=10.0)
    result = identify_recording(first, lib, "ols", preparation=preparation, friction=())
    write_result(result, tmp_path, "test")
    saved = runtime.read_result(tmp_path)
    write_recording(log, tmp_path / "plain.csv")
    for name in ("raw.csv", "plain.csv"):
        again = saved.log_of(str(tmp_path / name), lib)
        np.testing.assert_allclose(again.q, log.q, rtol=0, atol=1e-12)
        np.testing.assert_allclose(again.required("tau"), log.required("tau"), rtol=0, atol=1e-12)
    with pytest.raises(RecordingError, match="no file or folder"):
        saved.log_of(str(tmp_path / "nope.csv"), lib)
