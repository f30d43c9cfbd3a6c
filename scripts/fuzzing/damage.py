"""Kinds of damage by the suffix of a file."""

from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from scripts.fuzzing.archives import npz_parts, parquet_columns
from scripts.fuzzing.bags import remade_database, remade_mcap, remade_ros1, zstd_bomb
from scripts.fuzzing.data_sets import hdf5_parts
from scripts.fuzzing.mutators import (
    ANY,
    TEXT,
    Mutator,
    Rng,
    column,
    compressed,
    entities,
    expressions,
    flip_bits,
    keys,
    links,
    nested,
)
from scripts.fuzzing.trees import json_tree, toml_tree, xml_tree, yaml_tree


def _payload(data: bytes, rng: Rng) -> bytes:
    return ANY[int(rng.integers(len(ANY)))](data, rng)


_JSON: tuple[Mutator, ...] = (*TEXT, nested((b"[", b"]"), (b'{"a":', b"}")), *[json_tree] * 12)
_TAGS = [(b"<%s>" % tag, b"</%s>" % tag) for tag in (b"link", b"body", b"geom", b"visual")]
_XML: tuple[Mutator, ...] = (*TEXT, nested(*_TAGS), entities, entities, *[xml_tree] * 12)
OF_SUFFIX: dict[str, tuple[Mutator, ...]] = {
    ".csv": (*TEXT, column, column),
    ".csv.gz": (*ANY, *[compressed] * 7),
    ".toml": (*TEXT, nested((b"[", b"]"), (b"{a=", b"}")), keys, keys, *[toml_tree] * 12),
    ".json": _JSON,
    ".yaml": (*TEXT, *[yaml_tree] * 12),
    ".urdf": (*_XML, links, links),
    ".xml": _XML,
    ".xacro": (*_XML, expressions, expressions, expressions),
    ".npz": (*ANY, *[npz_parts] * 7),
    ".parquet": (*ANY, *[parquet_columns] * 7),
    ".h5": (*ANY, *[hdf5_parts] * 7),
    ".mat": (*ANY, *[hdf5_parts] * 7),
    ".mcap": (*ANY, *[remade_mcap("json", json_tree)] * 7),
    ".cdr.mcap": (*ANY, *[remade_mcap("cdr", _payload)] * 7),
    ".bag": (*ANY, *[remade_ros1(_payload)] * 7),
    ".db3": (*ANY, *[remade_database] * 7),
    ".zstd": (*ANY, zstd_bomb),
}


def mutated(data: bytes, file: str, rng: Rng) -> bytes:
    """One to three mutators of the file's kind, one after the other; never the file itself."""
    choice = _of(file)
    out = data
    for _ in range(int(rng.choice([1, 1, 2, 3]))):
        with suppress(Exception):  # a mutator that cannot read what another has made leaves it
            out = choice[int(rng.integers(len(choice)))](out, rng)
    return out if out != data else flip_bits(data, rng)


def _of(file: str) -> Sequence[Mutator]:
    suffixes = sorted(OF_SUFFIX, key=len, reverse=True)
    return next((OF_SUFFIX[s] for s in suffixes if file.endswith(s)), ANY)


def generator(seed: int, kind: str, index: int) -> np.random.Generator:
    """Random generator of one file; it does not depend on the other kinds."""
    return np.random.default_rng([seed, *kind.encode(), index])
