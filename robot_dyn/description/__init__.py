"""From a file to checked numbers: catalog, packages, xacro, markup, elements, edits, inertia."""
