"""Where a run switches: thresholds, root finding, modes of set-valued effects, impacts, payloads."""
