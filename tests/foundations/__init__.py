"""Tests of numbers, linear algebra, value objects and files: the single modules of `robot_dyn`."""
