"""The cross-check: one robot by Pinocchio and by the library's own Lagrangian, and its file by a second reader."""
