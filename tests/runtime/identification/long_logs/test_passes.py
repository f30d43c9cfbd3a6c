"""One pass over the file: every row is decoded once, in order, and compressed on all cores."""

import threading
from bisect import bisect_left
from itertools import pairwise

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from runtime.estimators.regression import factor
from runtime.estimators.regression.factor import compress, compress_all
from runtime.estimators.regression.samples import Samples
from runtime.identification import long_logs as blocks
from runtime.identification import long_logs as passes
from runtime.identification.long_logs import first_row, parts_of_log
from runtime.identification.single_log import identify_recording
from runtime.recording import Friction, Preparation, Split, write_recording
from runtime.recording.formats import parquet_format
from runtime.recording.formats.tables import Spool
from runtime.recording.streamed import open_streamed
from tests.runtime.motions import moving

PREPARATION = Preparation(filter="butterworth", cutoff_hz=20.0, rate_hz=100.0)


def test_row_groups_are_decoded_once(lib, tmp_path, monkeypatch):
    """Property: with a window in every third block, no more rows are decoded than the log has.

    Sixty percent of them again are allowed for: the first and the last rows are read before, each
    from the start of its row group, a quarter of the log. Blocks in the order of the windows, or of
    the threads that read them, begin a row group anew.
    """
    titles, values = moving(lib, 24_000).titled()
    table = pa.table(dict(zip(titles, values.T, strict=True)))
    pq.write_table(table, tmp_path / "x.parquet", row_group_size=6000)
    monkeypatch.setattr(blocks, "BLOCK", 1024)
    monkeypatch.setattr(parquet_format, "BATCH", 1024)
    monkeypatch.setattr(passes, "WINDOWS", 5)
    decoded, batches = [], parquet_format.ParquetLog.batches

    def counted(log, columns, first_row=0):
        for batch in batches(log, columns, first_row):
            decoded.append(len(batch) * len(columns))
            yield batch

    monkeypatch.setattr(parquet_format.ParquetLog, "batches", counted)
    log = open_streamed(tmp_path / "x.parquet")
    decoded.clear()
    identify_recording(log, lib, preparation=PREPARATION, friction=Friction())
    assert sum(decoded) < 1.6 * values.size


def test_pieces_are_compressed_beside_each_other(lib, monkeypatch):
    """Oracle: the factor of pieces one after the other, to the bit; few pieces are held at once."""
    rng = np.random.default_rng(3)
    q, dq, ddq, tau = rng.normal(size=(4, 400, lib.n_joints))
    whole = Samples(q, dq, ddq, tau, np.zeros((400, lib.n_joints, 0)))
    weights, held, most, threads = np.ones(lib.n_joints), [0], [0], set()
    bounds = range(0, 401, 20)
    parts = [compress(lib, whole.rows(slice(a, b)), weights) for a, b in pairwise(bounds)]

    def pieces():
        for a, b in pairwise(bounds):
            held[0] += 1
            most[0] = max(most[0], held[0])
            yield whole.rows(slice(a, b))

    def traced(*given):
        threads.add(threading.current_thread())
        factor = compress(*given)
        held[0] -= 1
        return factor

    monkeypatch.setattr(factor, "cores", lambda: 3)
    monkeypatch.setattr(factor, "compress", traced)
    result = compress_all(lib, pieces(), weights)
    first = parts[0].merged(*parts[1:16])
    expected = first.merged(*parts[16:])
    assert result.factor == pytest.approx(expected.factor, abs=0.0)
    assert threading.main_thread() not in threads
    assert most[0] <= 7


def test_samples_are_not_read_again_to_be_counted(lib, tmp_path, monkeypatch):
    """Property: the numbers of samples are those of the parts, and at most clocks are read."""
    monkeypatch.setattr(blocks, "BLOCK", 1024)
    write_recording(moving(lib, 12_000), tmp_path / "x.npz")
    log = open_streamed(tmp_path / "x.npz")
    whole = parts_of_log(log, lib, PREPARATION, Friction(), Split(), is_joined=True)
    held = {name: sum(map(len, part.recordings())) for name, part in whole.items()}
    read, numbers = Spool.read, []

    def counted(spool, start, count):
        numbers.append(count)
        return read(spool, start, count)

    monkeypatch.setattr(Spool, "read", counted)
    assert {name: part.count() for name, part in whole.items()} == held
    assert 0 < held["validation"] < held["train"]
    assert sum(numbers) <= held["train"]


def test_the_first_row_of_a_part_takes_few_reads():
    """Oracle: bisection over all rows; with a uniform clock two shares are read, not eighteen."""
    rng = np.random.default_rng(5)
    uneven = np.sort(np.round(rng.uniform(0.0, 1.0, 1000), 2))
    for shares in (uneven, np.zeros(3), np.ones(1), np.linspace(0.0, 1.0, 200_001)):
        for bound in (0.0, 0.3, 0.55, 0.999, 1.5):
            assert first_row(shares.__getitem__, len(shares), bound) == bisect_left(shares, bound)
    rows = []
    clock = np.linspace(0.0, 1.0, 200_001)
    assert first_row(lambda row: rows.append(row) or clock[row], 200_001, 0.7) == 140_000
    assert len(rows) == 2
