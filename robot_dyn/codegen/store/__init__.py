"""Machine code on disk: a folder of entries, each under the digest of all it came from."""
