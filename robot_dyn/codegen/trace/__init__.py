"""From the library's own lines to a program: the formulations run on symbols."""
