"""Tests of the run-time tool."""

import pytest

pytest.register_assert_rewrite(
    "tests.runtime.desk", "tests.runtime.diagnosis", "tests.runtime.pages"
)
