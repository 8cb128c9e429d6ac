"""Tests of the compiled engine; kernels are shared by all tests of a session."""
