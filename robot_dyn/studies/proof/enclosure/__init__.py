"""One proven step: polynomial, defect, tube and Lohner's error set, in balls."""
