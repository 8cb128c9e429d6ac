"""The same equations as machine code: traced from the library's own lines, emitted, compiled, checked."""
