"""Recipes by which libraries are compiled at first use: levels, spelling of flags."""

import sys

from runtime.common.compiler import spelled
from runtime.library.compile_cache import read_recipe
from tests.conftest import REPOSITORY


def test_zig_spells_instruction_sets_with_underscores() -> None:
    """Property: for zig alone."""
    zig = (sys.executable, "-m", "ziglang", "cc")
    assert spelled("-march=x86-64-v3", zig) == "-march=x86_64_v3"
    assert spelled("-march=x86-64-v3", ("cc",)) == "-march=x86-64-v3"


def test_the_recipe_of_the_fr3_is_read() -> None:
    """Property: the committed one, with every level that symgen knows."""
    recipe = read_recipe(REPOSITORY / "generated" / "fr3")
    assert recipe.levels("x86_64") == ("v4", "v3", "v2", "portable", "casadi")
    assert recipe.levels("aarch64") == ("neon", "portable", "casadi")
    assert recipe.levels("riscv64") == ("portable", "casadi")
