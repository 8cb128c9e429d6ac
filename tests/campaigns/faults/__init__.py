"""Faults planted in the package, in two trees: what the tests of one catch, those of the other catch too."""
