"""Tests, named after the laws they check."""
