"""The HTML of a page: replay.html, replay.css and the scripts, which text.py combines."""
