"""Tests of the build-time tool."""
