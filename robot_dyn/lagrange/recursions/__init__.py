"""Dynamics by recursion over the bodies, base to tips and back, in O(n): the algorithms of Featherstone's book."""
