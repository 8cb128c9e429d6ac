"""Fuzzers that know the structure of what they damage; one file a kind of input.

A fuzzer module has `seeds(folder)`, which makes whole inputs, `mutate(rng, seed)`, which damages one, and
`attempt(mutant, folder)`, which gives it to the library: it returns what came of it ("accepted" or "refused"), and
whatever else it raises is a finding. By hand: python -m tests.campaigns.fuzz run_files --cases 20000 --seed 1
"""
