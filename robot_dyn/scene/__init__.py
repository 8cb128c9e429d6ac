"""Scenes: a TOML file → a validated Setup. What a scene does not name does not act, gravity included."""
