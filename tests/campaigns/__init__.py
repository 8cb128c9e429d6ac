"""Campaigns: hard cases, error estimates, fuzzing, batches and foreign files, which run for hours in full."""
