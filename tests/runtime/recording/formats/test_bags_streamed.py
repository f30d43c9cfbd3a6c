"""Bags that stay in their files: the rows of a bag that is read as a whole, in constant memory."""

import json
import tracemalloc
from itertools import pairwise

import numpy as np
import pytest

from runtime.library import Library
from runtime.recording import read_recording, streamed
from runtime.recording.formats import bag_format
from runtime.recording.recipes.recipe_file import recipe_from_table
from runtime.recording.streamed import open_streamed
from tests.runtime.conftest import Command
from tests.runtime.motions import moving
from tests.runtime.recording.formats.test_bags import (
    NAMES,
    WRITERS,
    State,
    mcap_cdr,
    mcap_json,
    motion,
    states,
)


@pytest.fixture(autouse=True)
def _small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bag_format, "PIECE", 32)


def assert_same_rows(path, **options) -> None:
    whole, log = read_recording(path, **options), open_streamed(path, **options)
    assert log.rows == len(whole)
    assert log.joint_names == whole.joint_names
    cuts = [0, 7, 100, log.rows]
    parts = [log.block(a, b) for a, b in pairwise(cuts)]
    for key in ("t", "q", "dq", "tau"):
        found = [getattr(part, key) for part in parts]
        if getattr(whole, key) is None:
            assert found == [None] * 3
        else:
            assert np.array_equal(np.concatenate(found), getattr(whole, key))
    assert log.instants(range(0, log.rows, 50), 10) == pytest.approx(whole.t[::50], abs=0)
    for sentence in log.remarks:
        assert sentence in whole.history
        assert sentence in parts[1].history


@pytest.mark.parametrize("write", WRITERS)
def test_rows_are_those_of_the_whole_bag(tmp_path, write):
    """Oracle: any rows of every kind of bag are the same bits as of a bag read as a whole."""
    path = write(tmp_path / "log.mcap", states())
    assert_same_rows(path)
    assert_same_rows(path, joints=("c", "a", "b"))


def test_topics_recipes_and_merged_publishers(tmp_path):
    """Oracle: topic, sign and order of a recipe, and partial publishers that come late."""
    path = mcap_cdr(tmp_path / "x.mcap", states() + states("/other"))
    table = {
        "topic": "/other",
        "joints": ["b", "a", "c"],
        "time": {"unit": "s"},
        "position": {"unit": "rad", "order": [1, 0, 2]},
        "torque": {"unit": "N*m", "sign": -1},
    }
    assert_same_rows(path, recipe=recipe_from_table(table))
    told = states(names=("b", "a")) + states(names=("c",))
    swapped = [told[i ^ 1] for i in range(len(told))]
    path = mcap_json(tmp_path / "y.mcap", swapped)
    assert_same_rows(path, joints=NAMES)
    _, q, _, tau = motion()
    found = open_streamed(path, joints=NAMES).block(0, 200)
    assert np.array_equal(found.q, q)
    assert np.array_equal(found.tau, tau)
    assert "Sorted 200 messages" in found.history[0]


def test_a_publisher_that_says_little_and_one_that_begins_late(tmp_path):
    """Oracle: rows of three publishers of different rates and beginnings are merged by stamp."""
    told: list[State] = states(names=("a",))
    told += [each for each in states(names=("b",)) if each[1] >= 0.3]
    told += states(names=("c",))
    told.sort(key=lambda each: each[1])
    found = open_streamed(mcap_json(tmp_path / "x.mcap", told), joints=NAMES)
    t, q, *_ = motion()
    late = t >= 0.3
    assert found.rows == late.sum()
    assert np.array_equal(found.block(0, 200).q, q[late])
    assert "30 incomplete rows dropped" in " ".join(found.remarks)


def test_a_message_without_positions_is_a_corrupt_row(tmp_path):
    """Oracle: it is dropped and told, as it is where a bag is read as a whole."""
    told = states()
    told[50] = (*told[50][:3], np.zeros(0), *told[50][4:])
    path = mcap_json(tmp_path / "x.mcap", told)
    found, whole = open_streamed(path).block(0, 200), read_recording(path)
    assert np.array_equal(found.t, whole.t)
    for each in (found, whole):
        assert "Dropped 1 of 200 rows as corrupt" in " ".join(each.history)


def test_late_messages_are_waited_for(tmp_path):
    """Oracle: a first message that comes last, and a bag backwards, are the rows in order."""
    told = states()
    assert_same_rows(mcap_json(tmp_path / "x.mcap", [*told[1:], told[0]]))
    path = mcap_json(tmp_path / "y.mcap", told[::-1])
    assert_same_rows(path)
    assert np.array_equal(open_streamed(path).block(0, 200).q, motion()[1])


def test_memory_does_not_grow_with_the_bag(tmp_path, monkeypatch):
    """Property: four times the messages take the same memory, to a tenth."""
    monkeypatch.setattr(bag_format, "PIECE", 256)
    monkeypatch.setattr(bag_format.Spool, "SMALL", 2**16)
    t, *signals = motion(6000)
    told = [("/joint_states", t[i], NAMES, *(s[i] for s in signals)) for i in range(len(t))]
    open_streamed(mcap_cdr(tmp_path / "first.mcap", told[:9]))  # types of messages are kept
    peaks = []
    for count in (1500, 6000):
        path = mcap_cdr(tmp_path / f"{count}.mcap", told[:count])
        tracemalloc.start()
        log = open_streamed(path)
        assert sum(len(log.block(k, k + 500)) for k in range(0, count, 500)) == count
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.1 * peaks[0]


def test_command_takes_a_bag(lib: Library, tmp_path, command: Command, monkeypatch):
    """Oracle: a large bag is streamed by itself, and the payload is found."""
    log = moving(lib, 4000, payload=0.1 * lib.pi0)
    rows = zip(log.t, log.q, log.dq, log.tau, strict=True)
    told = [("/joint_states", t, lib.joint_names, *signals) for t, *signals in rows]
    mcap_cdr(tmp_path / "x.mcap", told)
    monkeypatch.setattr(streamed, "LARGE", 2**19)
    words = ("--robot", lib.folder, "--cutoff", "20", "--settings", "rate=100", "--out", "out")
    ran = command("identify", "x.mcap", *words, "--friction", "viscous,coulomb")
    assert ran.code == 0, ran.err
    assert "streaming 4000 rows of x" in ran.out
    facts = json.loads((tmp_path / "out" / "result.json").read_text())
    percent = facts["torque_error_percent"]
    assert percent["after_overall"] < 0.1 * percent["before_overall"]
