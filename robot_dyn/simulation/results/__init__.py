"""The trajectory of a run: samples, ledger, tables, files, where it came from."""
