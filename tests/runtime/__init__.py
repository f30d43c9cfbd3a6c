"""Tests of the run-time tool."""
